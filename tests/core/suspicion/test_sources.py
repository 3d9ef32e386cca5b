"""One place or two: a sector antenna is one station, and two stations are two."""

from math import atan2, degrees, hypot, log10

import pytest

from logger.core.suspicion.sources import LEAST_EVIDENCE, compare_sources
from logger.core.suspicion.spots import Spot

HALF_M, STEP_M = 400, 50


def _round_a_block():
    """Places along the sides of a square."""
    along = range(-HALF_M, HALF_M, STEP_M)
    for corner in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        for s in along:
            yield (s, corner[1] * HALF_M) if corner[0] != corner[1] else (corner[0] * HALF_M, s)


def _level_dbm(x_m, y_m, mast_m, azimuth_deg=None):
    """A station; with an azimuth it has the sector antenna of 3GPP TR 36.942, 4.2.1."""
    dx_m, dy_m = x_m - mast_m[0], y_m - mast_m[1]
    level_dbm = -40.0 - 32.0 * log10(max(hypot(dx_m, dy_m), 25.0) / 10.0)
    if azimuth_deg is None:
        return level_dbm
    off_deg = (degrees(atan2(dx_m, dy_m)) - azimuth_deg + 180.0) % 360.0 - 180.0
    return level_dbm - min(12.0 * (off_deg / 65.0) ** 2, 25.0)


def _spots(level_dbm):
    return [
        Spot(x_m, y_m, level_dbm(x_m, y_m), 40.0 * k)
        for k, (x_m, y_m) in enumerate(_round_a_block())
    ]


@pytest.mark.parametrize(
    ("mast_m", "azimuth_deg"),
    [
        ((-380.0, 100.0), 45.0),
        ((-380.0, 100.0), 135.0),
        ((-350.0, 0.0), 45.0),
        ((-350.0, -350.0), 135.0),
    ],
)
def test_a_sector_antenna_is_one_station(mast_m, azimuth_deg):
    result = compare_sources(_spots(lambda x, y: _level_dbm(x, y, mast_m, azimuth_deg)))
    assert result.two_places < LEAST_EVIDENCE


def test_two_stations_are_two():
    masts = (-380.0, 0.0), (380.0, 100.0)
    result = compare_sources(_spots(lambda x, y: max(_level_dbm(x, y, m) for m in masts)))
    assert result.two_places > 3.5
    assert result.apart_m == pytest.approx(760.0, abs=100.0)
