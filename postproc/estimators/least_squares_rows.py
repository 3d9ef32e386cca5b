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

    places: Places
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
        free = self.free
        return Rows(
            self.places.part(free), self.height_m[free], self.level_dbm[free],
            self.limit[free], self.readings[free], self.weight[free],
        )  # fmt: skip

    def log_distance_db(self, position: FloatArray) -> FloatArray:
        """L of each row from a position [x, y, ...]."""
        dx_m, dy_m = self._differences(position)
        return path_loss.log_distance_db(dx_m, dy_m, self.height_m, self.places.sigma_m)

    def residuals(self, state: FloatArray) -> FloatArray:
        """Model minus level in dB, shape (n,)."""
        distance_db = self.log_distance_db(state)
        return path_loss.level_dbm(state[2], state[3], distance_db) - self.level_dbm

    def jacobian(self, state: FloatArray) -> FloatArray:
        """Derivative of `residuals` by the state, shape (n, 4)."""
        dx_m, dy_m = self._differences(state)
        return path_loss.level_slopes(dx_m, dy_m, state[3], self.height_m, self.places.sigma_m)

    def position_slopes(
        self, position: FloatArray, eta: float, distance_db: FloatArray
    ) -> FloatArray:
        """Derivative of the model by the position (n, 2), `distance_db` from there."""
        dx_m, dy_m = self._differences(position)
        return path_loss.position_slopes(dx_m, dy_m, eta, distance_db)

    def _differences(self, position: FloatArray) -> FloatArray:
        return position[:2, None] - self.places.xy_m

    def best_at(self, position: FloatArray) -> FloatArray:
        """State of a position: P0 and eta by weighted least squares over the levels."""
        rows = self if np.all(self.free) else self.levels()
        return rows.regression(position)[0]

    def regression(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """State of a position (x, y) with the P0 and eta of all rows as levels, and their L (n,).

        Eta is 0 where all rows are equally far.
        """
        distance_db = self.log_distance_db(position)
        share = self.weight / np.sum(self.weight)
        mean_db, mean_dbm = float(share @ distance_db), float(share @ self.level_dbm)
        off_db = distance_db - mean_db
        spread_db2 = max(float(share @ off_db**2), _LEAST_SPREAD_DB2)
        eta = -float(share @ (off_db * (self.level_dbm - mean_dbm))) / spread_db2
        return np.array([*position[:2], mean_dbm + eta * mean_db, eta]), distance_db


def each_reading(obs: Readings, height_m: float) -> Rows:
    """A row of weight 1 for each reading."""
    one = np.ones(len(obs))
    return Rows(obs.places, height_m * one, obs.level_dbm, obs.limit, one, one)


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

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(row, values) / count, float)

    level_dbm = mean(obs.level_dbm)
    if robust:
        middle = (np.cumsum(count) - 0.5 * count).astype(np.int64)
        in_order = np.lexsort((obs.level_dbm, row))
        level_dbm = obs.level_dbm[in_order][middle]
    places = Places.of(mean(obs.x_m), mean(obs.y_m), sigma_m=mean(obs.position_sigma_m))
    weight = 2.0 * count / (n_there[kind // 3] + 1.0)
    return Rows(places, mean(rows.height_m), level_dbm, kind % 3 - 1, count, weight)


def _squares(places: Places) -> IntArray:
    fine = squares(places, _FINE_SQUARES, finest_m=_SQUARE_M)[0]
    count = np.bincount(fine)
    centres = Places.of(*(np.bincount(fine, v) / count for v in (places.x_m, places.y_m)))
    return squares(centres, _MOST_ROWS, finest_m=_SQUARE_M)[0][fine]
