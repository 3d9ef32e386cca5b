"""Process noise of the README's filter: the error of a prediction from two single fixes, at k = 2.

    w = X - (2 X_1 - X_0),    X the true position, X_0 and X_1 fixes

The velocity is constant, so w is noise of the fixes and nothing else: E[w] = 0 and

    Q = 4 C_1 + C_0,    C_k = covariance of the fix at step k

which is (4.28 sigma^2 + 0.025 sigma^4) I for the README's anchors and path. The README prints
moments it has simulated; they differ by sampling noise (up to 2.7 % in Q; its E[w] is that noise
alone), and are used where they are printed. On a path that turns, the second differences of the
path itself are part of w: their mean and covariance over the path are added. The initial P is
not published; the covariance of the fix at k = 1 stands in for it (0.82 sigma^2 + 0.005 sigma^4
there).
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from postproc.reproductions.toa.lse import covariance_m2
from postproc.reproductions.toa.model import README_ANCHORS_M, README_PATH_M, Anchors


class Process(NamedTuple):
    """E[w] in metres, shape (2,), and Q in square metres, shape (2, 2)."""

    mean_m: FloatArray
    q_m2: FloatArray


_PUBLISHED = {
    0.01: ((-0.0018e-3, -0.8846e-3), ((0.0429, -0.0003), (-0.0003, 0.0425))),
    0.1: ((0.0116, 0.0046), ((0.4215, 0.0), (0.0, 0.4250))),
    1.0: ((-0.0177, 0.0092), ((4.2001, 0.0562), (0.0562, 4.2879))),
    10.0: ((0.0139, 0.1614), ((44.0896, 0.1916), (0.1916, 45.4973))),
    100.0: ((-0.1293, 0.1903), ((692.67, -5.5408), (-5.5408, 691.00))),
}
README_SIGMA2_M2 = tuple(_PUBLISHED)


def readme_values(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> Process | None:
    """The README's values, None for another variance, other anchors or another path."""
    same_anchors = np.array_equal(anchors.position_m, README_ANCHORS_M)
    if not same_anchors or not np.array_equal(path_m, README_PATH_M):
        return None
    if sigma2_m2 not in _PUBLISHED:
        return None
    mean, q = _PUBLISHED[sigma2_m2]
    return Process(np.array(mean), np.array(q))


def closed_form(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> Process:
    """E[w] and Q in closed form for a path (steps, 2) of three steps or more."""
    first, second = covariance_m2(anchors, path_m[:2], sigma2_m2)
    turns_m = np.diff(path_m, 2, axis=0)
    mean_m = np.mean(turns_m, axis=0)
    off_m = turns_m - mean_m
    return Process(mean_m, 4.0 * second + first + off_m.T @ off_m / len(off_m))
