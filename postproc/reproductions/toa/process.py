"""Process noise of the README's filter: the error of a prediction from two single fixes, at k = 2.

    w = X - (2 X_1 - X_0),    X the true place, X_0 and X_1 fixes

The object moves evenly, so w is noise of the fixes and nothing else: E[w] = 0 and

    Q = 4 C_1 + C_0,    C_k = covariance of the fix at step k

which is (4.28 sigma^2 + 0.025 sigma^4) I for the README's anchors and path. The README prints
moments it has simulated; they differ by sampling noise (up to 2.7 % in Q; its E[w] is that noise
alone), and are used where they are printed. On a path that is not even, the second differences of
the path itself are part of w: their mean and covariance over the path come on top. The initial P is
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


_PRINTED = {
    0.01: ((-0.0018e-3, -0.8846e-3), ((0.0429, -0.0003), (-0.0003, 0.0425))),
    0.1: ((0.0116, 0.0046), ((0.4215, 0.0), (0.0, 0.4250))),
    1.0: ((-0.0177, 0.0092), ((4.2001, 0.0562), (0.0562, 4.2879))),
    10.0: ((0.0139, 0.1614), ((44.0896, 0.1916), (0.1916, 45.4973))),
    100.0: ((-0.1293, 0.1903), ((692.67, -5.5408), (-5.5408, 691.00))),
}
README_SIGMA2_M2 = tuple(_PRINTED)


def printed(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> Process | None:
    """The README's table, None where it has no line: another variance, other anchors or another
    path.
    """
    same = np.array_equal(anchors.place_m, README_ANCHORS_M) and np.array_equal(
        path_m, README_PATH_M
    )
    if not same or sigma2_m2 not in _PRINTED:
        return None
    mean, q = _PRINTED[sigma2_m2]
    return Process(np.array(mean), np.array(q))


def derived(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> Process:
    """E[w] and Q in closed form for a path (steps, 2) of three steps or more."""
    first, second = covariance_m2(anchors, path_m[:2], sigma2_m2)
    turns_m = np.diff(path_m, 2, axis=0)
    mean_m = np.mean(turns_m, axis=0)
    off_m = turns_m - mean_m
    return Process(mean_m, 4.0 * second + first + off_m.T @ off_m / len(off_m))
