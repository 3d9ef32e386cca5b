from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from logger.core.certainty import OnMap
from logger.core.places import Utm
from postproc.pictures.survey import (
    Box,
    evenly_spaced,
    plan_box,
    survey_of,
    with_inset,
)
from postproc.result import split_at_gaps
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("survey") / "walk.journal", seconds=60, cells=2)
    return kit.sample_result(run)


def with_paths(result, *paths):
    """The same run several times, under other paths."""
    (observed,) = result.runs
    runs = [replace(observed, run=replace(observed.run, path=Path(path))) for path in paths]
    return replace(result, runs=tuple(runs))


def test_positions_convert_to_degrees_and_back(result):
    survey = survey_of(result)
    positions_m = np.array([(0.0, 0.0), (30.0, -70.0)])
    for position_m, degrees in zip(positions_m, survey.degrees(positions_m), strict=True):
        np.testing.assert_allclose(
            survey.position_m(OnMap(lat=degrees[0], lon=degrees[1])), position_m, atol=1e-6
        )
    np.testing.assert_allclose(survey.degrees(np.zeros((1, 2))), [(kit.LAT, kit.LON)], atol=1e-6)


def test_longitudes_go_on_across_the_antimeridian(result):
    for lon_deg, zone in ((179.9999, -60), (-179.9999, -1)):
        utm = Utm(zone)
        at_180 = replace(survey_of(result), utm=utm, origin_m=np.array(utm.to_xy(-16.5, lon_deg)))
        found_deg = at_180.degrees(np.array([(-50.0, 0.0), (0.0, 0.0), (50.0, 0.0)]))[:, 1]
        np.testing.assert_allclose(found_deg[1], lon_deg, atol=1e-7)
        assert np.all((np.diff(found_deg) > 0.0) & (np.diff(found_deg) < 0.001))


def test_tracks_of_all_runs_have_one_origin(result):
    survey = survey_of(with_paths(result, "a.h5", "b.h5"))
    first, second = survey.walks
    np.testing.assert_array_equal(first.track_m, second.track_m)
    assert first.track_m[0].tolist() == [0.0, 0.0]
    assert len(survey.track_m) == 120


def test_warnings_of_one_of_several_runs_name_its_file(result):
    assert survey_of(result).warnings == result.runs[0].warnings == ("about the run",)
    survey = survey_of(replace(with_paths(result, "a.h5", "b.h5"), warnings=("about both",)))
    assert survey.warnings == ("about both", "a.h5: about the run", "b.h5: about the run")


def test_without_a_fix_there_is_no_track(result):
    (observed,) = result.runs
    survey = survey_of(replace(result, runs=(replace(observed, observations=None),)))
    assert (survey.utm, survey.track_m.shape) == (None, (0, 2))
    assert [levels.cell for levels in survey.walks[0].levels] == [
        kit.cell_name(0),
        kit.cell_name(1),
    ]


WALK_M = np.array([(0.0, 0.0), (200.0, 100.0)])


def test_a_region_near_the_walk_enlarges_the_plan():
    assert plan_box(WALK_M, []).contains(np.array([100.0, 50.0]))
    assert not plan_box(WALK_M, []).contains(np.array([400.0, 50.0]))
    assert plan_box(WALK_M, [np.array([(400.0, 50.0)])]).contains(np.array([400.0, 50.0]))


def test_a_region_far_larger_than_the_walk_extends_outside():
    box = plan_box(WALK_M, [np.array([(-5000.0, -5000.0), (5000.0, 5000.0)])])
    assert box == plan_box(WALK_M, [])


def test_a_straight_walk_has_a_plan_with_an_area():
    box = plan_box(np.array([(0.0, 0.0), (0.0, 300.0)]), [])
    assert 0.5 * box.height <= box.width < box.height
    on_the_spot = plan_box(np.zeros((2, 2)), [])
    assert on_the_spot.size > 100.0


def test_corners_span_the_box():
    box = Box(-1.0, -2.0, 3.0, 4.0)
    assert Box.around(box.corners_m) == box


def test_a_gap_cuts_a_track():
    t_ns = np.array([0, 1, 2, 100, 101]) * 10**9
    strips = split_at_gaps(t_ns, np.zeros((5, 2)))
    assert [len(strip) for strip in strips] == [3, 2]


@pytest.mark.parametrize(("count", "most"), [(0, 5), (1, 5), (5, 5), (100, 7), (12, 11)])
def test_a_selection_keeps_the_first_and_the_last(count, most):
    chosen = evenly_spaced(count, most)
    assert len(chosen) == min(count, most)
    if count:
        assert (chosen[0], chosen[-1]) == (0, count - 1)
        assert np.all(np.diff(chosen) > 0)


PLAN = Box(0.0, 0.0, 400.0, 400.0)
SMALL_M = np.array([(190.0, 190.0), (210.0, 210.0)])


def test_a_small_answer_has_an_inset_in_a_free_corner():
    box, inset = with_inset(PLAN, SMALL_M, np.array([(200.0, 350.0), (390.0, 20.0)]))
    shown, frame = inset
    assert box == PLAN
    assert all(map(shown.contains, SMALL_M))
    assert frame.apart(shown)
    assert frame.contains(np.array([20.0, 20.0]))


def test_an_inset_hides_no_walk_but_gets_room():
    walk_m = np.column_stack([np.linspace(0.0, 400.0, 100)] * 2)
    box, (_, frame) = with_inset(PLAN, SMALL_M, walk_m)
    assert box.height > PLAN.height
    assert not any(map(frame.contains, walk_m[1:]))


@pytest.mark.parametrize("answer_m", [None, SMALL_M * 3.0 - 400.0, SMALL_M + 300.0])
def test_a_large_an_unknown_or_a_distant_answer_has_none(answer_m):
    """The second would be drawn 1.7 times larger, the last is outside."""
    assert with_inset(PLAN, answer_m, SMALL_M) == (PLAN, None)
