"""Squares of 300 m on the whole Earth, numbered without a map projection.

The grid is a reduced latitude-longitude grid: belts of 1/370 degree of latitude (299 m at the
equator, 302 m at the poles), each divided into a whole number of columns that are as close to 300 m
as possible. A square of UTM would be cut at the border of a zone, and one place would belong to two
squares; here no border exists, not at a zone, the equator or the date line. Squares of neighbouring
belts are shifted against each other, so neighbours are found by distance (`squares_within`).
"""

from functools import lru_cache
from math import cos, floor, radians, sqrt

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.fix_gate import METRES_PER_DEG

SQUARE_M = 300.0
"""Houses shadow over tens of metres, cells reach kilometres; a walker needs minutes for it."""

_BELTS_PER_DEG = 370
_LAST_BELT = 180 * _BELTS_PER_DEG - 1
_EQUATOR_M = 40_075_017.0
"""Circumference at the equator (WGS 84)."""
_COLUMN_BITS = 18
"""The equator has 133 583 columns."""


def square_of(lat_deg: float, lon_deg: float) -> int:
    """Number of the square that contains a WGS 84 position."""
    belt = _belt(lat_deg)
    return belt << _COLUMN_BITS | _column(belt, lon_deg)


def squares_of(lat_lon_deg: FloatArray) -> IntArray:
    """Number of the square of each position (2, n), shape (n,); equal to `square_of`."""
    lat_deg, lon_deg = lat_lon_deg
    belt = np.clip(np.floor((lat_deg + 90.0) * _BELTS_PER_DEG), 0, _LAST_BELT).astype(np.int64)
    belts, which = np.unique(belt, return_inverse=True)
    n_columns = np.array([_columns(int(b)) for b in belts], np.int64)[which]
    column = np.floor((lon_deg + 180.0) / 360.0 * n_columns).astype(np.int64) % n_columns
    return np.asarray(belt << _COLUMN_BITS | column, np.int64)


def centre_of(square: int) -> tuple[float, float]:
    """Latitude and longitude in degrees of the middle of a square."""
    belt, column = square >> _COLUMN_BITS, square & ((1 << _COLUMN_BITS) - 1)
    return _middle_deg(belt), (column + 0.5) * 360.0 / _columns(belt) - 180.0


def squares_within(lat_deg: float, lon_deg: float, radius_m: float) -> list[int]:
    """Squares that a disc around a position touches; the first is that of the position.

    Up to 84 degrees of latitude, where cellwalk ends; the radius is small against the Earth.
    """
    belt_m, reach_deg = METRES_PER_DEG / _BELTS_PER_DEG, radius_m / METRES_PER_DEG
    here, north_m = square_of(lat_deg, lon_deg), (lat_deg + 90.0) * METRES_PER_DEG
    touched = [here]
    for belt in range(_belt(lat_deg - reach_deg), _belt(lat_deg + reach_deg) + 1):
        apart_m = max(belt * belt_m - north_m, north_m - (belt + 1) * belt_m, 0.0)
        half_m = sqrt(max(radius_m**2 - apart_m**2, 0.0))
        # one width for belt and position: the cosine changes by less than 0.1 % between them
        half_deg = half_m / (METRES_PER_DEG * cos(radians(_middle_deg(belt))))
        n = _columns(belt)
        first, last = (
            floor((lon_deg + sign * half_deg + 180.0) / 360.0 * n) for sign in (-1.0, 1.0)
        )
        columns = [column % n for column in range(first, min(last, first + n - 1) + 1)]
        touched += [belt << _COLUMN_BITS | column for column in columns]
    return list(dict.fromkeys(touched))


def _belt(lat_deg: float) -> int:
    return min(max(floor((lat_deg + 90.0) * _BELTS_PER_DEG), 0), _LAST_BELT)


def _middle_deg(belt: int) -> float:
    return (belt + 0.5) / _BELTS_PER_DEG - 90.0


def _column(belt: int, lon_deg: float) -> int:
    n = _columns(belt)
    return floor((lon_deg + 180.0) / 360.0 * n) % n


@lru_cache(maxsize=4096)
def _columns(belt: int) -> int:
    """The whole number of squares that makes them closest to 300 m wide."""
    return max(round(_EQUATOR_M * cos(radians(_middle_deg(belt))) / SQUARE_M), 1)
