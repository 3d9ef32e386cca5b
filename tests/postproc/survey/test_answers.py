"""Baseline, changes, map and next walks of a survey."""

import json

import pytest
from distributed import LocalCluster

from benchmarks.synthetic_city.walks import draw_walkers
from logger.baseline_file import BaselineFile
from postproc.cli import main
from tests.postproc.survey.cities import write_city


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    return write_city(tmp_path_factory.mktemp("city") / "s", walkers=draw_walkers(3, 4))[1]


@pytest.fixture(scope="module")
def scheduler():
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        yield cluster.scheduler_address


def _json(capsys, *arguments):
    assert main(["survey", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_baseline(survey, tmp_path, capsys):
    path = tmp_path / "baseline.db"
    assert _json(capsys, "baseline", survey.folder, "-b", path)["added"] == 8
    again = _json(capsys, "baseline", survey.folder, "-b", path)
    assert (again["added"], again["walks"], again["cells"]) == (0, 8, 2)
    file = BaselineFile(path)
    for cell in survey.cells():
        known = file.cell(cell.cell)
        assert (known.n_walks, known.n_scans) == (cell.n_runs, cell.n_scans)


def test_nothing_changed_between_two_days(survey, capsys):
    compared = _json(capsys, "diff", survey.folder, "--before", "2026-09-22", "--after",
                     "2026-09-22")  # fmt: skip
    assert {one["word"] for one in compared["cells"]} <= {"same", "not comparable"}
    assert compared["common_blocks"] > 0
    assert main(["survey", "diff", str(survey.folder), "--before", "2020-01-01"]) == 2
    assert "no walk of the survey began before" in capsys.readouterr().err


def test_map_needs_no_network(survey, scheduler, capsys):
    written = _json(capsys, "map", survey.folder, "--scheduler", scheduler)
    with open(written["path"]) as file:
        page = file.read()
    assert "default-src 'none'" in page
    assert "<script" not in page
    assert page.count('<rect x="') > 20
    assert all(cell.cell in page for cell in survey.cells())


def test_next_walks(survey, scheduler, capsys):
    code = main(["survey", "next", str(survey.folder), "--scheduler", scheduler, "--json",
                 "--from", "52.52,13.38"])  # fmt: skip
    shown = capsys.readouterr()
    if code:
        assert "no walk is needed" in shown.err
        return
    (walk,) = json.loads(shown.out)["walks"]
    assert walk["walker"] == 1
    assert walk["routes"][0]["nats"] > 0.0
