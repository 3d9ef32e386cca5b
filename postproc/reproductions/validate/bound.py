"""The Cramer-Rao bound of a station that stands still, from levels along a walk in white noise.

J = G' G / r + diag(0, 0, Lambda0), G the slope of the levels by [x, y, P0, eta] at the true state,
Lambda0 the inverse variances of normal priors on P0 and eta (Van Trees, Detection, Estimation, and
Modulation Theory I, sec. 2.4).
"""

import numpy as np
from scipy.optimize import brentq

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import level_slopes
from postproc.reproductions.validate.walk import Station

_DIRECTIONS = 720  # every half degree: the median is right to 1e-6


def slopes(station: Station, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """G, shape (n, 4)."""
    return level_slopes(station.x_m - x_m, station.y_m - y_m, station.eta)


def covariance(g: FloatArray, r_db2: float, precision: FloatArray) -> FloatArray:
    """Least covariance of an unbiased estimate, shape (4, 4).

    `precision` (2,) is that of the priors on P0 and eta.
    """
    information = g.T @ g / r_db2
    information[[2, 3], [2, 3]] += precision
    return np.asarray(np.linalg.inv(information), float)


def median_error_m(plane_m2: FloatArray) -> float:
    """Median distance from its centre of a plane Gaussian with covariance (2, 2).

    In the direction t the density falls as exp(-s r^2 / 2), s = cos^2 t / a + sin^2 t / b, a and b
    the variances.
    """
    small, large = np.linalg.eigvalsh(plane_m2)
    t = np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    steep = np.cos(t) ** 2 / large + np.sin(t) ** 2 / small
    scale = float(np.sqrt(small * large))

    def beyond(r_m: float) -> float:
        return float(np.mean(np.exp(-0.5 * steep * r_m**2) / steep)) / scale - 0.5

    return float(brentq(beyond, 0.0, 2.0 * float(np.sqrt(large))))
