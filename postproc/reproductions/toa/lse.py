"""One epoch alone: the fix by the normal equations, X = (H'H)^-1 H' z."""

import numpy as np

from logger.core.arrays import FloatArray
from postproc.reproductions.toa.model import Anchors, all_pairs


def fix_m(anchors: Anchors, ranges_m: FloatArray) -> FloatArray:
    """Position from ranges (..., n), shape (..., 2)."""
    return np.asarray((ranges_m**2 - anchors.squared_m2) @ _operator(anchors).T, float)


def covariance_m2(anchors: Anchors, at_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Covariance of the fix at positions (..., 2), shape (..., 2, 2).

    It is exact, since the fix is linear in squared ranges.
    """
    operator = _operator(anchors)
    variance_m4 = 4.0 * sigma2_m2 * anchors.ranges_m(at_m) ** 2 + 2.0 * sigma2_m2**2
    return np.asarray((operator * variance_m4[..., None, :]) @ operator.T, float)


def _operator(anchors: Anchors) -> FloatArray:
    """Squared ranges -> position, shape (2, n)."""
    rows = all_pairs(anchors)
    return np.asarray(np.linalg.solve(rows.h.T @ rows.h, rows.h.T @ rows.of), float)
