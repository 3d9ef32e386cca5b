"""Nasty names and numbers on the command line are one line and exit 2."""

import json

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


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ("", {"near", "far", "omni", "sector", "3 m", "10 m", "28 m"}),
        (
            "--reach any --antenna any --height any",
            {"near", "far", "omni", "sector", "3 m", "10 m", "28 m"},
        ),
        ("--reach near --antenna omni --height 5", {"near", "omni", "5 m"}),
        ("--reach far --antenna sector --height 30.5", {"far", "sector", "30.5 m"}),
        ("--reach far", {"far", "omni", "sector", "3 m", "10 m", "28 m"}),
        ("--height 0", {"near", "far", "omni", "sector", "0 m"}),
    ],
)
def test_the_levels_weigh_reach_antenna_and_height_unless_they_are_fixed(
    run, capsys, options, names
):
    command = ["smooth", run, "--cell", "262-01-4711-1", *options.split()]
    assert main([*command, "--json"]) == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert {one["name"] for one in cell["alternatives"]} == names


def test_the_details_of_a_cell_name_reach_antenna_and_height(run, capsys):
    assert main(["smooth", run, "-v", "--reach", "near", "--height", "5"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "reach: near (fixed); antenna: omni " in said
    assert "; height: 5 m (fixed)" in said


def test_a_height_that_is_none_says_what_is(run, capsys):
    assert main(["smooth", run, "--height", "tall"]) == 2
    assert "at most 10,000 m, or any" in _one_line(capsys)
