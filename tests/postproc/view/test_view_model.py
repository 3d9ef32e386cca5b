from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.pictures import colours
from postproc.view.view_model import _names, chosen, estimated
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


def test_cells_are_told_in_the_order_they_are_named(result):
    found = estimated(result)
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
