import numpy as np
import pytest

from logger.core.guidance.routes import LONGEST_M, Route, compass_routes, street_routes
from logger.core.guidance.sample import Cluster, clusters
from logger.core.guidance.street_map import StreetMap
from logger.core.places import Places


def _lattice():
    at_m = 100.0 * np.arange(11) - 500.0
    east = [np.array([[-500.0, y_m], [500.0, y_m]]) for y_m in at_m]
    north = [np.array([[x_m, -500.0], [x_m, 500.0]]) for x_m in at_m]
    return StreetMap([*east, *north])


def test_points_of_a_route_are_in_the_middle_of_equal_parts():
    route = Route(np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 40.0]]))
    assert route.length_m == pytest.approx(100.0)
    np.testing.assert_allclose(route.points(), [[12.5, 0], [37.5, 0], [60, 2.5], [60, 27.5]])


def test_without_a_map_all_directions_and_every_place_are_considered():
    routes = compass_routes(
        Places.of(10.0, 20.0),
        [Cluster(0.6, Places.of(300.0, 20.0)), Cluster(0.3, Places.of(10.0, -400.0))],
    )
    legs = [route.corner_m[1] - route.corner_m[0] for route in routes]
    first = {tuple(np.round(leg)) for leg in legs if np.hypot(*leg) < 101.0}
    assert len(first) == 8
    assert all(np.all(route.corner_m[0] == [10.0, 20.0]) for route in routes)
    ends = [tuple(np.round(route.corner_m[-1])) for route in routes]
    assert (300.0, 20.0) in ends
    assert (400.0, 20.0) in ends


def test_no_route_is_longer_than_a_kilometre():
    routes = compass_routes(Places.of(0.0, 0.0), [Cluster(1.0, Places.of(1400.0, 0.0))])
    assert max(route.length_m for route in routes) == pytest.approx(LONGEST_M)


def test_routes_follow_the_streets():
    streets = _lattice()
    routes = street_routes(streets, Places.of(3.0, -48.0), [Cluster(0.9, Places.of(290.0, 210.0))])
    for route in routes:
        for x_m, y_m in route.points():
            assert streets.nearest(Places.of(x_m, y_m)).away_m < 1.0
    lengths = [r.length_m for r in routes if np.hypot(*(r.corner_m[-1] - [300.0, 200.0])) < 1.0]
    assert min(lengths) == pytest.approx(548.0)


def test_at_a_crossing_all_its_streets_are_open():
    routes = street_routes(_lattice(), Places.of(8.0, 6.0), [])
    first = {tuple(route.corner_m[1]) for route in routes}
    assert first == {(0.0, 100.0), (100.0, 0.0), (0.0, -100.0), (-100.0, 0.0)}


def test_far_from_any_street_the_map_does_not_help():
    assert street_routes(_lattice(), Places.of(0.0, 700.0), []) == []


def test_a_dead_end_leads_back():
    streets = StreetMap([np.array([[0.0, 0.0], [90.0, 0.0]])])
    routes = street_routes(streets, Places.of(88.0, 1.0), [])
    assert [route.corner_m[-1].tolist() for route in routes] == [[0.0, 0.0]]


def test_clusters_hold_the_probability_around_them():
    rng = np.random.default_rng(0)
    near, far = rng.normal(0.0, 15.0, (2, 60)), rng.normal(400.0, 15.0, (2, 40))
    square = np.vstack([np.hstack([near, far]), np.full(100, 4.0)])
    first, second = clusters(square, np.full(100, 0.01), Places.of(0.0, 50.0))
    assert (first.probability, second.probability) == (pytest.approx(0.6), pytest.approx(0.4))
    assert first.place.away_m(Places.of(0.0, 0.0)) < 10.0
    assert second.place.away_m(Places.of(400.0, 400.0)) < 10.0


def test_a_place_out_of_reach_is_none():
    square = np.array([[5000.0], [0.0], [4.0]])
    assert clusters(square, np.ones(1), Places.of(0.0, 0.0)) == []
