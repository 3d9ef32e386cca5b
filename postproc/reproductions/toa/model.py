"""Differences of squared ranges to anchors, which are linear, and the matrices of the README.

With Z_i = |X - a_i| + v_i, v_i ~ N(0, sigma^2), a squared range is

    Z_i^2 = |X|^2 - 2 a_i' X + |a_i|^2 + e_i
    E e_i = sigma^2,    var e_i = 4 sigma^2 |X - a_i|^2 + 2 sigma^4

so that |X|^2 and the bias cancel in differences. With D the matrix of differences (one row e_i -
e_j for each pair i < j)

    z = D (Z^2 - |a|^2) = H X + D e,    H = -2 D a,    R = 4 sigma^2 D diag(Z^2) D'

The README prints these for four anchors. Derived row by row its z, H and R are right; only its
sketch of the anchors is mirrored: it has Z1 (0, 10) to the right of Z2 (10, 10), and Z3 (0, 0) to
the right of Z4 (10, 0). R takes the measured ranges for the true ones and leaves 2 sigma^4 D D'
out. Since E Z^2 = |X - a|^2 + sigma^2 it is too large by 2 sigma^4 D D' on average, which matters
at sigma^2 = 100 only.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError

README_ANCHORS_M = ((0.0, 10.0), (10.0, 10.0), (0.0, 0.0), (10.0, 0.0))
README_PATH_M = tuple((float(k), float(k)) for k in range(11))

_LEAST_SPREAD = 1e-9  # width of the anchors by their length: less is a line, up to rounding


@dataclass(frozen=True, slots=True)
class Anchors:
    """Positions of the anchors in metres, shape (n, 2).

    Raises `ConfigError` unless they span the plane.
    """

    position_m: FloatArray

    def __post_init__(self) -> None:
        is_plane = self.position_m.ndim == 2 and self.position_m.shape[1] == 2
        if not is_plane or not np.all(np.isfinite(self.position_m)):
            raise ConfigError("anchors are positions x,y in metres")
        spread = np.linalg.svd(self.position_m - np.mean(self.position_m, axis=0), compute_uv=False)
        if len(spread) < 2 or spread[1] <= _LEAST_SPREAD * spread[0]:
            raise ConfigError(
                "the anchors stand on one line: a position in the plane takes three that do not"
            )

    def __len__(self) -> int:
        return len(self.position_m)

    @property
    def squared_m2(self) -> FloatArray:
        """Squared distances of the anchors from the origin, shape (n,)."""
        return np.asarray(np.sum(self.position_m**2, axis=1), float)

    def ranges_m(self, path_m: FloatArray) -> FloatArray:
        """True ranges from positions (..., 2), shape (..., n)."""
        return np.asarray(np.linalg.norm(path_m[..., None, :] - self.position_m, axis=-1), float)


@dataclass(frozen=True, slots=True)
class Rows:
    """Differences of squared ranges; `of` has shape (rows, n)."""

    anchors: Anchors
    of: FloatArray

    @property
    def h(self) -> FloatArray:
        """H in metres, shape (rows, 2)."""
        return np.asarray(-2.0 * self.of @ self.anchors.position_m, float)

    def z_m2(self, ranges_m: FloatArray) -> FloatArray:
        """Measurements of ranges (..., n), shape (..., rows)."""
        return np.asarray((ranges_m**2 - self.anchors.squared_m2) @ self.of.T, float)

    def r_m4(self, ranges_m: FloatArray, sigma2_m2: float) -> FloatArray:
        """R of the README from ranges (..., n), shape (..., rows, rows)."""
        variance_m4 = 4.0 * sigma2_m2 * ranges_m[..., None, :] ** 2
        return np.asarray((self.of * variance_m4) @ self.of.T, float)


def all_pairs(anchors: Anchors) -> Rows:
    """Every pair of anchors, in the README's order: n (n - 1) / 2 rows of rank n - 1."""
    return Rows(anchors, np.array([i - j for i, j in combinations(np.eye(len(anchors)), 2)]))


def independent(anchors: Anchors) -> Rows:
    """The first anchor against each other one: n - 1 rows, from which all pairs follow."""
    return Rows(anchors, np.hstack([np.ones((len(anchors) - 1, 1)), -np.eye(len(anchors) - 1)]))
