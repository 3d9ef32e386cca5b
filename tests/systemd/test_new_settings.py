"""An upgrade names the settings that the user's site.toml does not have, once."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from logger import config

REPOSITORY = Path(__file__).parents[2]
EXAMPLE = REPOSITORY / "systemd/site.toml"
MINIMAL = '[run]\ndirectory = "/r"\n[modem]\nport = "/m"\n[gnss]\nport = "/g"\n'


def _upgrade(folder, text, example=EXAMPLE):
    (folder / "site.toml").write_text(text)
    script = REPOSITORY / "systemd/debian/new_settings.py"
    done = subprocess.run(
        [sys.executable, script, example, folder / "site.toml", folder / "state/printed"],
        capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": REPOSITORY},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_nothing_is_said_of_a_copy_of_the_example(tmp_path):
    assert _upgrade(tmp_path, EXAMPLE.read_text()) == ""


def test_every_setting_that_is_left_out_is_named_once(tmp_path):
    said = _upgrade(tmp_path, MINIMAL)
    named = {
        (table, key)
        for table, keys in re.findall(r"^  \[(\w+)\] (.*)$", said, re.MULTILINE)
        for key in keys.split(", ")
    }
    every = {
        (table, key)
        for table, settings in config._TABLES.items()
        for key in (settings.__struct_fields__ if table else ())
    }
    assert named == every - {("run", "directory"), ("modem", "port"), ("gnss", "port")}
    assert _upgrade(tmp_path, MINIMAL) == ""


def test_the_example_of_a_second_modem_is_no_setting_that_is_missing(tmp_path):
    assert "[source]" not in _upgrade(tmp_path, MINIMAL)
    second = '[[source]]\nkind = "modem"\nport = "/n"\n'
    assert "[source]" not in _upgrade(tmp_path, EXAMPLE.read_text() + second)


def test_a_line_that_was_taken_out_is_named(tmp_path):
    text = re.sub("# streets = .*\n", "", EXAMPLE.read_text())
    assert "defaults:\n  [live] streets\n" in _upgrade(tmp_path, text)


def test_a_setting_of_a_newer_version_is_named_after_others_were(tmp_path):
    _upgrade(tmp_path, MINIMAL)
    newer = tmp_path / "example.toml"
    newer.write_text(EXAMPLE.read_text() + '# colour = "blue"\n')
    said = _upgrade(tmp_path, MINIMAL, newer)
    assert [line for line in said.splitlines() if line.startswith("  ")] == ["  [page] colour"]


@pytest.mark.parametrize(
    "page", ['[page]\nmap = ""\n', '[ page ]\n"map"=""\n', 'page.map = ""\n', 'page = {map = ""}\n']
)
def test_a_setting_counts_however_it_is_written(page, tmp_path):
    text = page + MINIMAL if page.startswith("page") else MINIMAL + page
    said = _upgrade(tmp_path, text)
    assert "  [page] listen\n" in said


def test_a_configuration_that_the_new_version_refuses_is_reported(tmp_path):
    said = _upgrade(tmp_path, MINIMAL + '[live]\nteller = "x"\n')
    assert "the service does not start" in said
    assert 'unknown key "teller"' in said
