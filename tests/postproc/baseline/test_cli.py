"""`postproc baseline`: what it prints, its exit codes, and errors of one line."""

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from logger.baseline_file import BaselineFile
from logger.baseline_store import without_runs
from logger.core.runfile import read_sound_run
from postproc.cli import main
from tests.postproc.baseline.walks import cell, name, two_cells, write_walk


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        write_walk(tmp_path, number, two_cells(-50.0 - number), n=40)
    return tmp_path


def output_of(capsys, *arguments, code=0):
    assert main(["baseline", *arguments]) == code
    return capsys.readouterr()


def document(capsys, *arguments, code=0):
    return json.loads(output_of(capsys, *arguments, "--json", code=code).out)


def test_runs_are_added_once(folder, capsys):
    added = document(capsys, "add", "run-000001.h5", "run-000002.h5", "run-000001.journal")
    assert [run["walk"] for run in added["runs"]] == [1, 2, None]
    assert [run["is_known"] for run in added["runs"]] == [False, False, True]
    assert (added["walks"], added["cells"]) == (2, 2)
    again = output_of(capsys, "add", "run-000001.h5").out
    assert again == "baseline.db: 0 added, 1 in it already; 2 walks, 2 cells\n"


def test_a_run_and_its_shared_copy_are_one_walk(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_walk(tmp_path, 1, two_cells())
    assert main(["share", "run-000001.h5", "-o", "copy.h5", "--blur-m", "50"]) == 0
    assert main(["baseline", "add", "run-000001.h5", "-b", "whole.db"]) == 0
    capsys.readouterr()
    whole, copy = ("run-000001.h5", "copy.h5")
    for order in ((whole, copy, whole), (copy, whole, copy)):
        added = output_of(capsys, "add", *order)
        assert "; 1 walk, 2 cells" in added.out
        assert "walk 1, " in added.err
        listed = document(capsys, "list")
        assert [walk["name"] for walk in listed["walks"]] == [whole]
        Path("baseline.db").unlink()
    # a copy that is compared with its original has nothing new
    others = without_runs(Path("whole.db"), [read_sound_run(Path(copy))], tmp_path)
    with closing(BaselineFile(others)) as file:
        assert file.n_walks == 0


def test_a_run_that_cannot_be_read_does_not_stop_the_others(folder, capsys):
    (folder / "bad.h5").write_bytes(b"no run")
    output = output_of(capsys, "add", "bad.h5", "run-000002.h5", "missing.h5", code=3)
    assert len(output.err.splitlines()) == 2
    assert "bad.h5 was not added" in output.err
    assert "1 added; 1 walk, 2 cells" in output.out


def test_the_list_has_walks_and_trusted_cells(folder, capsys):
    output_of(capsys, "add", "run-000001.h5", "run-000002.h5")
    assert not output_of(capsys, "trust", name(1), "my femtocell").err
    text = output_of(capsys, "list").out
    assert "baseline.db: 2 walks" in text
    assert f"trusted: {name(1)}: my femtocell" in text
    listed = document(capsys, "list")
    assert [walk["name"] for walk in listed["walks"]] == ["run-000001.h5", "run-000002.h5"]
    assert listed["trusted"] == [{"cell": name(1), "note": "my femtocell"}]


def test_a_name_that_no_walk_has_heard_is_trusted_with_a_remark(folder, capsys):
    """A digit of the network is missing."""
    output_of(capsys, "add", "run-000001.h5")
    output = output_of(capsys, "trust", name(1).replace("-01-", "-1-"), "my femtocell")
    assert "no walk of baseline.db has heard" in output.err


def test_a_walk_is_removed_and_trust_stays(folder, capsys):
    output_of(capsys, "add", "run-000001.h5", "run-000002.h5")
    output_of(capsys, "trust", name(1), "my femtocell")
    digest = document(capsys, "list")["walks"][1]["digest"]
    removed = document(capsys, "remove", digest[:10])
    assert [walk["id"] for walk in removed["removed"]] == [2]
    left = document(capsys, "list")
    assert [walk["id"] for walk in left["walks"]] == [1]
    assert left["trusted"]
    assert document(capsys, "trust", name(1), "--withdraw")["trusted"] is False
    assert document(capsys, "list")["trusted"] == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["list"],
        ["remove", "1"],
        ["trust", "262-01-801-1", "a note"],
        ["list", "-b", "none/x.db"],
        ["add", "run-000001.h5", "-b", "none/x.db"],
        ["add", "run-000001.h5", "-b", "."],
    ],
)
def test_no_baseline_is_one_line(folder, capsys, arguments):
    assert len(output_of(capsys, *arguments, code=2).err.splitlines()) == 1
    assert not (folder / "baseline.db").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["trust", "my cell", "a note"],
        ["trust", "262-01-801-1"],
        ["trust", "262-01-801-1", "a note", "--withdraw"],
        ["trust", "262-01-801-1", "--withdraw"],
        ["trust", "262-01-801-1", "two\nlines"],
        ["remove", "7"],
        ["remove"],
        ["add"],
    ],
)
def test_mistakes_are_one_line(folder, capsys, arguments):
    output_of(capsys, "add", "run-000001.h5")
    assert len(output_of(capsys, *arguments, code=2).err.splitlines()) == 1


def test_a_place_that_cannot_be_written_is_named_with_the_reason(folder, capsys):
    said = output_of(capsys, "add", "run-000001.h5", "-b", "no/b.db", code=2)
    assert said.err == "postproc: cannot write no/b.db: No such file or directory\n"


def test_a_conspicuous_cell_that_becomes_known_is_named(tmp_path, monkeypatch, capsys):
    """Later walks are not warned of it."""
    monkeypatch.chdir(tmp_path)
    foreign = replace(cell(7, -60.0, lac=1201), mcc="310", mnc="260")
    heard = [*(cell(cid, -80.0 - cid, channel=20 + cid) for cid in range(1, 7)), foreign]
    write_walk(tmp_path, 1, lambda _: heard)
    says = "310-260-1201-7; `postproc baseline remove 1` undoes that"
    assert says in output_of(capsys, "add", "run-000001.h5").err
    assert output_of(capsys, "add", "run-000001.h5").err == ""  # it was known
    other = output_of(capsys, "add", "run-000001.h5", "-b", "my walks.db").err
    assert "; `postproc baseline remove 1 -b 'my walks.db'` undoes that" in other
    output_of(capsys, "remove", "1")
    output_of(capsys, "trust", "310-260-1201-7", "a ship in the harbour")
    assert output_of(capsys, "add", "run-000001.h5").err == ""
