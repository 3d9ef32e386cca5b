from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from logger.core.guidance.street_map import StreetMap, part_of
from logger.core.places import Places


def _lattice(count=4, block_m=100.0):
    end_m = (count - 1) * block_m
    at_m = block_m * np.arange(count)
    east = [np.array([[0.0, y_m], [end_m, y_m]]) for y_m in at_m]
    north = [np.array([[x_m, 0.0], [x_m, end_m]]) for x_m in at_m]
    return StreetMap([*east, *north])


def test_lines_that_cross_without_a_common_point_are_joined():
    streets = _lattice()
    assert len(streets.crossing_m) == 16
    assert len(streets.legs) == 24
    assert sorted(len(legs) for legs in streets.leaving) == [2] * 4 + [3] * 8 + [4] * 4


def test_ends_within_some_metres_are_one_crossing():
    lines = [np.array([[0.0, 0.0], [100.0, 0.0]]), np.array([[101.5, 1.0], [101.0, 90.0]])]
    streets = StreetMap([*lines, np.array([[100.0, 0.0], [100.0, -80.0]])])
    middle = streets.nearest_crossing(Places.of(100.0, 0.0))
    assert len(streets.leaving[middle]) == 3


def test_a_bend_is_no_crossing_and_a_long_street_is_divided():
    bend = StreetMap([np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 40.0]])])
    assert [leg.length_m for leg in bend.legs] == [pytest.approx(90.0)]
    long = StreetMap([np.array([[0.0, 0.0], [1000.0, 0.0]])])
    assert len(long.legs) == 8
    assert max(leg.length_m for leg in long.legs) == pytest.approx(125.0)


def test_a_circle_has_legs():
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    circle = 15.0 * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    streets = StreetMap([circle])
    assert sum(leg.length_m for leg in streets.legs) == pytest.approx(94.0, abs=1.0)
    assert all(leg.start != leg.end for leg in streets.legs)


@pytest.mark.parametrize("seed", range(5))
def test_shortest_ways_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    lines = [rng.uniform(0.0, 400.0, (2, 2)) for _ in range(14)]
    streets = StreetMap(lines)
    count = len(streets.crossing_m)
    weight = np.full((count, count), np.inf)
    for leg in streets.legs:
        shorter_m = min(weight[leg.start, leg.end], leg.length_m)
        weight[leg.start, leg.end] = weight[leg.end, leg.start] = shorter_m
    graph = csr_matrix(np.where(np.isfinite(weight), weight, 0.0))
    expected_m = dijkstra(graph, indices=0)
    way = streets.shortest(streets.leaving[0], 5000.0, range(count))
    for node, legs in way.items():
        if node == 0:
            continue
        assert sum(leg.length_m for leg in legs) == pytest.approx(expected_m[node])
        assert all(a.end == b.start for a, b in pairwise(legs))
    reached = {node for node in range(1, count) if np.isfinite(expected_m[node])}
    assert reached <= set(way)


def test_the_nearest_point_is_on_the_nearest_street():
    streets = _lattice()
    found = streets.nearest(Places.of(130.0, 8.0))
    assert found.away_m == pytest.approx(8.0)
    start_m = streets.crossing_m[found.leg.start]
    ahead = (found.leg.line_m[-1] - start_m) / found.leg.length_m
    np.testing.assert_allclose(start_m + found.along_m * ahead, [130.0, 0.0])


def test_the_rest_of_a_leg_begins_at_the_point():
    leg = StreetMap([np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 40.0]])]).legs[0]
    rest = part_of(leg, 60.0)
    assert rest.length_m == pytest.approx(30.0)
    assert np.hypot(*np.diff(rest.line_m, axis=0).T).sum() == pytest.approx(30.0)


def test_an_empty_map_has_no_street():
    assert StreetMap([]).nearest(Places.of(0.0, 0.0)) is None
