"""The Cramer-Rao bound of the place, with normal priors on P0 and eta and none on the place.

J = G' K^-1 G + diag(0, 0, Lambda0), G the derivative of the mean level by [x, y, P0, eta] at the
true state, K the covariance of the levels (Van Trees, Detection, Estimation, and Modulation Theory
I, sec. 2.4). An estimator with a prior of the position may do better.
"""

from math import log

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import MIN_DISTANCE_M, log_distance_db

from .world import Place, Walk

_C = 10.0 / log(10.0)


def slope_db_per_m(
    walk: Walk, x_m: FloatArray, y_m: FloatArray, eta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the levels by x and y of the sources, shape (n, h) each.

    The sources have the shape (h,).
    """
    east_m, north_m = x_m - walk.x_m[:, None], y_m - walk.y_m[:, None]
    squared = np.maximum(east_m**2 + north_m**2, MIN_DISTANCE_M**2)
    return -_C * eta * east_m / squared, -_C * eta * north_m / squared


def covariance_bound(
    walk: Walk, source: Place, eta: float, covariance_db2: FloatArray, prior_precision: FloatArray
) -> FloatArray:
    """Smallest covariance of an unbiased estimate of [x, y, P0, eta], shape (4, 4).

    `prior_precision` of P0 and eta has the shape (2,).
    """
    x_m, y_m = np.array([source[0]]), np.array([source[1]])
    east, north = slope_db_per_m(walk, x_m, y_m, np.array([eta]))
    loss_db = log_distance_db(source[0] - walk.x_m, source[1] - walk.y_m)
    g = np.column_stack([east, north, np.ones(len(walk)), -loss_db])
    information = g.T @ np.linalg.solve(covariance_db2, g)
    information[[2, 3], [2, 3]] += prior_precision
    return np.asarray(np.linalg.inv(information), float)
