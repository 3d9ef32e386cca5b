from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from logger.core.geo import Utm
from logger.core.observations import Track
from postproc.pictures import colours
from postproc.view.view_model import _in_zone, _names, chosen, of_one
from tests.kit import sample_results as kit
from tests.kit.sample_view import sample_story


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return kit.sample_result(
        kit.write_run(tmp_path_factory.mktemp("story") / "walk.journal", seconds=120, cells=3)
    )


def test_runs_called_the_same_are_told_apart():
    paths = [Path(folder) / "run-000001.journal.2" for folder in "abc"]
    assert _names([*paths, Path("x.h5")]) == ["run-000001", "run-000001 (2)", "run-000001 (3)", "x"]


def test_a_track_of_the_next_zone_keeps_its_place():
    here, there = Utm(32), Utm(33)
    lat, lon = np.array([50.0, 50.001]), np.array([12.001, 12.002])
    track = Track(there, np.arange(2), np.arange(2), *there.to_xy_arrays(lat, lon), np.ones(2))
    moved = _in_zone(track, here)
    assert moved.utm == here
    np.testing.assert_allclose(here.to_latlon_arrays(moved.x_m, moved.y_m), (lat, lon), atol=1e-9)
    assert _in_zone(track, there) is track


def test_cells_are_told_in_the_order_they_are_named(result):
    found = of_one(result)
    names = [cell.cell for cell in found.cells]
    assert [cell.cell for cell in chosen(found, [names[2], names[0], names[2]])] == [
        names[2],
        names[0],
    ]
    assert [cell.cell for cell in chosen(found, None)] == [names[0]]
    assert chosen(replace(found, cells=()), None) == []


def test_each_cell_has_a_colour_of_its_own(result):
    told = sample_story(result)
    assert told.inks[told.subjects[0].cell] == colours.WALKER
    assert len(set(told.inks.values())) == 3


def test_places_go_to_degrees_and_back(result):
    told = sample_story(result)
    places = np.array([(0.0, 0.0), (30.0, -70.0)])
    for place, (lat_deg, lon_deg) in zip(places, told.degrees(places), strict=True):
        np.testing.assert_allclose(told.place_of(lat_deg, lon_deg), place, atol=1e-6)
