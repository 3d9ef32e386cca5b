"""Directions from true north, against the geodesics of PROJ."""

import pytest
from pyproj import Geod

from logger.core.guidance.map_form import true_azimuth_deg
from logger.core.places import Places, Utm

WGS84 = Geod(ellps="WGS84")


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg"),
    [(60.4, 5.9995), (0.0003, 9.5), (-54.8, -72.0), (-16.8, 179.9995), (83.9, 17.9)],
)
@pytest.mark.parametrize("direction_deg", [3.0, 85.0, 140.0, 275.0])
def test_directions_are_from_true_north_also_across_zones_equator_and_date_line(
    lat_deg, lon_deg, direction_deg
):
    to_lon_deg, to_lat_deg, _ = WGS84.fwd(lon_deg, lat_deg, direction_deg, 150.0)
    utm = Utm.at(lat_deg, lon_deg)
    found_deg = true_azimuth_deg(
        Places.of_degrees(lat_deg, lon_deg, utm=utm),
        Places.of_degrees(to_lat_deg, to_lon_deg, utm=utm),
    )
    # the flattening of the Earth is not part of it: 0.2 degrees at the equator
    assert abs((found_deg - direction_deg + 180.0) % 360.0 - 180.0) < 0.3
