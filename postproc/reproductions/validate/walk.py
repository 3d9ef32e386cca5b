"""Simulated stations and walks of the checklist, in local metres."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.geo import Utm
from logger.core.model.path_loss import log_distance_db
from logger.core.observations import CellObservations

UTM = Utm(54)
ORIGIN_M = (388_000.0, 3_949_000.0)
INTERVAL_S = 2.0


class Station(NamedTuple):
    """Place, power at 1 m, exponent."""

    x_m: float
    y_m: float
    p0_dbm: float
    eta: float


SPEC = Station(0.0, 0.0, -45.0, 2.5)
RADIUS_M = 500.0


def circle(count: int, radius_m: float = RADIUS_M, of: int = 50) -> tuple[FloatArray, FloatArray]:
    """The first `count` of `of` places around the origin, shape (count,) each."""
    angle = 2.0 * np.pi * np.arange(count) / of
    return radius_m * np.cos(angle), radius_m * np.sin(angle)


def heard(station: Station, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Levels without noise in dBm, shape (n,)."""
    return station.p0_dbm - station.eta * log_distance_db(x_m - station.x_m, y_m - station.y_m)


def observations(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> CellObservations:
    """A walk as the locator wants it, with the receiver's place known and no end of the scale."""
    count = len(x_m)
    return CellObservations(
        cell="cell",
        rat=None,
        utm=UTM,
        t_ns=np.asarray(np.round(np.arange(count) * INTERVAL_S * 1e9), np.int64),
        x_m=x_m + ORIGIN_M[0],
        y_m=y_m + ORIGIN_M[1],
        position_sigma_m=np.zeros(count),
        level_dbm=level_dbm,
        scan_seq=np.arange(count),
    )
