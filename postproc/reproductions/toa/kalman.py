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

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from postproc.reproductions.toa.lse import covariance_m2, fix_m
from postproc.reproductions.toa.model import Anchors, Rows, all_pairs, independent
from postproc.reproductions.toa.process import Process

Weigh = Callable[[FloatArray, FloatArray, int], FloatArray]


class Track(NamedTuple):
    """Estimated places (runs, steps, 2) in metres and what the filter says of them, (runs, steps,
    2, 2) in m^2.
    """

    place_m: FloatArray
    p_m2: FloatArray


def by_pseudo_inverse(
    anchors: Anchors, ranges_m: FloatArray, sigma2_m2: float, process: Process, p1: FloatArray
) -> Track:
    """All pairs as the README has them, S inverted on its range; arguments as of
    `by_independent_rows`.
    """
    return _filtered(all_pairs(anchors), ranges_m, sigma2_m2, process, p1, _pseudo_solved)


def by_independent_rows(
    anchors: Anchors, ranges_m: FloatArray, sigma2_m2: float, process: Process, p1: FloatArray
) -> Track:
    """The same filter over n - 1 rows, where S has an inverse.

    `ranges_m` has shape (runs, steps, n) with two steps or more; `p1` (2, 2) is P after the second
    step.
    """
    return _filtered(independent(anchors), ranges_m, sigma2_m2, process, p1, _solved)


def initial_p_m2(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Covariance of the fix at step 1, shape (2, 2), for the P that the README does not publish."""
    return covariance_m2(anchors, path_m[1], sigma2_m2)


def _filtered(
    rows: Rows,
    ranges_m: FloatArray,
    sigma2_m2: float,
    process: Process,
    p1: FloatArray,
    solved: Weigh,
) -> Track:
    h, rank = rows.h, len(rows.anchors) - 1
    place = fix_m(rows.anchors, ranges_m)
    p = np.broadcast_to(p1, (*place.shape, 2)).copy()
    z, by_step = rows.z_m2(ranges_m), np.moveaxis(ranges_m, 1, 0)
    for k in range(2, place.shape[1]):
        predicted = 2.0 * place[:, k - 1] - place[:, k - 2] + process.mean_m
        p_predicted = p[:, k - 1] + process.q_m2
        hp = h @ p_predicted
        gain = np.swapaxes(solved(hp @ h.T + rows.r_m4(by_step[k], sigma2_m2), hp, rank), -1, -2)
        innovation = z[:, k] - predicted @ h.T
        place[:, k] = predicted + (gain @ innovation[..., None])[..., 0]
        p[:, k] = p_predicted - gain @ hp
    return Track(place, p)


def _solved(s: FloatArray, hp: FloatArray, _: int) -> FloatArray:
    return np.asarray(np.linalg.solve(s, hp), float)


def _pseudo_solved(s: FloatArray, hp: FloatArray, rank: int) -> FloatArray:
    """S^+ H P with the `rank` largest eigenvalues; the others are zero up to rounding."""
    value, vector = np.linalg.eigh(s)
    kept = vector[..., -rank:]
    return np.asarray(kept @ ((np.swapaxes(kept, -1, -2) @ hp) / value[..., -rank:, None]), float)
