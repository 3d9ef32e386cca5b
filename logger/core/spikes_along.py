"""The spikes of a recorded walk: `SpikeFilter`, asked only where neighbours differ enough."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.spikes import LEAST_ABOVE_DB, N_CHANGES, REACH_M, SIDE, SLOPE_SIDE, SpikeFilter


class _Level(NamedTuple):
    """As `LevelAtPoint`; `k` is its number among the readings."""

    k: int
    x_m: float
    y_m: float
    level_dbm: float
    limit: int


class _Levels(NamedTuple):
    """The levels of a walk, shape (n,) each in time order."""

    x_m: FloatArray
    y_m: FloatArray
    level_dbm: FloatArray
    limit: IntArray

    def rows(self, begin: int, end: int) -> list[_Level]:
        columns = (column[begin:end].tolist() for column in self)
        return [_Level(*row) for row in zip(range(begin, end), *columns, strict=True)]

    def changes_db(self) -> FloatArray:
        """Changes between neighbours that the noise is taken from, NaN for others: (n - 1,)."""
        is_near = np.hypot(np.diff(self.x_m), np.diff(self.y_m)) <= REACH_M
        is_level = (self.limit[1:] == 0) & (self.limit[:-1] == 0)
        return np.where(is_near & is_level, np.abs(np.diff(self.level_dbm)), np.nan)

    def doubtful(self) -> BoolArray:
        """Levels that may be spikes, shape (n,).

        They are far from their predecessor, and two of the next three do not confirm them.
        """
        n = len(self.level_dbm)
        doubtful = np.ones(n, np.bool_)
        doubtful[1:] = np.abs(np.diff(self.level_dbm)) > LEAST_ABOVE_DB
        inner = slice(0, max(n - SIDE, 0))
        ahead = [slice(k, k + inner.stop) for k in range(1, SIDE + 1)]
        off_db = np.stack([self.level_dbm[inner] - self.level_dbm[other] for other in ahead])
        away_m = [
            np.hypot(self.x_m[inner] - self.x_m[other], self.y_m[inner] - self.y_m[other])
            for other in ahead
        ]
        n_above = np.sum(off_db > LEAST_ABOVE_DB, axis=0)
        n_below = np.sum(off_db < -LEAST_ABOVE_DB, axis=0)
        is_far = np.any(np.stack(away_m) > REACH_M, axis=0)
        doubtful[inner] &= (2 * np.maximum(n_above, n_below) > SIDE) | is_far
        return doubtful


def spikes_along(
    x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray, limit: IntArray
) -> Iterator[tuple[int, float]]:
    """Number of each spike among the levels of a walk, (n,) in time order, and its height in dB."""
    levels = _Levels(x_m, y_m, level_dbm, limit)
    changes_db, n = levels.changes_db(), len(level_dbm)
    doubtful = np.flatnonzero(levels.doubtful())
    spikes = SpikeFilter[_Level]()
    last_used, k = -1, 0
    while len(doubtful) and k < n:
        following = int(np.searchsorted(doubtful, k))
        end = int(doubtful[following]) if following < len(doubtful) else n
        if last_used == k - 1 and 0 < k < end:
            skipped_db = changes_db[k - 1 : end - 1]
            skipped_db = skipped_db[np.isfinite(skipped_db)][-N_CHANGES:]
            spikes.skip(levels.rows(max(k, end - SLOPE_SIDE), end), skipped_db.tolist())
            last_used, k = end - 1, end
            continue
        for reading, spike_db in spikes.take(levels.rows(k, k + 1)[0]):
            if spike_db:
                yield reading.k, spike_db
            else:
                last_used = reading.k
        k += 1
    yield from ((reading.k, spike_db) for reading, spike_db in spikes.finish() if spike_db)
