"""Width of lines, and names in the terms of the field."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.docs.pages import PAGES, ROOT, name_of, text_of

MOST_COLUMNS = 100
FOLDERS = ("logger", "postproc", "tests", "benchmarks", "docs", "examples")

PARTICIPLE = re.compile(
    r"\w*(ed|told|found|held|kept|seen|heard|known|drawn|made|taken|given|left|met|sent|built|gone"
    r"|lost|felt|shown|worn|begun|said|written|chosen|driven|fallen|hidden|spoken|broken|listened)"
)
VERBS_AND_NOUNS = {
    "embed": "verb",
    "exceed": "verb",
    "feed": "verb: give bytes to a parser",
    "left": "side",
    "need": "verb",
    "proceed": "verb",
    "seed": "noun: of a random generator",
    "shed": "verb",
    "speed": "noun",
    "succeed": "verb",
    "unfeed": "verb",
}
"""Words with the ending of a participle that are none."""
STANDARD_TERMS = {
    "closed": "method of tornado's streams",
    "heard": "method of the devices of the boot rig, which is not ours",
    "fixed": "of a number of digits, as in printf",
    "padded": "array with padding",
    "signed": "with a sign",
    "unsolicited": "result code that the modem sends by itself, 3GPP TS 27.007",
}
"""Participles that are terms of the field."""

HOUSE_WORDS = {
    "teller", "patience", "placement", "room", "held", "scale", "visited", "watch", "handover",
    "together", "division", "joint", "field", "drawn", "asked", "story", "sheet", "unfolding",
    "seen", "loops", "batch", "whole_file", "moments", "judged", "told", "listened", "driven",
    "found", "kept", "served", "smoothed", "walked", "starting", "growth", "endings",
}  # fmt: skip
"""Names of modules that were replaced by the terms of the field."""


@cache
def files(*folders: str) -> tuple[Path, ...]:
    """Python files of the folders."""
    return tuple(sorted(p for folder in folders for p in (ROOT / folder).rglob("*.py")))


def test_no_line_of_code_is_wide():
    wide = [
        name_of(path)
        for path in files(*FOLDERS)
        if any(len(code_of(line)) > MOST_COLUMNS for line in path.read_text("utf-8").splitlines())
    ]
    assert wide == []


def code_of(line: str) -> str:
    """A line without a comment for a checker, which has to stand in the line that it is about."""
    return re.sub(r"  # (noqa|type): .*", "", line)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_line_of_prose_is_wide(page):
    """Rows of tables cannot be wrapped."""
    lines = text_of(page).splitlines()
    assert [s for s in lines if len(s) > MOST_COLUMNS and not s.startswith("|")] == []


def test_no_function_is_named_by_a_bare_participle():
    named = [
        f"{name_of(path)}:{node.lineno} {node.name}"
        for path in files(*FOLDERS)
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef) and is_participle(node.name.strip("_"))
    ]
    assert named == []


def is_participle(name: str) -> bool:
    """True for one word that is a participle and no term of the field."""
    if "_" in name or name in VERBS_AND_NOUNS or name in STANDARD_TERMS:
        return False
    return PARTICIPLE.fullmatch(name) is not None


def test_participles_are_recognised():
    assert is_participle("judged")
    assert is_participle("told")
    assert not is_participle("feed")
    assert not is_participle("median")
    assert not is_participle("accepted_rows")


def test_no_module_has_a_house_word_as_its_name():
    named = [name_of(path) for path in files(*FOLDERS) if path.stem in HOUSE_WORDS]
    assert named == []
