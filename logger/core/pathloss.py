"""The log-distance model: RSSI = P0 - 10 eta log10(d), d at least 1 m."""

from math import log10, sqrt

import numpy as np

from logger.core.arrays import FloatArray

MIN_DISTANCE_M = 1.0


def log_distance_db(dx_m: FloatArray, dy_m: FloatArray) -> FloatArray:
    """10 log10 of the distance, clamped at 1 m; shape of the broadcast offsets."""
    squared = np.maximum(np.square(dx_m) + np.square(dy_m), MIN_DISTANCE_M**2)
    return np.asarray(5.0 * np.log10(squared), float)


def rssi_dbm(distance_m: float, p0_dbm: float, eta: float) -> float:
    """Level at a distance in metres."""
    return p0_dbm - 10.0 * eta * log10(max(distance_m, MIN_DISTANCE_M))


def distance_m(rssi: float, p0_dbm: float, eta: float) -> float:
    """Distance in metres at which the level is `rssi` dBm."""
    return max(float(10.0 ** ((p0_dbm - rssi) / (10.0 * eta))), MIN_DISTANCE_M)


def offset_m(dx_m: float, dy_m: float) -> float:
    """Distance of an offset, clamped at 1 m."""
    return max(sqrt(dx_m * dx_m + dy_m * dy_m), MIN_DISTANCE_M)
