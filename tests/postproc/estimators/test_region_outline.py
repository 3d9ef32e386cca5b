import json

import msgspec
import numpy as np
import pytest
import shapely
from shapely.geometry import Point, shape

from logger.core.locator.region import Squares, area_m2, highest_density
from logger.core.places import Utm
from postproc.estimators.region_outline import geojson, merge_squares, outline, polygons

UTM = Utm(32)
EAST, NORTH = UTM.to_xy(48.0, 9.0)


def gaussians(*peaks, count=100, size=4.0):
    """Cells of a mixture of round Gaussians (weight, x, y, sigma) about a place in zone 32."""
    at = (np.arange(count) - count / 2 + 0.5) * size
    x, y = (v.ravel() for v in np.meshgrid(at, at))
    mass = sum(
        w / s**2 * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * s * s)) for w, a, b, s in peaks
    )
    return Squares(x + EAST, y + NORTH, np.full(x.size, size), mass / mass.sum())


def test_polygons_have_the_area_of_the_region():
    for level in (0.5, 0.95):
        cells = gaussians((0.6, -80.0, 0.0, 20.0), (0.4, 80.0, 0.0, 30.0))
        assert polygons(cells, level).area == pytest.approx(area_m2(cells, level), rel=1e-4)


def test_cells_of_several_sizes_leave_no_gap():
    x = np.array([0.0, 3.0, 3.0, 5.0]) + EAST
    y = np.array([0.0, 1.0, -1.0, 1.0]) + NORTH
    result = polygons(
        Squares(x, y, np.array([4.0, 2.0, 2.0, 2.0]), np.array([0.4, 0.2, 0.2, 0.2])), 1.0
    )
    assert len(result.geoms) == 1
    assert not result.geoms[0].interiors
    assert result.area == pytest.approx(16.0 + 3 * 4.0, rel=1e-4)


def test_the_outline_is_smoothed_by_less_than_a_cell():
    cells = gaussians((1.0, 0.0, 0.0, 40.0))
    (smooth,), exact = outline(cells), polygons(cells)
    assert len(smooth.exterior.coords) < len(exact.geoms[0].exterior.coords)
    assert smooth.symmetric_difference(exact).area < 0.03 * exact.area
    assert smooth.hausdorff_distance(exact) <= 4.0
    assert smooth.contains(Point(EAST, NORTH))
    assert not smooth.contains(Point(EAST + 2.6 * 40.0, NORTH))


def test_geojson_is_small_valid_and_counterclockwise():
    cells = gaussians((0.6, -80.0, 0.0, 20.0), (0.4, 80.0, 0.0, 20.0))
    result = msgspec.to_builtins(geojson(cells, UTM))
    area = shape(result)
    assert area.is_valid
    assert len(result["coordinates"]) == 2
    assert all(part.exterior.is_ccw for part in area.geoms)
    assert sum(len(ring) for part in result["coordinates"] for ring in part) < 150
    assert len(json.dumps(result)) < 4000
    for lon, lat in shapely.get_coordinates(area):
        assert (lon, lat) == pytest.approx((9.0, 48.0), abs=0.01)
        assert round(lon, 7) == lon
    back_x, back_y = UTM.to_xy_arrays(*shapely.get_coordinates(area).T[::-1])
    assert back_x.min() == pytest.approx(EAST - 80.0 - 49.0, abs=8.0)
    assert back_y.max() == pytest.approx(NORTH + 49.0, abs=8.0)


def test_a_region_is_cut_at_180_degrees():
    """RFC 7946, 3.1.9."""
    utm = Utm.at(-17.0, 179.9999)
    east, north = utm.to_xy(-17.0, 180.0)
    cells = Squares(np.array([east]), np.array([north]), np.array([100.0]), np.array([1.0]))
    found = shape(msgspec.to_builtins(geojson(cells, utm)))
    west, east = sorted(part.bounds[::2] for part in found.geoms)
    assert found.is_valid
    assert (west[0], east[1]) == (-180.0, 180.0)
    assert (west[1] + 180.0, 180.0 - east[0]) == pytest.approx((0.00047, 0.00047), abs=2e-5)


def test_holes_run_clockwise():
    part = geojson(gaussians((1.0, 0.0, 0.0, 60.0), (-0.55, 0.0, 0.0, 45.0)), UTM).coordinates[0]
    assert len(part) == 2
    assert not shapely.LinearRing(part[1]).is_ccw


def test_one_cell():
    cells = Squares(np.array([EAST]), np.array([NORTH]), np.array([10.0]), np.array([1.0]))
    assert len(geojson(cells, UTM).coordinates) == 1
    assert polygons(cells).area == pytest.approx(100.0, rel=1e-4)


def tree(seed):
    """Squares of 64 m split at random, with probability around one place."""
    rng = np.random.default_rng(seed)
    leaves, todo = (
        [],
        [(x, y, 64.0) for x in np.arange(-4, 4) * 64.0 for y in np.arange(-4, 4) * 64.0],
    )
    while todo:
        west, south, side = todo.pop()
        if side > 4.0 and rng.random() < 0.7:
            half = side / 2
            todo += [(west + i * half, south + j * half, half) for i in (0, 1) for j in (0, 1)]
        else:
            leaves.append((west + side / 2 + 1234.5, south + side / 2 - 99.25, side))
    x, y, side = np.array(leaves).T
    mass = np.exp(-((x - 1240.0) ** 2 + (y + 90.0) ** 2) / 2 / 60.0**2) * side**2
    return Squares(x, y, side, mass / mass.sum())


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.5, 0.95])
def test_fewer_squares_cover_the_same(seed, share):
    cells = tree(seed)
    few = merge_squares(cells, share)
    assert len(few) < len(highest_density(cells, share))
    np.testing.assert_allclose(np.sum(few.size_m**2), area_m2(cells, share))
    chosen = highest_density(cells, share)
    x, y, half = cells.x_m[chosen], cells.y_m[chosen], 0.5 * cells.size_m[chosen]
    every = shapely.union_all(shapely.box(x - half, y - half, x + half, y + half))
    both = polygons(cells, share).symmetric_difference(every)
    assert both.area < 1e-4 * area_m2(cells, share)


def test_cells_of_one_size_need_not_be_of_a_tree():
    x, y = (v.ravel() for v in np.meshgrid(np.arange(5) * 3.0, np.arange(5) * 3.0))
    cells = Squares(x, y, np.full(25, 3.0), np.full(25, 0.04))
    np.testing.assert_allclose(np.sum(merge_squares(cells, 1.0).size_m ** 2), 225.0)
