import numpy as np
import pytest
from pyproj import Geod

from logger.core.errors import GeoError
from logger.core.places import Utm, zone_of

GEOD = Geod(ellps="WGS84")


@pytest.mark.parametrize(
    ("lat", "lon", "zone"),
    [
        (51.06, 3.71, 31),
        (-33.9, 151.2, -56),
        (0.0, 0.0, 31),
        (10.0, 180.0, 1),
        (10.0, -180.0, 1),
        (83.9, 179.99, 60),
    ],
)
def test_zone_of_known_places(lat, lon, zone):
    assert zone == zone_of(lat, lon)


def test_known_coordinates():
    """The origin of a zone and the width of its half, the figures of every UTM table."""
    assert Utm(31).to_xy(0.0, 3.0) == pytest.approx((500_000.0, 0.0), abs=1e-3)
    assert Utm(31).to_xy(0.0, 0.0) == pytest.approx((166_021.443, 0.0), abs=1e-3)
    assert Utm(-31).to_xy(0.0, 3.0) == pytest.approx((500_000.0, 10_000_000.0), abs=1e-3)


@pytest.mark.parametrize(
    ("lat", "lon"), [(51.0, 6.0), (0.0, 33.0), (-0.0001, 12.0), (48.0, 179.9995), (70.0, -180.0)]
)
def test_walk_across_border_equator_or_antimeridian_is_continuous(lat, lon):
    """A straight geodesic of 200 m in 1 m steps keeps its steps, whatever line it crosses."""
    lons, lats, _ = GEOD.fwd(
        np.full(201, lon), np.full(201, lat), np.full(201, 77.0), np.arange(-100.0, 101.0)
    )
    utm = Utm.at(float(lats[0]), float(lons[0]))
    x_m, y_m = utm.to_xy_arrays(np.array(lats), np.array(lons))
    steps = np.hypot(np.diff(x_m), np.diff(y_m))
    assert steps == pytest.approx(np.ones(200), rel=2e-3)
    north_lons, north_lats, _ = GEOD.fwd(
        np.full(201, lon), np.full(201, lat), np.zeros(201), np.arange(-100.0, 101.0)
    )
    x_m, y_m = utm.to_xy_arrays(np.array(north_lats), np.array(north_lons))
    assert np.hypot(np.diff(x_m), np.diff(y_m)) == pytest.approx(np.ones(200), rel=2e-3)


def test_there_and_back_again():
    utm = Utm.at(51.06, 3.71)
    assert utm.to_latlon(*utm.to_xy(51.07, 3.69)) == pytest.approx((51.07, 3.69), abs=1e-9)


@pytest.mark.parametrize("lat", [84.1, -89.0])
def test_beyond_84_degrees_is_refused(lat):
    with pytest.raises(GeoError, match="84 deg"):
        Utm.at(lat, 10.0)
    with pytest.raises(GeoError, match="84 deg"):
        Utm(33).to_xy_arrays(np.array([80.0, lat]), np.array([10.0, 10.0]))


@pytest.mark.parametrize(("lat", "lon"), [(float("nan"), 0.0), (91.0, 0.0), (0.0, 181.0)])
def test_no_position_is_refused(lat, lon):
    with pytest.raises(GeoError):
        Utm.at(lat, lon)
