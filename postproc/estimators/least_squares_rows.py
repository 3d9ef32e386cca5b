"""The rows of a least-squares fit: readings, or their means where there are many."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.model import path_loss
from logger.core.model.blocks import squares
from logger.core.places import Places
from logger.core.readings import Readings

_MOST_ROWS = 2000  # a fit of so many takes some 20 ms
_SQUARE_M = 1.0
_LEAST_SPREAD_DB2 = 1e-12  # of L: above what rounding leaves of equal distances
_FINE_SQUARES = 50_000  # centres that are cheap to gather again


class Rows(NamedTuple):
    """Readings, or means of those in a square, shape (n,) each.

    `limit` is -1 where the level is the modem's lowest, 1 where it is the highest, else 0;
    `height_m` is that of the antenna above the receiver, `readings` how many a row stands for.
    """

    x_m: FloatArray
    y_m: FloatArray
    position_sigma_m: FloatArray
    height_m: FloatArray
    level_dbm: FloatArray
    limit: IntArray
    readings: FloatArray
    weight: FloatArray

    @property
    def free(self) -> BoolArray:
        """Which rows are levels, not limits."""
        return np.asarray(self.limit == 0, np.bool_)

    def levels(self) -> "Rows":
        """The rows that are levels."""
        return Rows._make(column[self.free] for column in self)

    def log_distance_db(self, x_m: float, y_m: float) -> FloatArray:
        """L of each row from a position."""
        return path_loss.log_distance_db(
            x_m - self.x_m, y_m - self.y_m, self.height_m, self.position_sigma_m
        )

    def residuals(self, state: FloatArray) -> FloatArray:
        """Model minus level in dB, shape (n,)."""
        distance_db = self.log_distance_db(state[0], state[1])
        return path_loss.level_dbm(state[2], state[3], distance_db) - self.level_dbm

    def jacobian(self, state: FloatArray) -> FloatArray:
        """Derivative of `residuals` by the state, shape (n, 4)."""
        dx_m, dy_m = state[0] - self.x_m, state[1] - self.y_m
        return path_loss.level_slopes(dx_m, dy_m, state[3], self.height_m, self.position_sigma_m)

    def best_at(self, x_m: float, y_m: float) -> FloatArray:
        """State of a position: P0 and eta by weighted least squares over the levels."""
        rows = self if np.all(self.free) else self.levels()
        return rows.regression(np.array([x_m, y_m]))[0]

    def regression(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """State of a position (x, y) with the P0 and eta of all rows as levels, and their L (n,).

        Eta is 0 where all rows are equally far.
        """
        distance_db = self.log_distance_db(position[0], position[1])
        share = self.weight / np.sum(self.weight)
        mean_db, mean_dbm = float(share @ distance_db), float(share @ self.level_dbm)
        off_db = distance_db - mean_db
        spread_db2 = max(float(share @ off_db**2), _LEAST_SPREAD_DB2)
        eta = -float(share @ (off_db * (self.level_dbm - mean_dbm))) / spread_db2
        return np.array([*position, mean_dbm + eta * mean_db, eta]), distance_db


def each_reading(obs: Readings, height_m: float) -> Rows:
    """A row of weight 1 for each reading."""
    one = np.ones(len(obs))
    return Rows(
        obs.x_m, obs.y_m, obs.position_sigma_m, height_m * one, obs.level_dbm, obs.limit, one, one
    )


def group(obs: Readings, height_m: float, *, robust: bool) -> Rows:
    """The readings or, of more than 2000, their means by square; a robust fit takes the medians.

    Readings of one square share its shadowing: n of them weigh 2 n / (n + 1), as if half of the
    variance were shared.
    """
    rows = each_reading(obs, height_m)
    square = _squares(obs.places)
    n_there = np.bincount(square).astype(float)
    if len(obs) <= _MOST_ROWS:
        return rows._replace(weight=2.0 / (n_there[square] + 1.0))
    kind, row = np.unique(3 * square + rows.limit + 1, return_inverse=True)
    count = np.bincount(row).astype(float)
    means = Rows._make(np.bincount(row, column) / count for column in rows)
    if robust:
        middle = (np.cumsum(count) - 0.5 * count).astype(np.int64)
        in_order = np.lexsort((obs.level_dbm, row))
        means = means._replace(level_dbm=obs.level_dbm[in_order][middle])
    weight = 2.0 * count / (n_there[kind // 3] + 1.0)
    return means._replace(limit=kind % 3 - 1, readings=count, weight=weight)


def _squares(places: Places) -> IntArray:
    fine = squares(places, _FINE_SQUARES, finest_m=_SQUARE_M)[0]
    count = np.bincount(fine)
    centres = Places.of(*(np.bincount(fine, v) / count for v in (places.x_m, places.y_m)))
    return squares(centres, _MOST_ROWS, finest_m=_SQUARE_M)[0][fine]
