"""What readings would say about the position, in nats.

A lower bound of the mutual information between the position and the levels, from the Bhattacharyya
coefficients of each pair of positions (Kolchinsky & Tracey, Entropy 19(7), 2017, eq. 10 with
alpha = 1/2):

    I >= -sum_i w_i log sum_j w_j exp(-|mu_i - mu_j|^2_N / 8)
"""

import numpy as np

from logger.core.arrays import IntArray
from logger.core.guidance.forecast import Forecast


def information_nats(forecast: Forecast, points: IntArray) -> float:
    """Information of readings at some of the points of a forecast."""
    root = np.linalg.cholesky(forecast.covariance[np.ix_(points, points)])
    level_dbm = forecast.level_dbm[:, points]
    white = np.linalg.solve(root, (level_dbm - level_dbm[0]).T)
    squared = np.sum(white**2, axis=0)
    apart = np.maximum(squared[:, None] + squared - 2.0 * white.T @ white, 0.0)
    overlap = np.exp(-0.125 * apart) @ forecast.weight
    return float(-forecast.weight @ np.log(overlap))
