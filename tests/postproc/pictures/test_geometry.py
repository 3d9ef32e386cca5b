import numpy as np
import pytest

from postproc.pictures.survey import Box, evenly_spaced, plan_box, round_step, split_at_gaps

WALK_M = np.array([(0.0, 0.0), (200.0, 100.0)])


@pytest.mark.parametrize(
    ("span", "most", "step"), [(950, 12, 100), (120, 12, 10), (0, 5, 1), (2401, 12, 500)]
)
def test_steps_are_round(span, most, step):
    assert round_step(span, most) == step


def test_a_region_near_the_walk_enlarges_the_plan():
    assert plan_box(WALK_M, []).contains(100.0, 50.0)
    assert not plan_box(WALK_M, []).contains(400.0, 50.0)
    assert plan_box(WALK_M, [np.array([(400.0, 50.0)])]).contains(400.0, 50.0)


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
