"""The same task without a singular matrix: a filter on the squared ranges themselves.

The state is [x, y, vx, vy]. No differences are taken, so R is diagonal and S of full rank. For X ~
N(m, C) the moments of a squared range are exact:

    E Z^2 = |m - a|^2 + tr C + sigma^2
    S     = G C G' + 2 tr(C^2) 1 1' + diag(4 sigma^2 (|m - a|^2 + tr C) + 2 sigma^4)
    G     = 2 (m - a)'

(second-order filter; Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and
Navigation, sec. 10.3). It has no trouble at an anchor, where the range itself has no derivative.
Its motion model is the one that the README assumes, constant velocity, without the noise of the
fixes counted as process noise.
"""

import numpy as np

from logger.core.arrays import FloatArray
from postproc.reproductions.toa.kalman import Track
from postproc.reproductions.toa.lse import covariance_m2, fix_m
from postproc.reproductions.toa.model import Anchors

_F = np.block([[np.eye(2), np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])


def run(anchors: Anchors, ranges_m: FloatArray, sigma2_m2: float, turn_m2: FloatArray) -> Track:
    """Track from ranges (runs, steps, n), two steps or more.

    `turn_m2` (2, 2) is the variance of a change of velocity from step to step.
    """
    position = fix_m(anchors, ranges_m)
    p = np.empty((*position.shape, 2))
    p[:, :2] = covariance_m2(anchors, position[:, :2], sigma2_m2)
    state = np.concatenate([position[:, 1], position[:, 1] - position[:, 0]], axis=1)
    covariance = _initial_covariance(p[:, 0], p[:, 1])
    q = np.zeros((4, 4))
    q[2:, 2:] = turn_m2
    for k in range(2, position.shape[1]):
        state, covariance = state @ _F.T, _F @ (covariance + q) @ _F.T
        state, covariance = _correct(anchors, state, covariance, ranges_m[:, k] ** 2, sigma2_m2)
        position[:, k], p[:, k] = state[:, :2], covariance[:, :2, :2]
    return Track(position, p)


def _initial_covariance(first: FloatArray, second: FloatArray) -> FloatArray:
    """Covariance of [second fix, second - first], shape (runs, 4, 4)."""
    return np.block([[second, second], [second, second + first]])


def _correct(
    anchors: Anchors, state: FloatArray, p: FloatArray, squared_m2: FloatArray, sigma2_m2: float
) -> tuple[FloatArray, FloatArray]:
    off_m = state[:, None, :2] - anchors.position_m
    plane = p[:, :2, :2]
    mean_m2 = np.sum(off_m**2, axis=-1) + np.trace(plane, axis1=1, axis2=2)[:, None]
    g = 2.0 * off_m
    s = g @ plane @ np.swapaxes(g, 1, 2) + 2.0 * np.sum(plane**2, axis=(1, 2))[:, None, None]
    each = np.arange(len(anchors))
    s[:, each, each] += 4.0 * sigma2_m2 * mean_m2 + 2.0 * sigma2_m2**2
    weights = np.swapaxes(np.linalg.solve(s, g), 1, 2)
    innovation = squared_m2 - mean_m2 - sigma2_m2
    # only the position is measured: the gain is P[:, :2] G' S^-1
    cross = p[:, :, :2]
    step = cross @ (weights @ innovation[..., None])
    return state + step[..., 0], p - cross @ (weights @ g) @ np.swapaxes(cross, 1, 2)
