"""The grid of the baseline: squares of 300 m without a border."""

import numpy as np
import pytest
from pyproj import Geod

from logger.core import baseline
from logger.core.baseline import SQUARE_M, square_of, squares_of, squares_within

GEOD = Geod(ellps="WGS84")
PLACES = [(0.0001, 0.0), (52.52, 13.4), (-33.9, 151.2), (60.0, 6.0), (69.6, -18.9), (83.9, 30.0)]


def neighbour(lat_deg, lon_deg, azimuth_deg, away_m):
    lon, lat, _ = GEOD.fwd(lon_deg, lat_deg, azimuth_deg, away_m)
    return lat, lon


def centre_of(square):
    """Latitude and longitude of the middle; a number has the belt above 18 bits of the column."""
    belt, column = square >> 18, square & ((1 << 18) - 1)
    return baseline._middle_deg(belt), (column + 0.5) * 360.0 / baseline._columns(belt) - 180.0


@pytest.mark.parametrize(("lat_deg", "lon_deg"), PLACES)
def test_a_square_is_300_m_wide_and_high_everywhere(lat_deg, lon_deg):
    lat, lon = centre_of(square_of(lat_deg, lon_deg))
    assert square_of(lat, lon) == square_of(lat_deg, lon_deg)
    for azimuth in (0.0, 90.0, 180.0, 270.0):
        assert square_of(*neighbour(lat, lon, azimuth, 0.49 * SQUARE_M)) == square_of(lat, lon)
        assert square_of(*neighbour(lat, lon, azimuth, 0.51 * SQUARE_M)) != square_of(lat, lon)


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(50.0, 6.0), (50.0, 180.0), (0.0, 10.0)])
def test_no_border_of_a_map_splits_a_square(lat_deg, lon_deg):
    """A zone of UTM, the date line and the equator: never more squares than anywhere else."""
    walk = [neighbour(lat_deg, lon_deg, 90.0, away_m) for away_m in range(-3000, 3001, 10)]
    squares = dict.fromkeys(square_of(*place) for place in walk)
    assert 20 <= len(squares) <= 22


def test_both_sides_of_the_date_line_are_neighbours():
    assert square_of(10.0, 180.0) == square_of(10.0, -180.0)
    assert square_of(10.0, 179.9999) in squares_within(10.0, -179.9999, 150.0)


def test_arrays_give_the_same_squares():
    random = np.random.default_rng(4)
    lat_deg, lon_deg = random.uniform(-84, 84, 3000), random.uniform(-180, 180, 3000)
    expected = [square_of(*place) for place in zip(lat_deg, lon_deg, strict=True)]
    assert squares_of(np.stack([lat_deg, lon_deg])).tolist() == expected
    assert len(set(expected)) == 3000


@pytest.mark.parametrize(("lat_deg", "lon_deg"), PLACES)
@pytest.mark.parametrize("radius_m", [1.0, 150.0, 700.0])
def test_a_disc_touches_the_squares_of_all_its_points(lat_deg, lon_deg, radius_m):
    random = np.random.default_rng(1)
    points = [
        neighbour(
            lat_deg, lon_deg, random.uniform(0, 360), 0.99 * radius_m * random.random() ** 0.5
        )
        for _ in range(3000)
    ]
    touched = squares_within(lat_deg, lon_deg, radius_m)
    assert touched[0] == square_of(lat_deg, lon_deg)
    assert {square_of(*point) for point in points} <= set(touched)
    # and none far away: its nearest point lies at most half a diagonal closer than its middle
    for square in touched:
        lat, lon = centre_of(square)
        assert GEOD.inv(lon_deg, lat_deg, lon, lat)[2] <= 1.02 * (radius_m + SQUARE_M / 2**0.5)


def test_a_disc_without_a_border_nearby_touches_one_square():
    lat, lon = centre_of(square_of(52.5, 13.4))
    assert squares_within(lat, lon, 100.0) == [square_of(lat, lon)]
