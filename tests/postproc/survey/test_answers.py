"""Baseline, changes, map and next walks of a survey."""

import json
import re
from contextlib import closing
from itertools import combinations

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.synthetic_city.walks import draw_walkers
from benchmarks.synthetic_city.world import ORIGIN_M, ZONE
from logger.baseline_file import BaselineFile
from logger.core.errors import ConfigError
from logger.core.places import Places, Utm
from postproc.cli import main
from postproc.result import Options
from postproc.survey.answers.next_walks import next_walks
from postproc.survey.answers.page import html, walked_ground
from postproc.survey.location import EVERY_RUN, Location, locate_survey
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
    with closing(BaselineFile(path)) as file:
        for cell in survey.cells():
            known = file.cell(cell.cell)
            assert (known.n_walks, known.n_scans) == (cell.n_runs, cell.n_scans)


def test_nothing_changed_between_two_days(survey, scheduler, capsys):
    compared = _json(capsys, "diff", survey.folder, "--before", "2026-09-22", "--after",
                     "2026-09-22", "--scheduler", scheduler)  # fmt: skip
    assert {one["word"] for one in compared["cells"]} <= {"same", "not comparable"}
    assert compared["common_blocks"] > 0
    assert main(["survey", "diff", str(survey.folder), "--before", "2020-01-01"]) == 2
    assert "no walk of the survey began before" in capsys.readouterr().err
    twice = ["--before", "2026-09-22", "--after", "2026-09-21"]
    assert main(["survey", "diff", str(survey.folder), *twice]) == 2
    assert "would count twice" in capsys.readouterr().err


def test_map_needs_no_network(survey, scheduler, capsys):
    written = _json(capsys, "map", survey.folder, "--scheduler", scheduler)
    with open(written["path"]) as file:
        page = file.read()
    assert "default-src 'none'" in page
    assert "<script" not in page
    assert 0 < _walked_m2(page) == pytest.approx(2500.0 * len(_squares(survey)), rel=0.01)
    assert all(cell.cell in page for cell in survey.cells())


def test_the_first_cell_is_drawn_larger(survey, scheduler):
    # an attribute with a no-break space for a space is none: the inset was empty
    with Cluster(scheduler) as cluster:
        found = locate_survey(survey, Options(), cluster=cluster)
    odd = replace(found.cells[0], word="unusual", verdict="located", r95_m=5.0)
    drawn = Location((odd, *found.cells[1:]), found.loggers, found.n_known, found.unnoticed)
    page = html(survey, drawn, EVERY_RUN, None)
    view = re.search(r'<svg class="inset" [^>]* viewBox="([^"]*)">', page)[1]
    x, y, width, height = map(float, re.split("[ ,]", view))
    at = re.search(r'<svg x="([0-9.]+)%" y="([0-9.]+)%" [^>]*id="place-1"', page)
    whole = re.search(r'viewBox="0 0 ([0-9.]+) ([0-9.]+)"', page)
    for low, side, k in ((x, width, 0), (y, height, 1)):
        middle = float(whole[k + 1]) * float(at[k + 1]) / 100.0
        assert low + side / 2 == pytest.approx(middle, abs=0.1)


def _squares(survey):
    (town,) = walked_ground(survey, EVERY_RUN)
    assert town.utm == Utm(ZONE)
    return town.square


def _walked_m2(page):
    """Area of the path of the ground that was walked, by its rectangles and the scale bar."""
    bar = re.search(r'<rect class="bar" [^>]* width="([0-9.]+)%" height="4"/>', page)
    width = re.search(r'viewBox="0 0 ([0-9.]+) ', page)
    label = re.search(r">(\d+)\sm</text>", page)
    scale = float(width[1]) * float(bar[1]) / 100.0 / float(label[1])
    path = re.search(r'<path class="walked" d="([^"]*)"', page)[1]
    sizes = re.findall(r"h([0-9.]+)v([0-9.]+)h-", path)
    return sum(float(width) * float(height) for width, height in sizes) / scale**2


def test_next_walks(survey, scheduler):
    """A route to each cell that is not located and not beside another walker's."""
    with Cluster(scheduler) as cluster:
        found = locate_survey(survey, Options(), cluster=cluster).cells
    unsure = [replace(cell, verdict="cannot tell") for cell in found]
    walks = next_walks(survey, unsure[:1], Options(), 2, [Places.of_degrees(52.52, 13.38)])
    assert {walker: walk.answer.cell for walker, walk in walks.items()} == {1: unsure[0].cell}
    assert walks[1].routes[0].nats > 0.0
    answer = walks[1].answer
    assert (answer.place.r50_m, answer.place.r95_m) == (unsure[0].r50_m, unsure[0].r95_m)
    assert answer.reasons == unsure[0].reasons
    certain = [replace(cell, verdict="located") for cell in found]
    with pytest.raises(ConfigError, match="no walk is needed"):
        next_walks(survey, certain, Options(), 1)


@pytest.mark.slow
def test_several_walkers_have_areas_of_their_own(tmp_path, scheduler):
    """Six small cells over 2 km, three walkers with two starts: apart, and each with a route."""
    city, survey = write_city(
        tmp_path / "s", n_stations=6, n_runs=6, n_scans=250, walkers=draw_walkers(2, 4),
        spacing_m=800.0,
    )  # fmt: skip
    with Cluster(scheduler) as cluster:
        found = locate_survey(survey, Options(), cluster=cluster).cells
    unsure = [replace(cell, verdict="cannot tell") for cell in found]
    utm = Utm(ZONE)
    starts_m = [np.array(ORIGIN_M), np.array(ORIGIN_M) + city.size_m]
    starts = [Places.of(*place, utm=utm) for place in starts_m]
    walks = next_walks(survey, unsure, Options(), 3, starts)
    assert list(walks) == [1, 2, 3]
    assert len({walk.answer.cell for walk in walks.values()}) == 3
    for walk, start_m in zip(walks.values(), [*starts_m, starts_m[0]], strict=True):
        best = walk.routes[0]
        assert best.nats > 0.0
        assert np.hypot(*(best.route.corner_m[0] - start_m)) < 1.0
    for one, other in combinations(walks.values(), 2):
        apart_m = np.hypot(
            one.posterior.x_m - other.posterior.x_m, one.posterior.y_m - other.posterior.y_m
        )
        assert apart_m > 500.0
    # there are no places for more walkers than areas of 500 m
    near = [cell for cell in unsure if cell.cell == walks[1].answer.cell] * 2
    assert len(next_walks(survey, near, Options(), 2, starts)) == 1
