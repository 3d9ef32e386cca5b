"""Every command that ends says what it did as JSON."""

import json

import click
import pytest

from postproc.cli import main, program
from tests.kit import runs


def commands(group, prefix=""):
    """Name and command of each command that can be run."""
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from commands(command, f"{prefix}{name} ")
        else:
            yield prefix + name, command


def test_every_command_prints_json():
    without = {
        name
        for name, command in commands(program)
        if not any("--json" in parameter.opts for parameter in command.params)
    }
    assert without == {"completion", "guide", "help"}  # a script, JSON alone, and help


@pytest.fixture
def journal(tmp_path):
    runs.write_journal(tmp_path / "walk.journal", runs.records(20), close=False)
    return tmp_path / "walk.journal"


def test_plot(journal, capsys):
    assert main(["plot", str(journal), "--cell", "262-01-4711-1", "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output == {
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


@pytest.mark.parametrize("command", ["info", "smooth", "suspect", "replay", "verify", "no-command"])
def test_an_error_is_a_line_on_stderr_alone(command, tmp_path, capsys):
    assert main([command, str(tmp_path / "none.h5"), "--json"]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.count("\n") == 1
