import json

import pytest

from postproc.cli import main
from tests.kit import runs
from tests.kit.html_page import Page
from tests.kit.vector_tiles import write_pmtiles


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "walk.journal"
    runs.write_journal(path, runs.records(40))
    return path


def fails(capsys, *argv):
    assert main([str(a) for a in argv]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_page_beside_the_run_and_pictures_where_wanted(run, tmp_path, capsys):
    assert main(["report", str(run), "--pictures", str(tmp_path), "--cell", "262-01-4711-1"]) == 0
    assert capsys.readouterr().out.startswith(f"{run.with_suffix('.html')}: 1 cell in detail, ")
    page = Page(run.with_suffix(".html").read_text("utf-8"))
    names = {path.name for path in tmp_path.iterdir()}
    assert {
        f"cell-1-{one}.{kind}" for one in ("plan", "distance", "levels") for kind in ("png", "svg")
    } <= names
    assert len(names) == 2 * len(page.all("svg"))
    assert (tmp_path / "cell-1-plan.png").read_bytes().startswith(b"\x89PNG")
    run.with_suffix(".html").unlink()


def test_a_wrong_rate_is_said_before_the_estimate(run, capsys, monkeypatch):
    monkeypatch.setattr("postproc.report.cli.stored_or_estimated", None)
    said = fails(capsys, "report", run, "--claim", "52.001,13.0", "--pfa", "2")
    assert "at most 0.5" in said


def test_json_describes_the_files(run, tmp_path, capsys):
    target = tmp_path / "x.html"
    claim = ("--claim", "52.001,13.0,30", "--cell", "262-01-4711-1")
    assert main(["report", str(run), "-o", str(target), "--json", *claim]) == 0
    written = json.loads(capsys.readouterr().out)
    assert written["path"] == str(target)
    assert written["bytes"] == target.stat().st_size
    assert written["cells"] == ["262-01-4711-1"]
    assert written["pictures"] == []
    assert "52.00100" in Page(target.read_text("utf-8")).text


def test_mistakes_are_one_line(run, tmp_path, capsys):
    assert "no such folder" in fails(capsys, "report", run, "-o", tmp_path / "absent" / "x.html")
    assert "no such folder" in fails(capsys, "report", run, "--pictures", tmp_path / "absent")
    assert "is a run" in fails(capsys, "report", run, "-o", run)
    assert "was not observed" in fails(capsys, "report", run, "--cell", "x")
    assert "is no position: LAT,LON or LAT,LON,SIGMA_M" in fails(
        capsys, "report", run, "--claim", "here", "-o", tmp_path / "x.html"
    )
    assert "environment" in fails(capsys, "report", run, "--environment", "sea")
    assert list(tmp_path.iterdir()) == []
    assert run.exists()


def test_a_file_that_is_no_map_is_said_before_the_estimate(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("postproc.report.cli.stored_or_estimated", None)
    monkeypatch.setattr("postproc.view.cli.stored_or_estimated", None)
    broken = tmp_path / "x.pmtiles"
    for content, why in (
        (b"lat,lon", "neither PMTiles nor MBTiles"),
        (b"PMTiles\3" + b"\xff" * 200, "cannot be read"),
        (b"SQLite format 3\0" + bytes(200), "no MBTiles file"),
    ):
        broken.write_bytes(content)
        for argv in (["report", run], ["view", run, "--save", tmp_path / "x.rrd"]):
            assert why in fails(capsys, *argv, "--basemap", broken)


def test_a_basemap_that_is_not_drawn_is_reported(run, tmp_path, capsys):
    """A walk straight on locates no cell, and then there is no plan of all cells."""
    ground, page = tmp_path / "ground.pmtiles", tmp_path / "page.html"
    assert "no such file" in fails(capsys, "report", run, "--basemap", ground, "-o", page)
    write_pmtiles(ground, {(14, 3, 3): b""})
    for json_output in ([], ["--json"]):
        assert (
            main(["report", str(run), "--basemap", str(ground), "-o", str(page), *json_output]) == 0
        )
        (line,) = capsys.readouterr().err.splitlines()
        assert line == f"{ground} is not drawn: no cell is located or ambiguous"
    assert "data:image/jpeg" not in page.read_text("utf-8")
