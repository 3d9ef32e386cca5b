"""Every command that ends says what it did as JSON."""

import argparse
import json

import pytest

from postproc.cli import _parser, main
from tests.kit import runs


def commands(parser, name=""):
    """Name and parser of each command that can be run."""
    below = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not below:
        yield name, parser
    for action in below:
        for word, command in action.choices.items():
            yield from commands(command, f"{name} {word}".strip())


def test_every_command_has_it():
    """A completion is a script."""
    without = {
        name
        for name, command in commands(_parser())
        if "--json" not in command._option_string_actions
    }
    assert without == {"completion"}


@pytest.fixture
def journal(tmp_path):
    runs.write_journal(tmp_path / "walk.journal", runs.records(20), close=False)
    return tmp_path / "walk.journal"


def test_plot(journal, capsys):
    assert main(["plot", str(journal), "--cell", "262-01-4711-1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {
        "path": str(journal.with_suffix(".png")),
        "bytes": journal.with_suffix(".png").stat().st_size,
    }


def test_recover(journal, capsys):
    (journal.parent / "bad.journal").write_bytes(b"no journal")
    assert main(["recover", str(journal.parent), "--json"]) == 3
    shown = capsys.readouterr()
    bad, good = sorted(json.loads(shown.out), key=lambda one: one["journal"])
    assert (good["run"], good["loss"]) == (str(journal.with_suffix(".h5")), "")
    assert len(good["digest"]) == 64
    assert bad["run"] is None
    assert "bad.journal" in bad["loss"]
    assert shown.err == ""
