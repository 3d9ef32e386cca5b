"""Single levels that their neighbours do not share: a gross error, not a place.

One level 30 dB too strong among 400 moves the posterior of a transmitter by hundreds of metres. A
likelihood with heavy tails cannot tell it from the peak beside a transmitter; the readings just
before and after it can, since fields change over metres and not at one reading. So a level is
compared with those around it, never with a model of the whole walk: it is a spike where it stands
further above (or below) both sides than the noise between neighbours lets expect, and further above
them than a transmitter right there would make it, given how they rise towards it.

The readings are judged in their order, each as soon as it can be. One that is near its forerunner
is taken at once; another waits until two of the next three say the same of it. The desk judges by
the same class as the device.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice, pairwise, takewhile
from math import hypot, log10, sqrt
from statistics import fmean, median
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray

_SIDE = 3
"""Readings on each side: the middle one of three is no spike even where two are in a row."""
_SLOPE_SIDE = 5
"""Readings on each side that tell how levels rise towards a transmitter right here."""
_REACH_M = 200.0
"""Farther away a level says too little of the level here."""
_LEAST_ABOVE_DB, _LEAST_BELOW_DB = 18.0, 20.0
"""Less than this moves no answer far, and measured levels do it beside a transmitter."""
_FEWEST = 3
"""With fewer readings around it nobody knows which of them is the wrong one."""
_SIGMAS_ABOVE, _SIGMAS_BELOW = 4.0, 5.0
"""Fading goes deeper than it goes high (Rayleigh)."""
_OF_TWO = 4.0 / 3.0
"""So much farther out two in a row have to be: they may be a place."""
_PASSING_SIGMAS = 2.5
_CHANGES = 64
_BEGUN_CHANGES = 4
_BEGUN_SIGMA_DB = 4.0
"""Noise between neighbours before the walk has shown it: between 3 dB (white) and 5.4 dB (measured
walks).
"""
_QUANTILES = ((0.5, 0.6745), (0.9, 1.6449))
"""Of the changes between neighbours, and what they are of a standard normal: the larger answer
counts, since noise of two kinds has a small median.
"""
_PASSING_M = 7.0
"""A transmitter right here is 5 m above and 5 m beside the walk.

Of simulated passes with a reading every 5 to 30 m, noise 3 or 6 dB, the peak is taken for a spike
in at most 3 of 100 at 5 m above and beside, in 7 of 100 at 2 and 3 m.
"""
_ETA, _ETA_SIGMA = 2.6, 2.0


class Placed(Protocol):
    """A level and where it was taken; `limit` as in `scale.limits`."""

    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...
    @property
    def level_dbm(self) -> float: ...
    @property
    def limit(self) -> int: ...


class _Level(NamedTuple):
    """As `Placed`; `k` is its number among the readings."""

    k: int
    x_m: float
    y_m: float
    level_dbm: float
    limit: int


T = TypeVar("T", bound=Placed)


class Judged(NamedTuple, Generic[T]):
    """A reading and by how much it stands out of those around it; 0 where it is to be used."""

    reading: T
    spike_db: float


class SpikeFilter(Generic[T]):
    """Passes readings on in their order, each with what its neighbours say of it; `finish` passes
    on what waits.
    """

    def __init__(self) -> None:
        self._before: deque[T] = deque(maxlen=_SLOPE_SIDE)  # without spikes
        begun_db = (
            sqrt(2.0) * _BEGUN_SIGMA_DB * (k + 0.5) / _BEGUN_CHANGES for k in range(_BEGUN_CHANGES)
        )
        self._changes_db: deque[float] = deque(begun_db, maxlen=_CHANGES)
        self._waiting: deque[T] = deque()

    def take(self, reading: T) -> list[Judged[T]]:
        """Readings that can be judged now that this one has come."""
        self._waiting.append(reading)
        return self._passed(ended=False)

    def finish(self) -> list[Judged[T]]:
        """The readings that still wait, judged by what there is."""
        return self._passed(ended=True)

    def skip(self, last: Sequence[T], changes_db: Sequence[float]) -> None:
        """Be told of readings that are each near their forerunner: the last ones, and the changes
        between all of them.

        Only where none waits and the reading before them was no spike.
        """
        self._before.extend(last)
        self._changes_db.extend(changes_db)

    def _passed(self, *, ended: bool) -> list[Judged[T]]:
        passed: list[Judged[T]] = []
        while self._waiting:
            spike_db = self._judge(ended=ended)
            if spike_db is None:
                break
            reading = self._waiting.popleft()
            if spike_db == 0.0:
                self._keep(reading)
            passed.append(Judged(reading, spike_db))
        return passed

    def _keep(self, reading: T) -> None:
        last = self._before[-1] if self._before else None
        if last is not None and not (reading.limit or last.limit) and _near(reading, last):
            self._changes_db.append(abs(reading.level_dbm - last.level_dbm))
        self._before.append(reading)

    def _judge(self, *, ended: bool) -> float | None:
        """How far the reading that waits longest stands out, 0 where it does not; None while that
        is open.
        """
        head = self._waiting[0]
        if self._before and abs(head.level_dbm - self._before[-1].level_dbm) <= _LEAST_ABOVE_DB:
            return 0.0
        before = [one for one in self._before if _near(one, head)]
        following = list(islice(self._waiting, 1, None))
        after = list(takewhile(lambda one: _near(one, head), following))[:_SLOPE_SIDE]
        walked_on = ended or len(after) < len(following)
        ahead_db = (abs(one.level_dbm - other.level_dbm) for one, other in pairwise(after))
        return _stands_out(
            head, before, after, _sigma_db([*self._changes_db, *ahead_db]), ended=walked_on
        )


def _stands_out(
    head: Placed, before: Sequence[Placed], after: Sequence[Placed], sigma_db: float, *, ended: bool
) -> float | None:
    """As `SpikeFilter._judge`; `ended` where no more readings will come after it."""
    side = before[-_SIDE:] if len(before) > 1 else after[:_SIDE] or before
    if not ended and len(before) <= 1 and len(after) < _SIDE:
        return None
    usual_dbm = median(one.level_dbm for one in side) if side else head.level_dbm
    off_db = head.level_dbm - usual_dbm
    margin_db = (
        max(_LEAST_ABOVE_DB, _SIGMAS_ABOVE * sigma_db)
        if off_db > 0.0
        else max(_LEAST_BELOW_DB, _SIGMAS_BELOW * sigma_db)
    )
    if abs(off_db) <= margin_db or (ended and len(before) + len(after) < _FEWEST):
        return 0.0
    sign = 1.0 if off_db > 0.0 else -1.0
    apart = [one for one in after if sign * (head.level_dbm - one.level_dbm) > margin_db]
    as_far = sum(sign * (one.level_dbm - usual_dbm) > margin_db for one in after[:_SIDE])
    vote = _vote(
        sum(one in apart for one in after[:_SIDE]), len(after[:_SIDE]), as_far, ended=ended
    )
    if vote is None:
        return None
    if not vote or (as_far and abs(off_db) <= _OF_TWO * margin_db):
        return 0.0
    if off_db < 0.0 or not _may_be_passing(head, [*before, *apart], sigma_db):
        return off_db
    return None if not ended and len(after) < _SLOPE_SIDE else 0.0


def _vote(apart: int, heard: int, as_far: int, *, ended: bool) -> bool | None:
    """Whether the readings after it speak against it: two of three do, fewer where there are no
    more.

    `as_far` of them stand out as it does: a walk that ends with two such has not shown that they
    are a place.
    """
    shared = heard - apart
    if ended and heard < _SIDE:
        return apart >= shared or as_far == shared == 1
    if 2 * max(apart, shared) < _SIDE:
        return None
    return apart > shared


def _sigma_db(changes_db: Iterable[float]) -> float:
    """Standard deviation of a level, from changes between neighbours."""
    of_size = sorted(changes_db)
    return max(
        of_size[int(share * len(of_size))] / (sqrt(2.0) * normal) for share, normal in _QUANTILES
    )


def _near(one: Placed, other: Placed) -> bool:
    return hypot(one.x_m - other.x_m, one.y_m - other.y_m) <= _REACH_M


def _may_be_passing(head: Placed, around: Sequence[Placed], sigma_db: float) -> bool:
    """Whether a transmitter right here explains the level, given how those around rise towards it.

    Their slope over log-distance from here, with a wide prior of the exponent, tells how much
    stronger it is up close.
    """
    if not around:
        return True
    far = [
        5.0 * log10((one.x_m - head.x_m) ** 2 + (one.y_m - head.y_m) ** 2 + _PASSING_M**2)
        for one in around
    ]
    mean_far, mean_dbm = fmean(far), fmean(one.level_dbm for one in around)
    variance = max(sigma_db, 1.0) ** 2
    spread = sum((d - mean_far) ** 2 for d in far)
    fall = sum((mean_far - d) * one.level_dbm for d, one in zip(far, around, strict=True))
    precision = spread / variance + _ETA_SIGMA**-2
    eta = max((fall / variance + _ETA * _ETA_SIGMA**-2) / precision, 0.0)
    closer = mean_far - 10.0 * log10(_PASSING_M)
    unsure_db2 = variance * (1.0 + 1.0 / len(around)) + closer**2 / precision
    return head.level_dbm <= mean_dbm + eta * closer + _PASSING_SIGMAS * sqrt(unsure_db2)


def spikes_along(
    x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray, limit: IntArray
) -> Iterator[tuple[int, float]]:
    """Number of each spike among the levels of a walk, shape (n,) in time order, and how far it
    stands out.

    As `SpikeFilter` reading by reading, which is asked only where neighbours differ enough.
    """
    near = np.hypot(np.diff(x_m), np.diff(y_m)) <= _REACH_M
    level = (limit[1:] == 0) & (limit[:-1] == 0)
    change_db = np.where(near & level, np.abs(np.diff(level_dbm)), np.nan)
    doubted = np.flatnonzero(_doubted(x_m, y_m, level_dbm))
    judge, taken, k = SpikeFilter[_Level](), -1, 0

    def levels(begin: int, end: int) -> list[_Level]:
        columns = (column[begin:end].tolist() for column in (x_m, y_m, level_dbm, limit))
        return [_Level(*row) for row in zip(range(begin, end), *columns, strict=True)]

    while len(doubted) and k < len(level_dbm):
        following = int(np.searchsorted(doubted, k))
        end = int(doubted[following]) if following < len(doubted) else len(level_dbm)
        if taken == k - 1 and 0 < k < end:
            changes_db = change_db[k - 1 : end - 1]
            changes_db = changes_db[np.isfinite(changes_db)][-_CHANGES:]
            judge.skip(levels(max(k, end - _SLOPE_SIDE), end), changes_db.tolist())
            taken, k = end - 1, end
            continue
        for one, above_db in judge.take(levels(k, k + 1)[0]):
            taken = taken if above_db else one.k
            if above_db:
                yield one.k, above_db
        k += 1
    yield from ((one.k, above_db) for one, above_db in judge.finish() if above_db)


def _doubted(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> BoolArray:
    """Levels that might be spikes, shape (n,): far from their forerunner, and not shared by two of
    the next three.
    """
    doubted = np.ones(len(level_dbm), np.bool_)
    doubted[1:] = np.abs(np.diff(level_dbm)) > _LEAST_ABOVE_DB
    inner = slice(0, max(len(level_dbm) - _SIDE, 0))
    above, below, far = (np.zeros(len(level_dbm[inner]), np.int64) for _ in range(3))
    for ahead in range(1, _SIDE + 1):
        other = slice(ahead, ahead + len(above))
        off_db = level_dbm[inner] - level_dbm[other]
        above += off_db > _LEAST_ABOVE_DB
        below += off_db < -_LEAST_ABOVE_DB
        far += np.hypot(x_m[inner] - x_m[other], y_m[inner] - y_m[other]) > _REACH_M
    doubted[inner] &= (2 * np.maximum(above, below) > _SIDE) | (far > 0)
    return doubted
