"""Nasty names and numbers on the command line are one line and exit 2."""

import pytest

from postproc.cli import main
from tests.kit import runs

NASTY = [
    "a\0b",
    "/dev/null/x",
    "x" * 5000,
    "\x1b[2J",
    "/",
    "~nouser/x",
    "\udcff",
    "a\nb",
    "/dev/full",
]


def _one_line(capsys):
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    assert "\x1b" not in lines[0]
    return lines[0]


@pytest.fixture
def run(tmp_path, monkeypatch):
    runs.write_journal(tmp_path / "a.journal", runs.records(12))
    monkeypatch.chdir(tmp_path)
    return "a.journal"


@pytest.mark.parametrize("name", NASTY)
@pytest.mark.parametrize(
    "command",
    [
        "info {}",
        "info --verify {}",
        "replay {}",
        "smooth {}",
        "smooth a.journal {}",
        "plot {}",
        "report {}",
        "view {} --save o.rrd",
        "verify {} --claim 52,13",
        "share {} -o o.h5",
        "export {} -o o.kml",
        "import {} -o o.h5",
        "recover {}",
        "celldb lookup {} --cell 262-1-2-3",
        "celldb import {} -o o.db",
        "baseline list -b {}",
        "compare {} a.journal",
        "compare a.journal {}",
        "verify a.journal --claims {}",
        "view a.journal --save o.rrd --basemap {}",
    ],
)
def test_what_is_to_be_read(run, capsys, command, name):
    argv = [name if word == "{}" else word for word in command.split()]
    if command == "recover {}" and name == "/":
        pytest.skip("a folder, whose journals would be recovered")
    assert main(argv) == 2
    _one_line(capsys)


@pytest.mark.parametrize("name", ["a\0b.{}", "/dev/null/x.{}", "x" * 5000 + ".{}", "none/x.{}"])
@pytest.mark.parametrize(
    "command",
    [
        "plot a.journal -o png",
        "report a.journal -o html",
        "view a.journal --save rrd",
        "share a.journal -o h5",
        "compare a.journal a.journal -o html",
        "baseline add a.journal -b db",
        "export a.journal -o csv",
        "export a.journal -o kml",
    ],
)
def test_what_is_to_be_written(run, capsys, command, name):
    *argv, suffix = command.split()
    assert main([*argv, name.format(suffix)]) == 2
    _one_line(capsys)


@pytest.mark.parametrize("value", ["nan", "inf", "-3", "x", "", "1e300"])
@pytest.mark.parametrize(
    ("option", "command"),
    [
        ("--height", "smooth a.journal"),
        ("--height", "report a.journal"),
        ("--height", "verify a.journal --claim 52,13"),
        ("--blur-m", "share a.journal -o o.h5"),
        ("--port", "view a.journal --web"),
        ("--digest", "info --verify a.journal"),
    ],
)
def test_a_number_without_a_meaning_names_its_option(run, capsys, option, command, value):
    assert main([*command.split(), f"{option}={value}"]) == 2
    assert option in _one_line(capsys)
