"""Measured walks cut into legs: what a policy may walk, and what it hears there."""

import numpy as np
import pytest

from benchmarks.guided.measured_legs import LONGEST_M, MeasuredLegs, MeasuredWorld
from tests.kit.guided_walks import line

CORNERS_M = ((0.0, 0.0), (400.0, 0.0), (400.0, 300.0), (0.0, 300.0), (0.0, 0.0))


def _walk(*corners_m, level_dbm):
    points_m = line(*corners_m, step_m=5.0)
    return np.column_stack([points_m, np.full(len(points_m), level_dbm)])


@pytest.fixture
def legs():
    once = _walk(*CORNERS_M, level_dbm=-70.0)
    again = _walk(*CORNERS_M[:3], level_dbm=-80.0)
    elsewhere = _walk((2000.0, 0.0), (2200.0, 0.0), level_dbm=-90.0)
    return MeasuredLegs("square", [once, again, elsewhere])


def test_legs_join_crossings_that_can_be_reached_from_each_other(legs):
    assert max(np.hypot(*legs.crossing_m[k]) for k in legs.beside) < 600.0
    assert all((end, start) in legs.legs for start, end in legs.legs)
    ground = MeasuredWorld(legs, legs.starts()[0], 0).crossings()
    far = max(legs.beside, key=lambda k: np.hypot(*legs.crossing_m[k]))
    here, walked = ground.start(), []
    while here != far:
        here = ground.route(here, far).to
        walked.append(here)
    assert 0 < len(walked) < len(legs.beside)


def test_a_leg_says_each_time_what_was_measured_that_time_and_then_nothing(legs):
    pair = next(pair for pair, walks in legs.legs.items() if len(walks) == 2)
    world = MeasuredWorld(legs, pair[0], 0)
    way = next(way for way in world.crossings().ways(pair[0]) if way.to == pair[1])
    levels = [np.unique(world.walk(pair[0], way)[:, 3]) for _ in range(3)]
    assert [one.tolist() for one in levels[:2]] == [[-70.0], [-80.0]]
    assert np.all(np.isnan(levels[2]))
    length_m = np.hypot(*(way.line_m[-1] - way.line_m[0]))
    assert world.walked_m == pytest.approx(3.0 * length_m)
    assert world.walked_m < LONGEST_M


def test_a_leg_walked_the_other_way_is_heard_the_other_way(legs):
    start, end = next(iter(legs.legs))
    there = legs.legs[start, end][0]
    back = legs.legs[end, start][0]
    np.testing.assert_array_equal(there[:-1], back[::-1][1:])
