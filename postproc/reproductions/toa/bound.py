"""The Cramer-Rao bound of a position from ranges: of one epoch, and of all epochs so far.

J = sum over ranges of u u' / sigma^2, u the unit vector from anchor to position; at constant
velocity u becomes [u, j u] in the epoch j before. At an anchor a range has no derivative: there u
is taken along the path, its limit for an object on it. The bound is for unbiased estimators; where
sigma is as large as the field, a biased one may be better.
"""

import numpy as np
from scipy.special import ellipe

from logger.core.arrays import FloatArray
from postproc.reproductions.toa.model import Anchors

_AT_ANCHOR_M = 1e-9  # nearer, the direction is rounding


def of_epochs_m2(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Least covariance of a fix from each epoch alone, shape (steps, 2, 2)."""
    u = _directions(anchors, path_m)
    return np.asarray(sigma2_m2 * np.linalg.inv(np.swapaxes(u, 1, 2) @ u), float)


def of_constant_velocity_m2(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Least covariance of each position from all ranges so far, shape (steps, 2, 2).

    The motion is known to have a constant velocity.
    """
    u = _directions(anchors, path_m)
    least = of_epochs_m2(anchors, path_m, sigma2_m2)
    for k in range(1, len(path_m)):
        age = np.arange(k, -1, -1)[:, None, None]
        g = np.concatenate([u[: k + 1], -age * u[: k + 1]], axis=2).reshape(-1, 4)
        least[k] = sigma2_m2 * np.linalg.inv(g.T @ g)[:2, :2]
    return least


def mean_error_m(covariance_m2: FloatArray) -> FloatArray:
    """Mean distance from its centre of a plane Gaussian (..., 2, 2), shape (...).

    With variances a >= b along its axes it is sqrt(2 a / pi) E(1 - b / a), E the complete elliptic
    integral of the second kind with parameter m.
    """
    small, large = np.moveaxis(np.linalg.eigvalsh(covariance_m2), -1, 0)
    return np.asarray(np.sqrt(2.0 * large / np.pi) * ellipe(1.0 - small / large), float)


def _directions(anchors: Anchors, path_m: FloatArray) -> FloatArray:
    """Unit vectors from the anchors, shape (steps, n, 2)."""
    off_m = path_m[:, None, :] - anchors.position_m
    along_m = np.gradient(path_m, axis=0)[:, None, :]
    off_m = np.where(anchors.ranges_m(path_m)[..., None] < _AT_ANCHOR_M, along_m, off_m)
    length_m = np.linalg.norm(off_m, axis=-1, keepdims=True)
    return np.asarray(off_m / np.where(length_m > 0.0, length_m, 1.0), float)
