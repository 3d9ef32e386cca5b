"""`postproc compare`: table, JSON and page."""

import json
import re

import pytest

from postproc.cli import main
from postproc.view.plan import entity
from tests.kit.rerun_recordings import rows, static_columns
from tests.postproc.baseline import walks as city_walks
from tests.postproc.comparison.city import name, write_walk


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    changed = {"without": (3,), "extra_db": {2: 15.0}}
    return [str(write_walk(folder, 1)), str(write_walk(folder, 2, offset_db=3.0, **changed))]


def test_table(runs, capsys):
    assert main(["compare", *runs]) == 0
    out = capsys.readouterr().out
    assert "2 cells changed" in out
    assert f"gone: {name(3)} GSM: only in walk A" in out
    assert f"stronger: {name(2)} GSM" in out
    assert "at most 5 % of pairs of walks" in out


def test_json(runs, capsys):
    assert main(["compare", "--json", *runs]) == 0
    document = json.loads(capsys.readouterr().out)
    cells = {cell["cell"]: cell for cell in document["cells"]}
    assert [cell["word"] for cell in document["cells"][:2]] == ["stronger", "gone"] or [
        cell["word"] for cell in document["cells"][:2]
    ] == ["gone", "stronger"]
    assert cells[name(2)]["change_db"] == pytest.approx(15.0, abs=4.0)
    assert 1.0 < document["offset_db"]["GSM"] < 5.0
    assert document["false_words_per_pair"] == 0.05
    where = cells[name(2)]["where"]
    assert len(where) == cells[name(2)]["blocks"]
    assert all(52.4 < place["lat"] < 52.7 for place in where)
    assert cells[name(5)]["word"] == "same"
    assert cells[name(5)]["where"] == []


def test_page(runs, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main(["compare", *runs, "-o", str(page)]) == 0
    capsys.readouterr()
    text = page.read_text()
    assert "2 cells changed" in text
    assert text.count("<figure>") == 2
    assert text.count("<rect") > 12
    assert "<script" not in text
    assert not re.search(r"(src|href)=[\"']https?:", text)


def test_recording_for_the_viewer(runs, tmp_path, capsys):
    recording = tmp_path / "changes.rrd"
    assert main(["compare", *runs, "--save", str(recording)]) == 0
    capsys.readouterr()
    boxes = static_columns(recording, entity("change", name(2)))
    differences = rows(boxes, "Boxes2D:labels")[0]
    assert len(differences) > 5
    assert all(text.endswith(" dB") for text in differences)
    (report,) = rows(static_columns(recording, "/words"), "TextDocument:text")
    assert f"| {name(3)} | gone |" in report[0]
    assert f"| {name(5)} | same |" in report[0]


def test_a_recording_has_the_name_of_one(runs, tmp_path, capsys):
    assert main(["compare", *runs, "--save", str(tmp_path / "changes.png")]) == 2
    assert "a rerun recording is named .rrd" in capsys.readouterr().err


def test_one_run_twice_is_an_error(runs, capsys):
    assert main(["compare", runs[0], runs[0]]) == 2
    assert "are the same run" in capsys.readouterr().err


def test_runs_far_apart_are_an_error(runs, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tests.postproc.comparison.city.START_M", (390_000.0, 5_000_000.0))
    far = str(write_walk(tmp_path, 3))
    assert main(["compare", runs[0], far]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_files_that_are_written_are_named(runs, tmp_path, capsys):
    page, recording = tmp_path / "page.html", tmp_path / "changes.rrd"
    assert main(["compare", *runs, "-o", str(page), "--save", str(recording)]) == 0
    assert capsys.readouterr().err == f"written: {page}\nwritten: {recording}\n"


def test_a_small_change_is_told_without_its_word(tmp_path, capsys):
    walks = write_walk(tmp_path, 1), write_walk(tmp_path, 2, extra_db={3: -5.0})
    assert main(["compare", *map(str, walks)]) == 0
    out = capsys.readouterr().out
    assert "No cells changed" in out
    assert f"same: {name(3)} GSM: " in out


def test_where_nothing_could_be_compared_no_cell_is_unchanged(tmp_path, capsys):
    elsewhere = city_walks.write_walk(tmp_path, 9, city_walks.two_cells(), lat_deg=52.51)
    near = city_walks.write_walk(tmp_path, 8, city_walks.two_cells(), lat_deg=52.53)
    assert main(["compare", str(elsewhere), str(near)]) == 0
    out = capsys.readouterr().out
    assert "No cell could be compared, of 2 heard." in out  # one of them has one level
    assert "cells changed" not in out
