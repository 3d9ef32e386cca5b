"""Rauch-Tung-Striebel smoother of the shadowing EKF: the shadowing along the walk.

Only the shadowing s moves, so the smoothed position, power and exponent (the rest, r) are the last
filtered ones: smoothing cannot repair a bad start. Of the smoother (AIAA Journal 3(8), 1965) only
the row of s remains, and no matrix is inverted. Given r, the filter knows after reading k that
s_k = a_k + b_k' r with variance v_k, and the smoother knows from all readings that

    s_k = m_k + c_k' r with variance w_k
    s_k+1 = rho_k s_k + noise of variance q_k,    g = rho v / (rho^2 v + q)
    m_k = (1 - g rho) a_k + g m_k+1,    c_k likewise from b_k
    w_k = (1 - g rho) v_k + g^2 w_k+1

Every variance is a sum of positive terms. With P the covariance of the rest,
var s_k = w_k + c_k' P c_k and cov(s_k, r) = P c_k.
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.shadow_ekf import ShadowNoise, ShadowState, covariance_matrix


def smooth(
    conditionals: FloatArray,
    moved_m: FloatArray,
    noise: ShadowNoise,
    origin: FloatArray,
    end: ShadowState,
    rows: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Smoothed [x, y, P0, eta, s] (m, 5) and covariances (m, 5, 5) after the readings `rows`.

    `conditionals` (n, 6) has columns a, b (4) and v, with r counted from `origin` (4,); `moved_m`
    (n - 1,) lies between the readings; `end` is the last filtered state.
    """
    rho = np.zeros_like(moved_m)
    if noise.decorrelation_m > 0.0:
        rho = np.exp(-moved_m / noise.decorrelation_m)
    q_db2 = noise.shadow_db**2 * (1.0 - rho**2)
    smoothed = _backwards(conditionals, rho, q_db2, rows)
    mean, slope, variance = smoothed[:, 0], smoothed[:, 1:5], smoothed[:, 5]
    rest, covariance = np.array(end[:4]), covariance_matrix(end.factors)[:4, :4]
    shared = slope @ covariance
    x = np.column_stack([np.tile(rest, (len(rows), 1)), mean + slope @ (rest - origin)])
    p = np.empty((len(rows), 5, 5))
    p[:, :4, :4] = covariance
    p[:, 4, :4] = p[:, :4, 4] = shared
    p[:, 4, 4] = variance + np.sum(shared * slope, axis=1)
    return x, p


def _backwards(
    conditionals: FloatArray, rho: FloatArray, q_db2: FloatArray, rows: IntArray
) -> FloatArray:
    """Rows (m, 6) of the smoothed conditionals; `rho` and `q_db2` (n - 1,) lead to the next."""
    smoothed = np.empty((len(rows), 6))
    last = len(conditionals) - 1
    following = conditionals[last].copy()
    row = len(rows) - 1
    for k in range(last, -1, -1):
        if k < last:
            variance = conditionals[k, 5]
            predicted = rho[k] * rho[k] * variance + q_db2[k]
            gain = rho[k] * variance / predicted if predicted > 0.0 else 0.0
            rest = 1.0 - gain * rho[k]
            following[:5] = rest * conditionals[k, :5] + gain * following[:5]
            following[5] = rest * variance + gain * gain * following[5]
        if rows[row] == k:
            smoothed[row] = following
            row -= 1
    return smoothed
