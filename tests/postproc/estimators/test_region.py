import json

import numpy as np
import pytest
import shapely
from shapely.geometry import shape

from logger.core.geo import Utm
from postproc.estimators import region
from postproc.estimators.region import Cells

UTM = Utm(32)
EAST, NORTH = UTM.to_xy(48.0, 9.0)


def gaussians(*peaks, count=100, size=4.0):
    """Cells of a mixture of round Gaussians (weight, x, y, sigma) about a place in zone 32."""
    at = (np.arange(count) - count / 2 + 0.5) * size
    x, y = (v.ravel() for v in np.meshgrid(at, at))
    mass = sum(w / s**2 * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * s * s)) for w, a, b, s in peaks)
    return Cells(x + EAST, y + NORTH, np.full(x.size, size), mass / mass.sum())


def test_area_of_a_gaussian():
    cells = gaussians((1.0, 0.0, 0.0, 30.0))
    assert region.area_m2(cells) == pytest.approx(np.pi * 5.991 * 30.0**2, rel=0.02)
    assert region.polygons(cells).area == pytest.approx(region.area_m2(cells), rel=1e-4)


def test_highest_density_takes_dense_cells_first_whatever_their_size():
    cells = Cells(np.array([0.0, 10.0]), np.zeros(2), np.array([1.0, 10.0]), np.array([0.4, 0.6]))
    np.testing.assert_array_equal(region.highest_density(cells, 0.3), [0])
    np.testing.assert_array_equal(region.highest_density(cells, 0.95), [0, 1])


def test_two_peaks_are_two_places():
    cells = gaussians((0.7, -80.0, 0.0, 20.0), (0.3, 80.0, 0.0, 20.0))
    found = region.places(cells, 0.999)
    assert sorted(cells.probability[k].sum() for k in found) == pytest.approx([0.3, 0.7], abs=0.01)


def test_near_peaks_are_one_place():
    cells = gaussians((0.5, -22.0, 0.0, 20.0), (0.5, 22.0, 0.0, 20.0))
    assert len(region.places(cells, 0.999)) == 1


def test_places_share_no_cell_and_hold_the_level():
    cells = gaussians((0.5, -60.0, 0.0, 15.0), (0.3, 60.0, 40.0, 25.0), (0.2, 0.0, -90.0, 10.0))
    together = np.concatenate(region.places(cells, 0.99))
    assert len(np.unique(together)) == len(together)
    assert cells.probability[together].sum() == pytest.approx(0.99, abs=0.001)


def test_geojson_is_small_valid_and_counterclockwise():
    cells = gaussians((0.6, -80.0, 0.0, 20.0), (0.4, 80.0, 0.0, 20.0))
    found = region.geojson(cells, UTM)
    outline = shape(found)
    assert outline.is_valid
    assert len(found["coordinates"]) == 2
    assert all(part.exterior.is_ccw for part in outline.geoms)
    assert sum(len(ring) for part in found["coordinates"] for ring in part) < 150
    assert len(json.dumps(found)) < 4000
    for lon, lat in shapely.get_coordinates(outline):
        assert (lon, lat) == pytest.approx((9.0, 48.0), abs=0.01)
        assert round(lon, 7) == lon
    back_x, back_y = UTM.to_xy_arrays(*shapely.get_coordinates(outline).T[::-1])
    assert back_x.min() == pytest.approx(EAST - 80.0 - 49.0, abs=8.0)
    assert back_y.max() == pytest.approx(NORTH + 49.0, abs=8.0)


def test_holes_run_clockwise():
    cells = gaussians((1.0, 0.0, 0.0, 60.0), (-0.55, 0.0, 0.0, 45.0))
    part = region.geojson(cells, UTM)["coordinates"][0]
    assert len(part) == 2
    assert not shapely.LinearRing(part[1]).is_ccw


def test_one_cell():
    cells = Cells(np.array([EAST]), np.array([NORTH]), np.array([10.0]), np.array([1.0]))
    assert region.area_m2(cells) == 100.0
    assert len(region.geojson(cells, UTM)["coordinates"]) == 1
    assert len(region.places(cells, 0.999)) == 1
