"""What the filter of a walker's track takes and gives."""

from typing import NamedTuple

from logger.core.arrays import FloatArray


class Model(NamedTuple):
    """Fixes and what is assumed of them.

    `step_s` (n,) is the time since the fix before, `q` and `a` (n,) belong to that step. `z` (n, 2,
    2) is by fix, kind (position, velocity) and axis, `wander_m` (n,) is s, `variance` (n, 2) that
    of the white noise, `slack` (n, 2) the variance within which nothing is an outlier.
    """

    step_s: FloatArray
    q: FloatArray
    a: FloatArray
    z: FloatArray
    wander_m: FloatArray
    variance: FloatArray
    slack: FloatArray


class Series(NamedTuple):
    """States `x` (n, 3, 2) and covariances `p` (n, 3, 3) of the filter after each fix.

    Adjoint vectors `r` (n, 3, 2) and matrices `n` (n, 3, 3): what a fix and all later ones add to
    the state before it.
    """

    x: FloatArray
    p: FloatArray
    r: FloatArray
    n: FloatArray
