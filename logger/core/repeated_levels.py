"""Levels that a modem or telephone repeats from its cache while the receiver moves.

They count once.

A telephone whose screen is off, or a modem that hears a neighbour no more, reports its last level
again and again. Taken as measured, such levels locate a transmitter where there is none. Levels are
whole decibels, so equal ones may both be measured; but measured levels that often equal the one
before also often differ from it by one decibel, and cached ones never do. So a reading is compared
with the one before each time that the receiver has moved on: equal levels speak for a cache,
changes of one step of the scale against it, larger ones for neither. A limit of the scale is
repeated by right.

Desktop and device use the same test (`CacheTest`). The device leaves repeats out once the test is
sure, the desktop also those before, which made it so.
"""

from math import hypot, inf, log, nan

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.places import Places

_MOVED_M = 10.0
"""Way between comparisons: many wavelengths, so fading differs."""
_SIGMAS = 2.0
"""Way between comparisons in sigmas of the position: a receiver at rest seems to move less."""
_EQUAL_IF_MEASURED = 0.6
"""Share of equal levels among those within one step, in the quietest of 506 measured walks (LoRa at
the noise floor). A spread of 4 dB leaves a third.
"""
_EQUAL_IF_CACHED = 0.95
"""In logs of telephones that repeat two reports of three."""
_MEASURED_AS_WELL = 1000.0
"""Odds above which levels are taken for cached: equal ones over 150 m, of 10 m between readings."""
_STEP_DB = 1.0
_ROUNDING = 1e-6  # of a sum of steps

_LEAST = log(_MEASURED_AS_WELL)
_MOST = 2.0 * _LEAST  # so that a cache that has ended is soon forgotten
_EQUAL = log(_EQUAL_IF_CACHED / _EQUAL_IF_MEASURED)
_STEP = log((1.0 - _EQUAL_IF_CACHED) / (1.0 - _EQUAL_IF_MEASURED))


class CacheTest:
    """Whether the levels of one cell come from a cache: `take` them in their order.

    `log_odds` for a cache begin at 0 and do not fall below: it may begin at any time.
    """

    def __init__(self) -> None:
        self.log_odds = 0.0
        self._x_m = self._y_m = -inf  # of the last comparison
        self._compared_dbm = self._last_dbm = nan
        self._is_unchanged = False  # since the last comparison
        self._step_db = inf  # smallest change so far: some modems count in steps of 2 dB

    @property
    def is_cached(self) -> bool:
        """Whether a level equal to the one before is a repeat."""
        return self.log_odds > _LEAST

    def take(self, place: Places, level_dbm: float, limit: int) -> bool:
        """Whether the level equals the one before and is no limit of the scale."""
        return self._take(
            place.x_m.item(), place.y_m.item(), place.sigma_m.item(), level_dbm, limit
        )

    def _take(self, x_m: float, y_m: float, sigma_m: float, level_dbm: float, limit: int) -> bool:
        change_db = abs(level_dbm - self._last_dbm)
        self._last_dbm = level_dbm
        if change_db > 0.0:
            self._is_unchanged = False
            self._step_db = min(self._step_db, change_db)
        if hypot(x_m - self._x_m, y_m - self._y_m) >= max(_MOVED_M, _SIGMAS * sigma_m):
            self._compare(level_dbm, limit)
            self._x_m, self._y_m = x_m, y_m
        return change_db == 0.0 and not limit

    def _compare(self, level_dbm: float, limit: int) -> None:
        off_db = abs(level_dbm - self._compared_dbm)
        if self._is_unchanged and not limit:
            self.log_odds = min(self.log_odds + _EQUAL, _MOST)
        elif off_db <= max(_STEP_DB, self._step_db) and not limit:
            self.log_odds = max(self.log_odds + _STEP, 0.0)
        self._compared_dbm, self._is_unchanged = level_dbm, True


def repeats_along(places: Places, level_dbm: FloatArray, limit: IntArray) -> list[int]:
    """Numbers of the readings of a walk, (n,) in time order, that are repeats from a cache.

    These are all equal levels since the odds rose from 0, up to where the test was sure last.
    """
    if _most_equal(places, level_dbm, limit) * _EQUAL <= _LEAST:
        return []  # 100 000 readings one by one take a third of a second
    test, repeats = CacheTest(), list[int]()
    equal, n_sure = list[int](), 0
    every = places.x_m, places.y_m, places.sigma_m, level_dbm, limit
    columns = (column.tolist() for column in every)
    for k, reading in enumerate(zip(*columns, strict=True)):
        if test._take(*reading):  # noqa: SLF001 (this module)
            equal.append(k)
        elif test.log_odds == 0.0:
            repeats += equal[:n_sure]
            equal, n_sure = [], 0
        if test.is_cached:
            n_sure = len(equal)
    return repeats + equal[:n_sure]


def _most_equal(places: Places, level_dbm: FloatArray, limit: IntArray) -> float:
    """Largest number of comparisons that can find a level unchanged.

    The receiver has to move on before each.
    """
    is_equal = np.diff(level_dbm) == 0.0
    run = np.cumsum(~is_equal)
    way_m, count = (
        np.bincount(run, places.steps_m * is_equal),
        np.bincount(run, is_equal & (limit[1:] == 0)),
    )
    return float(np.sum(np.minimum(np.floor(way_m / _MOVED_M + _ROUNDING), count)))
