"""Likelihood of places where the noise is known exactly.

Levels z ~ N(P0 - eta L(x, y), K) with K known and dense; P0 and eta are normal and integrated in
closed form, the prior of the place is the locator's. With Phi = [1, -L], A = Phi' K^-1 Phi +
Lambda0, b = Phi' K^-1 z + Lambda0 m0:

    log p(x, y | z) = const - 1/2 log|A| + 1/2 b' A^-1 b + log p(x, y)

Rounding counts as white noise of a twelfth of a step squared.
"""

import numpy as np
from scipy.linalg import solve_triangular

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import log_distance_db

from . import ours
from .bound import slope_db_per_m
from .world import Noise, Walk

_CHUNK = 1024


class Likelihood:
    """Likelihood of positions for a walk with known noise."""

    def __init__(self, walk: Walk, noise: Noise) -> None:
        self.walk = walk
        self._sigma_db = noise.total_db
        self._root = (
            None
            if noise.shadow_db == 0.0
            else np.linalg.cholesky(noise.covariance_db2(walk.x_m, walk.y_m))
        )
        self._one = self.whiten(np.ones((len(walk), 1)))
        self._level = self.whiten(walk.level_dbm[:, None])
        self._reach_odds = ours.log_reach_odds(walk)

    def whiten(self, rows: FloatArray) -> FloatArray:
        """W rows with W K W' = I, shape (n, h) as given."""
        if self._root is None:
            return rows / self._sigma_db
        return np.asarray(solve_triangular(self._root, rows, lower=True, check_finite=False), float)

    def linear(
        self, x_m: FloatArray, y_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Linear model at positions (h,): whitened -L, A, b, and the mean of P0 and eta.

        Shapes: -L (n, h), A as a00, a01, a11 (3, h), b (2, h), mean (2, h).
        """
        slope = self.whiten(
            -log_distance_db(x_m - self.walk.x_m[:, None], y_m - self.walk.y_m[:, None])
        )
        prior, one, level = ours.LINEAR_PRIOR, self._one[:, 0], self._level[:, 0]
        a = np.stack(
            [
                np.full(len(x_m), one @ one + prior.precision[0]),
                one @ slope,
                np.sum(slope**2, axis=0) + prior.precision[1],
            ]
        )
        b = (
            np.stack([np.full(len(x_m), one @ level), level @ slope])
            + (prior.precision * prior.mean)[:, None]
        )
        theta = np.stack([a[2] * b[0] - a[1] * b[1], a[0] * b[1] - a[1] * b[0]]) / (
            a[0] * a[2] - a[1] ** 2
        )
        return slope, a, b, theta

    def log_p(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Log posterior density of places up to a constant, shape (h,)."""
        starts = range(0, len(x_m), _CHUNK)
        return np.concatenate(
            [self._log_p(x_m[i : i + _CHUNK], y_m[i : i + _CHUNK]) for i in starts]
        )

    def _log_p(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        _, a, b, theta = self.linear(x_m, y_m)
        log_p = 0.5 * np.sum(b * theta, axis=0) - 0.5 * np.log(a[0] * a[2] - a[1] ** 2)
        away_m = nearest_m(self.walk, x_m, y_m)
        return np.asarray(log_p + ours.log_position_prior(away_m, self._reach_odds), float)

    def local_sigma_m(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Smallest standard deviation of a source's position for unknown P0 and eta, shape (h,)."""
        return np.concatenate(
            [
                self._local_sigma_m(x_m[i : i + _CHUNK], y_m[i : i + _CHUNK])
                for i in range(0, len(x_m), _CHUNK)
            ]
        )

    def _local_sigma_m(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        slope, a, _, theta = self.linear(x_m, y_m)
        east, north = (self.whiten(g) for g in slope_db_per_m(self.walk, x_m, y_m, theta[1]))
        determinant = a[0] * a[2] - a[1] ** 2
        one = self._one

        def information(g: FloatArray, h: FloatArray) -> FloatArray:
            """Product of two columns less what P0 and eta explain of it."""
            g0, g1, h0, h1 = (
                np.sum(u * v, axis=0) for u, v in ((g, one), (g, slope), (h, one), (h, slope))
            )
            explained = (g0 * (a[2] * h0 - a[1] * h1) + g1 * (a[0] * h1 - a[1] * h0)) / determinant
            return np.asarray(np.sum(g * h, axis=0) - explained, float)

        xx, xy, yy = information(east, east), information(east, north), information(north, north)
        largest = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
        return 1.0 / np.sqrt(np.maximum(largest, 1e-12))


def nearest_m(walk: Walk, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Distance of places from the walk, shape (h,)."""
    return np.asarray(
        np.min(np.hypot(x_m - walk.x_m[:, None], y_m - walk.y_m[:, None]), axis=0), float
    )
