"""The log-distance model: RSSI = P0 - 10 eta log10(d), d at least 1 m."""

import numpy as np

from logger.core.arrays import FloatArray

MIN_DISTANCE_M = 1.0


def log_distance_db(dx_m: FloatArray, dy_m: FloatArray) -> FloatArray:
    """10 log10 of the distance, clamped at 1 m; shape of the broadcast offsets."""
    squared = np.maximum(np.square(dx_m) + np.square(dy_m), MIN_DISTANCE_M**2)
    return np.asarray(5.0 * np.log10(squared), float)
