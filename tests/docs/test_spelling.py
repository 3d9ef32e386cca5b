"""`make lint` finds a misspelt word; docs/words.txt has what only looks like one."""

import subprocess
import sys

import pytest

from tests.docs.pages import ROOT

WORDS = ROOT / "docs/words.txt"


def _codespell(path) -> str:
    pytest.importorskip("codespell_lib", reason="pip install '.[dev]'")
    command = [sys.executable, "-m", "codespell_lib", str(path)]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()


def test_a_misspelt_word_is_found(tmp_path):
    page = tmp_path / "page.md"
    misspelt = "reciev" + "ing"  # in one piece the checker would find it here
    page.write_text(f"The receiver is {misspelt}, and NEES is a term.\n")
    assert f"{misspelt} ==> receiving" in _codespell(page)
    assert "NEES" not in _codespell(page)


def test_the_guide_has_none():
    assert _codespell(ROOT / "docs/guide.md") == ""


def test_the_list_of_words_is_sorted():
    words = WORDS.read_text("utf-8").split()
    assert words == sorted(set(words))
