import numpy as np
import pytest

from logger.core.errors import ConfigError
from logger.core.model.area import Area, WalkArea, hull
from logger.core.places import Places, Utm

UTM = Utm(33)
RING = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
HOLE = ((40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0))


def beyond_m(area, *points):
    return area.beyond_m(Places.of(*np.array(points, float).T))


def test_distances_from_a_polygon_with_a_hole_are_negative_inside():
    area = Area("there", polygons=((RING, HOLE),), utm=UTM)
    points = (10, 50), (50, 50), (130, 140), (50, -7), (30, 50)
    assert beyond_m(area, *points) == pytest.approx([-10, 10, 50, 7, -10])


def test_the_nearest_of_several_polygons_counts():
    other = tuple((x + 300.0, y) for x, y in RING)
    area = Area("there", 20.0, polygons=((RING,), (other,)), utm=UTM)
    assert beyond_m(area, (250, 50), (120, 50)) == pytest.approx([30, 0])


def test_a_hull_has_the_outer_corners_alone():
    rng = np.random.default_rng(1)
    inner = rng.uniform(1.0, 99.0, (2, 200))
    x_m, y_m = np.concatenate([np.array(RING).T, inner, np.array(RING).T], axis=1)
    assert set(hull(Places.of(x_m, y_m))) == set(RING)


@pytest.mark.parametrize("points", [[(0, 0)], [(0, 0), (60, 80)], [(0, 0), (30, 40), (60, 80)]])
def test_a_walk_on_a_line_has_an_area(points):
    area = Area.within_walk(50.0).at([Places.of(*np.array(points).T, utm=UTM)])
    assert beyond_m(area, (-30, -40), (-10, 0), (300, 0))[:2] == pytest.approx([0, -40])
    assert beyond_m(area, (300, 0)) > 0.0


def test_walks_far_apart_are_not_joined():
    walks = [Places.of([x, x + 100.0], [0.0, 0.0], utm=UTM) for x in (0.0, 5000.0)]
    area = Area.within_walk(100.0).at(walks)
    assert beyond_m(area, (2500, 0), (5050, 50)) == pytest.approx([2300, -50])


def test_the_share_of_squares_adds_up_to_the_area():
    area = Area("there", polygons=((RING, HOLE),), utm=UTM)
    grid = np.arange(-195.0, 300.0, 10.0)
    x_m, y_m = (one.ravel() for one in np.meshgrid(grid, grid))
    squares = np.stack([x_m, y_m, np.full(len(x_m), 10.0)])
    assert 100.0 * np.sum(area.share(squares)) == pytest.approx(9600.0, rel=0.02)


def test_polygons_in_degrees_are_where_they_are():
    walk = Places.of_degrees(52.0, 13.0)
    ring = tuple((13.0 + 0.001 * east, 52.0 + 0.001 * north) for east, north in (
        (1, -1), (2, -1), (2, 1), (1, 1)
    ))  # fmt: skip
    area = Area("there", polygons=((ring,),)).at([walk])
    assert beyond_m(area, walk.xy_m[:, 0]) == pytest.approx([68.6], abs=0.5)
    assert area.at([walk]) is area
    with pytest.raises(
        ConfigError, match="no walk is near the area there: all are more than 30 km away"
    ):
        Area("there", polygons=((ring,),)).at([Places.of_degrees(53.0, 13.0)])


@pytest.mark.parametrize("half_deg", [2.0, 20.0, 89.0])
def test_a_large_polygon_has_straight_edges_in_degrees(half_deg):
    """Its southern border, a parallel, is 550 m south of the walk however far it reaches."""
    walk = Places.of_degrees(48.0, 11.0)
    south, north = 47.995, min(48.0 + half_deg, 89.0)
    ring = ((11.0 - half_deg, south), (11.0 + half_deg, south),
            (11.0 + half_deg, north), (11.0 - half_deg, north))  # fmt: skip
    hole = ((11.01, 48.0), (11.0 + half_deg, 48.001), (11.01, 48.01))
    area = Area("there", polygons=((ring, hole),)).at([walk])
    assert beyond_m(area, walk.xy_m[:, 0]) == pytest.approx([-556.0], abs=2.0)
    in_hole = Places.of_degrees(48.001, 11.02, utm=walk.utm)
    assert area.beyond_m(in_hole)[0] > 0.0


def test_an_edge_beyond_the_zone_cuts_no_corner_of_the_world():
    walk = Places.of_degrees(48.0, 11.0)
    world = ((-180.0, -89.0), (180.0, -89.0), (180.0, 89.0), (-180.0, 89.0))
    assert Area("there", polygons=((world,),)).at([walk]).beyond_m(walk)[0] < -100_000.0


def test_the_area_of_a_walk_that_goes_on_is_that_of_the_whole_walk():
    rng = np.random.default_rng(3)
    x_m, y_m = np.cumsum(rng.normal(0.0, 20.0, (2, 300)), axis=1)
    live = WalkArea(100.0)
    for place in zip(x_m, y_m, strict=True):
        live.add(Places.of(*place, utm=UTM))
    whole = Area.within_walk(100.0).at([Places.of(x_m, y_m, utm=UTM)])
    points = rng.uniform(-800.0, 800.0, (50, 2))
    assert live.area is not None
    assert beyond_m(live.area, *points) == pytest.approx(beyond_m(whole, *points), abs=1.0)


def test_a_walk_outgrows_what_was_searched_by_a_quarter_of_the_width():
    live = WalkArea(100.0)
    assert live.area is None
    live.add(Places.of(0.0, 0.0, utm=UTM))
    searched = live.area
    assert live.has_outgrown(None)
    live.add(Places.of(20.0, 0.0, utm=UTM))
    assert live.area is not searched
    assert not live.has_outgrown(searched)
    live.add(Places.of(30.0, 0.0, utm=UTM))
    assert live.has_outgrown(searched)
    searched = live.area
    live.widen(200.0)
    assert live.has_outgrown(searched)
    live.widen(None)
    assert live.area is None
    assert live.has_outgrown(searched)
