"""The spikes among all levels of a walk: `SpikeFilter`, which passes over quiet stretches at once.

Of a stretch without a large change between neighbours the filter remembers the last readings and
changes only, so that no other reading of it has to be taken one by one.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.spikes import (
    LEAST_ABOVE_DB,
    N_CHANGES,
    REACH_M,
    SLOPE_SIDE,
    SpikeCheck,
    SpikeFilter,
)


class _Level(NamedTuple):
    """As `LevelAtPoint`; `k` is its number among the readings."""

    k: int
    x_m: float
    y_m: float
    level_dbm: float
    limit: int


def spikes_along(
    x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray, limit: IntArray
) -> list[tuple[int, float]]:
    """Number of each spike among the levels of a walk, (n,) in time order, and its height in dB."""
    walk = _Walk(x_m, y_m, level_dbm, limit)
    spikes, checks = SpikeFilter[_Level](), list[SpikeCheck[_Level]]()
    k = 0
    while k < len(x_m):
        latest = spikes.take(walk.level(k))
        checks += latest
        k += 1
        if latest and latest[-1].reading.k == k - 1 and not latest[-1].spike_db:
            k = _skip_quiet(spikes, walk, k)
    checks += spikes.finish()
    return [(check.reading.k, check.spike_db) for check in checks if check.spike_db]


class _Walk:
    """Levels in time order, the changes between neighbours, and where these are large."""

    def __init__(
        self, x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray, limit: IntArray
    ) -> None:
        self._columns = x_m, y_m, level_dbm, limit
        self._change_db = np.abs(np.diff(level_dbm))
        is_inside = (limit[1:] == 0) & (limit[:-1] == 0)
        self._is_kept = is_inside & (np.hypot(np.diff(x_m), np.diff(y_m)) <= REACH_M)
        large = 1 + np.flatnonzero(self._change_db > LEAST_ABOVE_DB)
        self._large = np.append(large, len(x_m))

    def level(self, k: int) -> _Level:
        """Reading number k."""
        x_m, y_m, level_dbm, limit = (column[k].item() for column in self._columns)
        return _Level(k, x_m, y_m, level_dbm, limit)

    def next_large(self, k: int) -> int:
        """Number of the first reading from k on that is far from its predecessor, or the end."""
        return int(self._large[np.searchsorted(self._large, k)])

    def kept_changes_db(self, first: int, end: int) -> list[float]:
        """Changes to the readings from `first` to `end` that a filter keeps, the last ones."""
        some = slice(first - 1, end - 1)
        kept: list[float] = self._change_db[some][self._is_kept[some]][-N_CHANGES:].tolist()
        return kept


def _skip_quiet(spikes: SpikeFilter[_Level], walk: _Walk, first: int) -> int:
    """Pass on all readings before the next large change at once; return its number."""
    end = walk.next_large(first)
    spikes.take_unchecked(
        (walk.level(k) for k in range(max(first, end - SLOPE_SIDE), end)),
        walk.kept_changes_db(first, end),
    )
    return end
