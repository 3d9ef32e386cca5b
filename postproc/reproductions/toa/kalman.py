"""The README's Kalman filter, for many runs at once.

    X_pred = A X_k + (X_k - X_(k-1)) + E[w],    P_pred = A P A' + Q,    A = I
    K = P_pred H' (H P_pred H' + R)^-1
    X = X_pred + K (z - H X_pred),    P = P_pred - K H P_pred

The first two steps are single fixes. Q already is the whole error of a prediction from two fixes,
and P comes on top; R takes measured ranges for true ones. So the filter works, but its P is no
covariance of its error.

Its S = H P_pred H' + R is singular: six differences of four ranges have rank 3. With all rows D = T
D1 of independent rows D1, S = T S1 T', and T has full column rank, so

    H' S^+ z = H1' T' (T')^+ S1^-1 T^+ T z1 = H1' S1^-1 z1

The pseudo-inverse over all pairs and the plain inverse over n - 1 independent rows are the same
filter.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from postproc.reproductions.toa.lse import covariance_m2, fix_m
from postproc.reproductions.toa.model import Anchors, Rows, all_pairs, independent
from postproc.reproductions.toa.process import Process


class Track(NamedTuple):
    """Estimated positions (runs, steps, 2) in metres, and their P (runs, steps, 2, 2) in m^2."""

    position_m: FloatArray
    p_m2: FloatArray


def by_pseudo_inverse(
    anchors: Anchors, ranges_m: FloatArray, sigma2_m2: float, process: Process, p1: FloatArray
) -> Track:
    """All pairs as the README has them, S inverted on its range.

    The arguments are those of `by_independent_rows`.
    """
    return _filter(all_pairs(anchors), ranges_m, sigma2_m2, process, p1)


def by_independent_rows(
    anchors: Anchors, ranges_m: FloatArray, sigma2_m2: float, process: Process, p1: FloatArray
) -> Track:
    """The same filter over n - 1 rows, where S has an inverse.

    `ranges_m` has shape (runs, steps, n) with two steps or more; `p1` (2, 2) is P after the second
    step.
    """
    return _filter(independent(anchors), ranges_m, sigma2_m2, process, p1)


def initial_p_m2(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Covariance of the fix at step 1, shape (2, 2), for the P that the README does not publish."""
    return covariance_m2(anchors, path_m[1], sigma2_m2)


def _filter(
    rows: Rows, ranges_m: FloatArray, sigma2_m2: float, process: Process, p1: FloatArray
) -> Track:
    h, rank = rows.h, len(rows.anchors) - 1
    position = fix_m(rows.anchors, ranges_m)
    p = np.broadcast_to(p1, (*position.shape, 2)).copy()
    z, by_step = rows.z_m2(ranges_m), np.moveaxis(ranges_m, 1, 0)
    for k in range(2, position.shape[1]):
        predicted = 2.0 * position[:, k - 1] - position[:, k - 2] + process.mean_m
        p_predicted = p[:, k - 1] + process.q_m2
        hp = h @ p_predicted
        s = hp @ h.T + rows.r_m4(by_step[k], sigma2_m2)
        gain = np.swapaxes(_solve(s, hp, rank), -1, -2)
        innovation = z[:, k] - predicted @ h.T
        position[:, k] = predicted + (gain @ innovation[..., None])[..., 0]
        p[:, k] = p_predicted - gain @ hp
    return Track(position, p)


def _solve(s: FloatArray, hp: FloatArray, rank: int) -> FloatArray:
    """S^+ H P; where S is singular, the eigenvalues beyond the `rank` largest are rounding."""
    if s.shape[-1] == rank:
        return np.asarray(np.linalg.solve(s, hp), float)
    value, vector = np.linalg.eigh(s)
    basis = vector[..., -rank:]
    return np.asarray(basis @ ((np.swapaxes(basis, -1, -2) @ hp) / value[..., -rank:, None]), float)
