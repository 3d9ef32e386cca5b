"""Colours and bars where somebody is looking, and nowhere else."""

import subprocess
import sys

import pytest

from tests.kit import runs
from tests.kit.terminal import COLOUR, postproc


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("terminal") / "walk.journal"
    records = runs.records(30)
    runs.write_journal(path, [*records, runs.Record(31 * 10**9, "logger", runs.Note("warning", "x", "look here"))])
    return str(path)


@pytest.mark.parametrize("command", ["info", "smooth"])
def test_coloured_on_a_terminal_and_not_for_those_who_say_so(run, command):
    shown, code = postproc(command, run)
    assert code == 0
    assert COLOUR.search(shown)
    plain, code = postproc(command, run, NO_COLOR="1")
    assert code == 0
    assert not COLOUR.search(plain)
    assert "262-01-4711-1" in plain


def test_a_bar_on_a_terminal_only(run):
    shown, _ = postproc("smooth", run)
    assert "locating" in shown
    piped = subprocess.run(
        [sys.executable, "-m", "postproc.cli", "smooth", run], capture_output=True, check=True, text=True
    )
    assert "\x1b" not in piped.stdout + piped.stderr
    assert piped.stderr == ""
