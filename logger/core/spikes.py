"""Single levels that their neighbours do not confirm: gross errors.

One level 30 dB too strong among 400 moves the posterior of a transmitter by hundreds of metres. A
likelihood with heavy tails cannot distinguish it from the peak beside a transmitter; the readings
just before and after it can, since fields change over metres. So a level is compared with those
around it, never with a model of the walk. It is a spike if it is further above (or below) both
sides than the noise between neighbours explains, and further above them than a transmitter right
there would make it, given how they rise towards it.

The readings are checked in their order, each as soon as possible. One that is near its predecessor
passes at once; another waits until two of the next three confirm or contradict it.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import islice, pairwise, takewhile
from math import hypot, sqrt
from statistics import fmean, median
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model.path_loss import log_distance
from logger.core.places import Places

_SIDE = 3
"""Readings on each side: the median of three is no spike even with two in a row."""
SLOPE_SIDE = 5
"""Readings on each side that show how levels rise towards a transmitter here."""
REACH_M = 200.0
"""Readings farther away say little about the level here."""
LEAST_ABOVE_DB, _LEAST_BELOW_DB = 18.0, 20.0
"""Smaller differences move no position far, and occur beside a transmitter."""
N_CHANGES = 64
"""Changes between neighbours that the noise is taken from."""

_FEWEST = 3
"""With fewer readings around it, which of them is wrong is open."""
_SIGMAS_ABOVE, _SIGMAS_BELOW = 4.0, 5.0
"""Fading goes deeper than it goes high (Rayleigh)."""
_TWO_FACTOR = 4.0 / 3.0
"""Two in a row must be farther out by this: they may be a real peak."""
_PASSING_SIGMAS = 2.5
"""A peak this much above that of a transmitter right here is a spike."""
_FIRST_CHANGES = 4
_FIRST_SIGMA_DB = 4.0
"""Noise between neighbours at first: between 3 dB (white) and 5.4 dB (measured walks)."""
_QUANTILES = ((0.5, 0.6745), (0.9, 1.6449))
"""Of the changes between neighbours, and of a standard normal.

The larger result counts, since noise of two kinds has a small median.
"""
_PASSING_M = 7.0
"""A transmitter right here is 5 m above and 5 m beside the walk.

Of simulated passes with a reading every 5 to 30 m, noise 3 or 6 dB, the peak is taken for a spike
in at most 3 of 100 at 5 m above and beside, in 7 of 100 at 2 and 3 m.
"""
_ETA, _ETA_SIGMA = 2.6, 2.0
"""Wide prior of the exponent close to the transmitter."""
_LEAST_SIGMA_DB = 1.0
"""Levels are integers in dB, so equal neighbours do not mean zero noise."""


T = TypeVar("T")


class _Level(NamedTuple, Generic[T]):
    """A reading, the receiver's place, and its level; `limit` as in `readings.limits`."""

    reading: T
    x_m: float
    y_m: float
    level_dbm: float
    limit: int


class SpikeFilter(Generic[T]):
    """Passes readings on in their order, each checked against its neighbours.

    A reading comes with how far it is above (or below) its neighbours; 0 if it is to be used.
    """

    def __init__(self) -> None:
        self._before: deque[_Level[T]] = deque(maxlen=SLOPE_SIDE)  # without spikes
        quantiles = ((k + 0.5) / _FIRST_CHANGES for k in range(_FIRST_CHANGES))
        first_db = (sqrt(2.0) * _FIRST_SIGMA_DB * quantile for quantile in quantiles)
        self._changes_db: deque[float] = deque(first_db, maxlen=N_CHANGES)
        self._waiting: deque[_Level[T]] = deque()

    def take(
        self, reading: T, place: Places, level_dbm: float, limit: int
    ) -> list[tuple[T, float]]:
        """The readings that can be decided now."""
        latest = _Level(reading, place.x_m.item(), place.y_m.item(), level_dbm, limit)
        return self._take(latest)

    def _take(self, latest: _Level[T]) -> list[tuple[T, float]]:
        if not self._waiting and self._is_near_last(latest):  # nearly all; the device counts
            self._keep(latest)
            return [(latest.reading, 0.0)]
        self._waiting.append(latest)
        return self._pass(ended=False)

    def _take_unchecked(self, levels: Iterable[_Level[T]], changes_db: Iterable[float]) -> None:
        """Take the last of many readings that are near their predecessors, while none waits.

        `changes_db` are those that `take` would have kept, as many as the filter remembers or all.
        """
        self._before.extend(levels)
        self._changes_db.extend(changes_db)

    def finish(self) -> list[tuple[T, float]]:
        """The readings that still wait, decided by those there are."""
        return self._pass(ended=True)

    def _pass(self, *, ended: bool) -> list[tuple[T, float]]:
        checks: list[tuple[T, float]] = []
        while self._waiting:
            spike_db = self._spike_db(ended=ended)
            if spike_db is None:
                break
            reading = self._waiting.popleft()
            if spike_db == 0.0:
                self._keep(reading)
            checks.append((reading.reading, spike_db))
        return checks

    def _is_near_last(self, reading: _Level[T]) -> bool:
        """Whether no spike can be between the last level and this one."""
        if not self._before:
            return False
        return abs(reading.level_dbm - self._before[-1].level_dbm) <= LEAST_ABOVE_DB

    def _keep(self, reading: _Level[T]) -> None:
        last = self._before[-1] if self._before else None
        if last is not None and not (reading.limit or last.limit) and _are_near(reading, last):
            self._changes_db.append(abs(reading.level_dbm - last.level_dbm))
        self._before.append(reading)

    def _spike_db(self, *, ended: bool) -> float | None:
        """How far the reading that waits longest stands out, 0 if it does not, None if open."""
        head = self._waiting[0]
        if self._is_near_last(head):
            return 0.0
        before = [reading for reading in self._before if _are_near(reading, head)]
        following = list(islice(self._waiting, 1, None))
        near = takewhile(lambda reading: _are_near(reading, head), following)
        after = list(islice(near, SLOPE_SIDE))
        changes_db = (abs(a.level_dbm - b.level_dbm) for a, b in pairwise(after))
        sigma_db = _sigma_db([*self._changes_db, *changes_db])
        is_complete = ended or len(after) < len(following)
        return _Neighbours(head, before, after, sigma_db, is_complete).spike_db()


class _Neighbours(NamedTuple, Generic[T]):
    """`ended` if no more readings will come."""

    head: _Level[T]
    before: Sequence[_Level[T]]
    after: Sequence[_Level[T]]
    sigma_db: float
    ended: bool

    def spike_db(self) -> float | None:
        """As `SpikeFilter._spike_db`."""
        if not self.ended and len(self.before) <= 1 and len(self.after) < _SIDE:
            return None
        off_db = self.head.level_dbm - self._usual_dbm()
        margin_db = self._margin_db(off_db)
        is_alone = self.ended and len(self.before) + len(self.after) < _FEWEST
        if abs(off_db) <= margin_db or is_alone:
            return 0.0
        return self._outlier_db(off_db, margin_db)

    def _outlier_db(self, off_db: float, margin_db: float) -> float | None:
        sign, usual_dbm = (1.0 if off_db > 0.0 else -1.0), self._usual_dbm()
        below_db = [sign * (self.head.level_dbm - one.level_dbm) for one in self.after]
        above_db = [sign * (one.level_dbm - usual_dbm) for one in self.after[:_SIDE]]
        n_as_far = sum(db > margin_db for db in above_db)
        vote = _vote([db > margin_db for db in below_db[:_SIDE]], n_as_far, ended=self.ended)
        if vote is None:
            return None
        if not vote or (n_as_far and abs(off_db) <= _TWO_FACTOR * margin_db):
            return 0.0
        apart = [one for one, db in zip(self.after, below_db, strict=True) if db > margin_db]
        if off_db < 0.0 or not self._may_be_passing([*self.before, *apart]):
            return off_db
        return None if not self.ended and len(self.after) < SLOPE_SIDE else 0.0

    def _usual_dbm(self) -> float:
        side = self.before[-_SIDE:] if len(self.before) > 1 else self.after[:_SIDE] or self.before
        return median(one.level_dbm for one in side) if side else self.head.level_dbm

    def _margin_db(self, off_db: float) -> float:
        if off_db > 0.0:
            return max(LEAST_ABOVE_DB, _SIGMAS_ABOVE * self.sigma_db)
        return max(_LEAST_BELOW_DB, _SIGMAS_BELOW * self.sigma_db)

    def _may_be_passing(self, around: Sequence[_Level[T]]) -> bool:
        """Whether a transmitter right here explains the level.

        Extrapolates the slope of the levels around over log-distance, with a wide prior of the
        exponent.
        """
        if not around:
            return True
        distances_db = [_passing_distance_db(self.head, one) for one in around]
        mean_db, mean_dbm = fmean(distances_db), fmean(one.level_dbm for one in around)
        variance_db2 = max(self.sigma_db, _LEAST_SIGMA_DB) ** 2
        spread = sum((d - mean_db) ** 2 for d in distances_db)
        products = zip(distances_db, around, strict=True)
        fall = sum((mean_db - d) * one.level_dbm for d, one in products)
        precision = spread / variance_db2 + _ETA_SIGMA**-2
        eta = max((fall / variance_db2 + _ETA * _ETA_SIGMA**-2) / precision, 0.0)
        closer_db = mean_db - log_distance(_PASSING_M**2)
        unsure_db2 = variance_db2 * (1.0 + 1.0 / len(around)) + closer_db**2 / precision
        highest_dbm = mean_dbm + eta * closer_db + _PASSING_SIGMAS * sqrt(unsure_db2)
        return self.head.level_dbm <= highest_dbm


def _vote(is_apart: Sequence[bool], n_as_far: int, *, ended: bool) -> bool | None:
    """Whether two of three readings after a level contradict it, fewer if there are no more.

    `n_as_far` of them stand out as it does: a walk that ends with two such has not shown a real
    peak.
    """
    n_apart, n_shared = sum(is_apart), len(is_apart) - sum(is_apart)
    if ended and len(is_apart) < _SIDE:
        return n_apart >= n_shared or n_as_far == n_shared == 1
    if 2 * max(n_apart, n_shared) < _SIDE:
        return None
    return n_apart > n_shared


def _sigma_db(changes_db: Iterable[float]) -> float:
    by_size = sorted(changes_db)
    sizes = ((by_size[int(share * len(by_size))], normal) for share, normal in _QUANTILES)
    return max(size_db / (sqrt(2.0) * normal) for size_db, normal in sizes)


def _are_near(a: _Level[T], b: _Level[T]) -> bool:
    return hypot(a.x_m - b.x_m, a.y_m - b.y_m) <= REACH_M


def _passing_distance_db(head: _Level[T], other: _Level[T]) -> float:
    dx_m, dy_m = other.x_m - head.x_m, other.y_m - head.y_m
    return log_distance(dx_m**2 + dy_m**2 + _PASSING_M**2)


def spikes_along(places: Places, level_dbm: FloatArray, limit: IntArray) -> list[tuple[int, float]]:
    """Number of each spike among the levels of a walk, (n,) in time order, and its height in dB.

    Quiet stretches are passed over at once: the filter remembers only the last readings and changes
    of a stretch without a large change between neighbours.
    """
    walk = _Walk(places, level_dbm, limit)
    spikes, checks = SpikeFilter[int](), list[tuple[int, float]]()
    k = 0
    while k < len(places):
        latest = spikes._take(walk.level(k))  # noqa: SLF001 (this module)
        checks += latest
        k += 1
        if latest and latest[-1] == (k - 1, 0.0):
            k = _skip_quiet(spikes, walk, k)
    checks += spikes.finish()
    return [(number, spike_db) for number, spike_db in checks if spike_db]


class _Walk:
    def __init__(self, places: Places, level_dbm: FloatArray, limit: IntArray) -> None:
        x_m, y_m = places.x_m, places.y_m
        self._columns = x_m, y_m, level_dbm, limit
        self._change_db = np.abs(np.diff(level_dbm))
        is_inside = (limit[1:] == 0) & (limit[:-1] == 0)
        self._is_kept = is_inside & (np.hypot(np.diff(x_m), np.diff(y_m)) <= REACH_M)
        large = 1 + np.flatnonzero(self._change_db > LEAST_ABOVE_DB)
        self._large = np.append(large, len(x_m))

    def level(self, k: int) -> _Level[int]:
        x_m, y_m, level_dbm, limit = (column[k].item() for column in self._columns)
        return _Level(k, x_m, y_m, level_dbm, limit)

    def next_large(self, k: int) -> int:
        """The first reading from k on that is far from its predecessor, or the end."""
        return int(self._large[np.searchsorted(self._large, k)])

    def kept_changes_db(self, first: int, end: int) -> list[float]:
        """The last changes to the readings from `first` to `end`, as many as a filter keeps."""
        some = slice(first - 1, end - 1)
        kept: list[float] = self._change_db[some][self._is_kept[some]][-N_CHANGES:].tolist()
        return kept


def _skip_quiet(spikes: SpikeFilter[int], walk: _Walk, first: int) -> int:
    """Returns the number of the reading with the next large change."""
    end = walk.next_large(first)
    spikes._take_unchecked(  # noqa: SLF001 (this module)
        (walk.level(k) for k in range(max(first, end - SLOPE_SIDE), end)),
        walk.kept_changes_db(first, end),
    )
    return end
