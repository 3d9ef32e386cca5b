"""Readings gathered into blocks, each taken at about one point."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.places import PLANE, Places, Utm
from logger.core.readings import Readings

FINEST_BLOCK_M = 2.0
READINGS_BELIEVED = 16
_MOST_POINTS = 1000
_POINTS_EACH = 4
"""Supporting points for each block that is allowed: L changes little within a quarter of one."""
_MOST_CENSORED = 100
_COARSER = 1.25
_WIDE = 64
"""Keys of a span up to this many times their number are counted in a table, others by sorting."""
_SAMPLED = 8  # points for each square that is allowed


Origin = tuple[float, float]
"""Where the grid of the blocks begins, in parts of the side of a block."""
NO_SHIFT: Origin = (0.0, 0.0)


class Censored(NamedTuple):
    """Places where the level was at a censoring limit of the modem's scale, shape (g,) each.

    The level is at most `limit_dbm` where `side` is -1, at least that where it is +1; `readings` is
    how many were taken there.
    """

    places: Places
    limit_dbm: FloatArray
    side: FloatArray
    readings: FloatArray


NOTHING_CENSORED = Censored(Places.of([], []), *np.zeros((3, 0)))


@dataclass(frozen=True, slots=True)
class Blocks:
    """The walk in blocks of readings taken at about one point.

    `points` and `weight` are supporting points, shape (m,), each as certain as its block; block k
    has those from `first[k]` on, weights sum to 1. `places, level_dbm, readings, modem` have shape
    (n,); `size_m` is the side of a block. A block has readings of one modem only, numbered from 0.
    """

    points: Places
    weight: FloatArray
    first: IntArray
    places: Places
    level_dbm: FloatArray
    readings: FloatArray
    size_m: float
    censored: Censored
    modem: IntArray

    def __len__(self) -> int:
        return len(self.level_dbm)

    @property
    def of_one_point(self) -> bool:
        """Whether each block has one supporting point only."""
        return len(self.first) == len(self.weight)

    @property
    def rows(self) -> FloatArray:
        """Rows as `single` takes them, shape (5, n)."""
        at = self.places
        return np.stack([at.x_m, at.y_m, self.level_dbm, at.sigma_m**2, self.readings])

    def mean(self, of_points: FloatArray) -> FloatArray:
        """Weighted means over the points of each block, (n, k), of rows (m, k)."""
        if self.of_one_point:
            return of_points
        means = np.empty((len(self), of_points.shape[1]))
        ends = [*self.first[1:].tolist(), len(self.weight)]
        for k, (first, end) in enumerate(zip(self.first.tolist(), ends, strict=True)):
            np.matmul(self.weight[first:end], of_points[first:end], out=means[k])
        return means

    def part(self, chosen: BoolArray) -> "Blocks":
        """The chosen blocks (n,), with their middles as only points, without censored ones."""
        plain = single(self.rows[:, chosen], self.size_m, NOTHING_CENSORED, self.places.utm)
        return replace(plain, modem=self.modem[chosen])


def single(column: FloatArray, size_m: float, gone: Censored, utm: Utm = PLANE) -> Blocks:
    """Blocks of one point each; rows (5, n) are x, y, level, position variance and readings."""
    x_m, y_m, level_dbm, variance_m2, readings = column
    count = len(x_m)
    places = Places.of(x_m, y_m, utm=utm, sigma_m=np.sqrt(variance_m2))
    return Blocks(
        points=places,
        weight=np.ones(count),
        first=np.arange(count),
        places=places,
        level_dbm=level_dbm,
        readings=readings,
        size_m=size_m,
        censored=gone,
        modem=np.zeros(count, np.int64),
    )


def join(parts: Sequence[Blocks]) -> Blocks:
    """Blocks of several parts of a walk, with their middles as only points, uncensored."""
    every = [part.part(np.ones(len(part), np.bool_)) for part in parts]
    columns = np.concatenate([one.rows for one in every], axis=1)
    size_m = max(part.size_m for part in parts)
    return single(columns, size_m, NOTHING_CENSORED, parts[0].places.utm)


def blocks(obs: Readings, most: int, origin: Origin = NO_SHIFT) -> Blocks:
    """Gather the readings of one point and modem, whenever taken, into at most `most` blocks.

    Standing still or walking a street twice adds no block; a level repeated there adds nothing.
    `origin` moves the grid of the blocks.
    """
    inside = obs.limit == 0
    at, level = obs.places.part(inside), obs.level_dbm[inside]
    modem = obs.modem_numbers[inside]
    fine = squares(at, min(_POINTS_EACH * most, _MOST_POINTS), modem, origin=origin)[0]
    count = np.bincount(fine).astype(float)
    mean = [np.bincount(fine, v) / count for v in (at.x_m, at.y_m, level, at.sigma_m**2)]
    count = np.maximum(np.bincount(fine, _is_new(level, modem, fine)), 1.0)
    of_point = np.zeros(len(count), np.int64)
    of_point[fine] = modem
    gone = censored_places(obs, min(most // 2, _MOST_CENSORED))
    return gather(np.stack([*mean, count]), most, gone, of_point, origin, obs.places.utm)


def gather(
    points: FloatArray,
    most: int,
    censored: Censored,
    modem: IntArray | None = None,
    origin: Origin = NO_SHIFT,
    utm: Utm = PLANE,
) -> Blocks:
    """Blocks of supporting points (5, m), each the mean of some readings; rows as in `single`.

    `modem` (m,) is None where there is only one.
    """
    x_m, y_m, level_dbm, variance_m2, count = points
    modem = np.zeros(len(x_m), np.int64) if modem is None else modem
    coarse, size_m = squares(Places.of(x_m, y_m), most, modem, origin=origin)
    order = np.argsort(coarse, kind="stable")
    coarse, count = coarse[order], count[order]
    x, y, level, variance = (v[order] for v in (x_m, y_m, level_dbm, variance_m2))
    total = np.asarray(np.bincount(coarse, count), float)
    weight = count / total[coarse]
    bx, by, bl, bv = (
        np.asarray(np.bincount(coarse, weight * v), float) for v in (x, y, level, variance)
    )
    first, sigma_m = np.searchsorted(coarse, np.arange(len(total))), np.sqrt(bv)
    points_of = Places.of(x, y, utm=utm, sigma_m=sigma_m[coarse])
    places = Places.of(bx, by, utm=utm, sigma_m=sigma_m)
    return Blocks(
        points_of, weight, first, places, bl, total, size_m, censored, modem[order][first]
    )


def _is_new(level_dbm: FloatArray, modem: IntArray, square: IntArray) -> BoolArray:
    """Which levels differ from the one that their modem gave before in the same square.

    A repeated level tells no more: what modems filter or keep changes more slowly.
    """
    order = np.argsort(modem, kind="stable")
    is_same = np.zeros(len(order), np.bool_)
    is_same[1:] = np.diff(level_dbm[order]) == 0.0
    is_same[1:] &= (np.diff(modem[order]) == 0) & (np.diff(square[order]) == 0)
    is_new = np.empty(len(order), np.bool_)
    is_new[order] = ~is_same
    return is_new


def censored_places(obs: Readings, most: int = _MOST_CENSORED) -> Censored:
    """Censored readings, those of one point together, in at most `most` points for each limit.

    A point may have both limits.
    """
    at = np.flatnonzero(obs.limit)
    side, one = obs.limit[at].astype(float), np.ones(len(at))
    each = Censored(obs.places.part(at), obs.level_dbm[at], side, one)
    return in_fewer_places(each, most, obs.modem_numbers[at])


def in_fewer_places(gone: Censored, most: int, modem: IntArray | None = None) -> Censored:
    """At most `most` points for each limit, of one modem each (g,; None: one modem)."""
    places = gone.places
    modem = np.zeros(len(places), np.int64) if modem is None else modem
    parts = []
    for side in (-1.0, 1.0):
        at = np.flatnonzero(gone.side == side)
        square, _ = squares(places.part(at), most, modem[at])
        readings = gone.readings[at]
        total = np.bincount(square, readings).astype(float)
        columns = (places.x_m, places.y_m, gone.limit_dbm, places.sigma_m**2)
        x, y, limit, variance = (np.bincount(square, readings * v[at]) / total for v in columns)
        parts.append((x, y, limit, np.full(len(total), side), total, np.sqrt(variance)))
    x, y, limit, sides, total, sigma_m = (np.concatenate(v) for v in zip(*parts, strict=True))
    return Censored(Places.of(x, y, utm=places.utm, sigma_m=sigma_m), limit, sides, total)


def squares(
    places: Places,
    most: int,
    modem: IntArray | int = 0,
    *,
    finest_m: float = FINEST_BLOCK_M,
    origin: Origin = NO_SHIFT,
) -> tuple[IntArray, float]:
    """Number of the square of its modem each place lies in, and the side of the squares.

    The squares are as small as `most` of them allow, `finest_m` at least. Of more modems each has
    one.
    """
    if not len(places):
        return np.zeros(0, np.int64), finest_m
    x_m, y_m = places.x_m, places.y_m
    modem = np.broadcast_to(np.asarray(modem, np.int64), x_m.shape)
    most = max(most, _count_different(modem))
    points = np.stack([x_m - np.mean(x_m), y_m - np.mean(y_m)])
    size_m, stride = finest_m, len(x_m) // (_SAMPLED * most)
    if stride > 1:  # where some of the points are in too many squares, all are
        some, of_some = points[:, ::stride], modem[::stride]
        while _count_different(_keys(some, size_m, of_some, origin)) > most:
            size_m *= _COARSER
    while _count_different(key := _keys(points, size_m, modem, origin)) > most:
        size_m *= _COARSER
    return _number(key), size_m


def _keys(points: FloatArray, size_m: float, modem: IntArray, origin: Origin) -> IntArray:
    """A number for each point (2, n), equal in one square of one modem, not negative."""
    shift = 0.5 + np.array(origin)[:, None]
    column, row = np.floor(points / size_m + shift).astype(np.int64)
    row += modem * (int(np.ptp(row)) + 1)
    return np.asarray(
        (row - row.min()) * (int(np.ptp(column)) + 1) + column - column.min(), np.int64
    )


def _count_different(key: IntArray) -> int:
    if _is_sparse(key):
        return len(np.unique(key))
    return int(np.count_nonzero(_presence(key)))


def _number(key: IntArray) -> IntArray:
    if _is_sparse(key):
        return np.unique(key, return_inverse=True)[1].astype(np.int64)
    return np.asarray((np.cumsum(_presence(key)) - 1)[key], np.int64)


def _is_sparse(key: IntArray) -> bool:
    return bool(key.max() >= _WIDE * len(key))


def _presence(key: IntArray) -> BoolArray:
    is_key = np.zeros(int(key.max()) + 1, np.bool_)
    is_key[key] = True
    return is_key
