"""Baseline, changes, map and next walks of a survey."""

import json

import pytest
from msgspec.structs import replace

from benchmarks.synthetic_city.walks import draw_walkers
from logger.baseline_file import BaselineFile
from logger.core.errors import ConfigError
from postproc.cli import main
from postproc.result import Options
from postproc.survey.answers.next_walks import next_walks
from postproc.survey.location import EVERY_RUN, locate_survey
from postproc.survey.scheduling import Cluster
from tests.postproc.survey.cities import write_city


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    return write_city(tmp_path_factory.mktemp("city") / "s", walkers=draw_walkers(3, 4))[1]


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


def test_next_walks(survey, scheduler):
    """A route to each cell that is not located and not beside another walker's."""
    with Cluster(scheduler) as cluster:
        found = locate_survey(survey, Options(), cluster=cluster).cells
    unsure = [replace(cell, verdict="cannot tell") for cell in found]
    walks = next_walks(survey, unsure[:1], EVERY_RUN, Options(), 2, [(52.52, 13.38)])
    assert [(one.walker, one.walk.cell) for one in walks] == [(1, unsure[0].cell)]
    assert walks[0].walk.routes[0].nats > 0.0
    certain = [replace(cell, verdict="located") for cell in found]
    with pytest.raises(ConfigError, match="no walk is needed"):
        next_walks(survey, certain, EVERY_RUN, Options(), 1)
