"""Simulated stations and walks of the checklist, in local metres."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model import path_loss
from logger.core.places import Places, Utm
from logger.core.readings import Readings

UTM = Utm(54)  # of the checklist's Tokyo
ORIGIN_M = (388_000.0, 3_949_000.0)
INTERVAL_S = 2.0


class Station(NamedTuple):
    """Position, power at 1 m, exponent."""

    x_m: float
    y_m: float
    p0_dbm: float
    eta: float


SPEC = Station(0.0, 0.0, -45.0, 2.5)
RADIUS_M = 500.0


def circle(count: int, radius_m: float = RADIUS_M, of: int = 50) -> tuple[FloatArray, FloatArray]:
    """The first `count` of `of` points around the origin, shape (count,) each."""
    angle = 2.0 * np.pi * np.arange(count) / of
    return radius_m * np.cos(angle), radius_m * np.sin(angle)


def true_level_dbm(station: Station, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Levels without noise, shape (n,)."""
    distance_db = path_loss.log_distance_db(x_m - station.x_m, y_m - station.y_m)
    return path_loss.level_dbm(station.p0_dbm, station.eta, distance_db)


def noisy_level_dbm(
    station: Station, x_m: FloatArray, y_m: FloatArray, seed: list[int], noise_db: float
) -> FloatArray:
    """Levels with white noise, shape (n,)."""
    noise = np.random.default_rng(seed).normal(size=len(x_m))
    return true_level_dbm(station, x_m, y_m) + noise_db * noise


def observations(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> Readings:
    """The walk for the locator, with exact positions of the receiver and no limit of the levels."""
    count = len(x_m)
    return Readings(
        cell="cell",
        rat=None,
        places=Places.of(
            x_m + ORIGIN_M[0],
            y_m + ORIGIN_M[1],
            utm=UTM,
            t_ns=np.asarray(np.round(np.arange(count) * INTERVAL_S * 1e9), np.int64),
        ),
        level_dbm=level_dbm,
        scan_seq=np.arange(count),
    )
