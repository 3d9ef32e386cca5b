"""Transmitters at street level among blocks of houses: the waves come along the streets.

Loss along a street as in free space up to the breakpoint and with the fourth power beyond; around a
corner 15 to 28 dB more within 30 m, then 60 dB a decade (the form of ITU-R P.1411, propagation
within street canyons). Through and over the houses 10 to 22 dB more than along a street, exponent
3.2 to 4. The stronger way counts. A transmitter on a roof has the second way only, with an exponent
of 2.6 to 3.6.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import Pool
from typing import NamedTuple
from zlib import crc32

import numpy as np
from threadpoolctl import threadpool_limits

from logger.core.arrays import BoolArray, FloatArray, IntArray

from . import tree
from .tables import Table
from .world import Walk, World, observations
from .worlds import gauss_markov

KINDS = ("street", "room", "roof", "far")
"""In the street; behind a front, 8 to 18 dB weaker; on a roof; in a street 120 to 400 m away."""
RUNS = 160
SEED = 78
FEWEST_READINGS = 20

_WAVELENGTHS_M = (0.333, 0.166)
_FREE_SPACE_DB = 20.0 * np.log10(4.0 * np.pi)
_WALKER_M = 1.5
_CORNER_M = 30.0
_CORNER_DB = (15.0, 28.0)
_DECADE_DB = 60.0
_NO_WAY_DB = 500.0
_FLOOR_DBM, _CEILING_DBM = -110.0, -47.0
_POSITION_M = 1.5
_SPEED_MPS = 1.3
_NEAR_M, _FAR_M = (0.0, 120.0), (120.0, 400.0)
_ORIGIN_M = np.array([500_000.0, 5_400_000.0])


class _Streets(NamedTuple):
    """A grid of streets of one width, with blocks of this size, both in m."""

    block_m: FloatArray
    width_m: float


class _Source(NamedTuple):
    """A transmitter in the street number `line` along `axis` (0: east)."""

    place_m: FloatArray
    axis: int
    line: int


@dataclass(frozen=True, slots=True)
class StreetJob:
    """One walk; `run` counts the walks of a kind."""

    kind: str
    run: int

    @property
    def world(self) -> World:
        """The walk, by the numbers of the job alone."""
        return _world(np.random.default_rng([SEED, self.run, crc32(self.kind.encode())]), self.kind)


@dataclass(frozen=True, slots=True)
class StreetScore:
    """What the locator states of one walk, and whether its 95 % region holds the transmitter."""

    job: StreetJob
    is_covered: bool
    error_m: float
    strongest_m: float
    r95_m: float
    verdict: str


def jobs(runs: int = RUNS) -> Iterator[StreetJob]:
    """All walks, those of a kind one after another."""
    for kind in KINDS:
        yield from (StreetJob(kind, run) for run in range(runs))


def score(job: StreetJob) -> StreetScore | None:
    """Score of one walk, on one core; None where too few readings are above the floor."""
    with threadpool_limits(1):
        world = job.world
        if len(world.walk) < FEWEST_READINGS:
            return None
        obs = observations(world, world.walk)
        posterior = tree.locate(obs)
        best = int(np.argmax(world.walk.level_dbm))
        strongest = float(world.walk.x_m[best]), float(world.walk.y_m[best])
        return StreetScore(
            job,
            is_covered=tree.region(posterior).holds(world.sources[0], 10.0),
            error_m=world.error_m((posterior.x_m, posterior.y_m)),
            strongest_m=world.error_m(strongest),
            r95_m=float(posterior.r95_m),
            verdict=tree.decide(posterior, obs)[0],
        )


def scores(wanted: Sequence[StreetJob], processes: int) -> list[StreetScore]:
    """Scores of several walks in their order."""
    with Pool(processes) as pool:
        return [one for one in pool.map(score, wanted, chunksize=4) if one]


def tables(found: Sequence[StreetScore]) -> list[Table | str]:
    """Coverage, *located* and errors of each kind."""
    headings = ("kind", "coverage", "located", "wrong", "error m", "strongest m", "r95 m")
    by_kind = [[one for one in found if one.job.kind == kind] for kind in KINDS]
    lines = [_line(some) for some in by_kind if some]
    return [Table("transmitters among houses; medians", headings, lines), __doc__ or ""]


def _line(some: Sequence[StreetScore]) -> tuple[str, ...]:
    located = [one for one in some if one.verdict == "located"]
    return (
        some[0].job.kind,
        f"{np.mean([one.is_covered for one in some]):.3f} of {len(some)}",
        str(len(located)),
        str(sum(not one.is_covered for one in located)),
        f"{np.median([one.error_m for one in some]):.0f}",
        f"{np.median([one.strongest_m for one in some]):.0f}",
        f"{np.median([one.r95_m for one in some]):.0f}",
    )


def _world(rng: np.random.Generator, kind: str) -> World:
    streets = _Streets(rng.uniform(60.0, 140.0, 2), float(rng.uniform(12.0, 24.0)))
    spacing_m = float(rng.uniform(1.2, 1.5) * rng.choice([1, 2, 4]))
    points = _walk(rng, streets, spacing_m)
    source = _place(rng, streets, points, _FAR_M if kind == "far" else _NEAR_M)
    level_dbm = _level_dbm(rng, streets, points, source, kind)
    heard = level_dbm >= _FLOOR_DBM
    errors_m = _POSITION_M * rng.normal(size=(np.count_nonzero(heard), 2))
    walk = Walk(*(points[heard] + errors_m + _ORIGIN_M).T, level_dbm[heard])
    x_m, y_m = (source.place_m + _ORIGIN_M).tolist()
    return World(
        walk,
        walk,
        ((x_m, y_m),),
        position_sigma_m=_POSITION_M,
        floor_dbm=_FLOOR_DBM,
        t_s=np.arange(len(walk)) * spacing_m / _SPEED_MPS,
    )


def _walk(rng: np.random.Generator, streets: _Streets, spacing_m: float) -> FloatArray:
    """Points (n, 2) along one side of the streets; straight on is as likely as either turn."""
    longest_m, at, corners = rng.uniform(600.0, 1800.0), np.zeros(2), [np.zeros(2)]
    directions, last, walked_m = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)]), None, 0.0
    while walked_m < longest_m:
        ways = [one for one in directions if last is None or np.any(one != -last)]
        weight = np.array(
            [3.0 if last is not None and np.all(one == last) else 1.0 for one in ways]
        )
        last = ways[rng.choice(len(ways), p=weight / np.sum(weight))]
        at = at + last * streets.block_m
        corners.append(at)
        walked_m += float(np.sum(np.abs(last * streets.block_m)))
    corner = np.array(corners)
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corner, axis=0).T))])
    reached_m = np.arange(0.0, along_m[-1], spacing_m)
    k = np.clip(np.searchsorted(along_m, reached_m, side="right") - 1, 0, len(corner) - 2)
    part = (reached_m - along_m[k]) / (along_m[k + 1] - along_m[k])
    leg = corner[k + 1] - corner[k]
    beside_m = rng.choice([-1.0, 1.0]) * 0.35 * streets.width_m
    beside = np.where(leg[:, :1] != 0.0, [0.0, beside_m], [beside_m, 0.0])
    return np.asarray(corner[k] + leg * part[:, None] + beside, float)


def _place(
    rng: np.random.Generator, streets: _Streets, points: FloatArray, away_m: tuple[float, float]
) -> _Source:
    """At the side of a street, with the walk's closest point at this distance."""
    while True:
        bearing, radius_m = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 1.25 * away_m[1])
        start = points[rng.integers(len(points))]
        place = start + radius_m * np.array([np.cos(bearing), np.sin(bearing)])
        axis = int(rng.integers(2))
        across = 1 - axis
        line = round(place[across] / streets.block_m[across])
        side_m = rng.choice([-1.0, 1.0]) * streets.width_m * rng.uniform(0.2, 0.45)
        place[across] = line * streets.block_m[across] + side_m
        closest_m = float(np.min(np.hypot(*(points - place).T)))
        if away_m[0] <= closest_m < away_m[1]:
            return _Source(place, axis, line)


def _level_dbm(
    rng: np.random.Generator,
    streets: _Streets,
    points: FloatArray,
    source: _Source,
    kind: str,
) -> FloatArray:
    """Whole dBm: radiated power less the lesser loss, shadowing, fading, the walker's body."""
    wave_m = float(rng.choice(_WAVELENGTHS_M))
    distance_m = np.hypot(np.hypot(*(points - source.place_m).T), 1.0)
    free_db = _FREE_SPACE_DB - 20.0 * np.log10(wave_m)
    if kind == "roof":
        slant_m = np.hypot(distance_m, rng.uniform(15.0, 30.0))
        loss_db = free_db + rng.uniform(2.6, 3.6) * 10.0 * np.log10(slant_m)
        loss_db += rng.uniform(0.0, 15.0)
    else:
        through_db = free_db + rng.uniform(3.2, 4.0) * 10.0 * np.log10(distance_m)
        through_db += rng.uniform(10.0, 22.0)
        along_db = _along_streets_db(streets, points, source, wave_m, rng.uniform(*_CORNER_DB))
        loss_db = -10.0 * np.log10(10.0 ** (-along_db / 10.0) + 10.0 ** (-through_db / 10.0))
    level_dbm = rng.uniform(17.0, 37.0) - loss_db
    if kind == "room":
        level_dbm -= rng.uniform(8.0, 18.0)
    level_dbm += _shadowing_db(rng, points) + rng.uniform(1.5, 3.0) * rng.normal(size=len(points))
    if rng.random() < 0.5:
        step, toward = np.gradient(points, axis=0), source.place_m - points
        turned = np.arctan2(toward[:, 1], toward[:, 0]) - np.arctan2(step[:, 1], step[:, 0])
        level_dbm -= rng.uniform(2.0, 8.0) * (1.0 - np.cos(turned)) / 2.0
    return np.asarray(np.minimum(np.round(level_dbm), _CEILING_DBM), float)


def _shadowing_db(rng: np.random.Generator, points: FloatArray) -> FloatArray:
    """Exponentially correlated along the way, 2 to 4 dB over 8 to 25 m."""
    sigma_db, over_m = rng.uniform(2.0, 4.0), rng.uniform(8.0, 25.0)
    memory = np.exp(-np.hypot(*np.diff(points, axis=0).T) / over_m)
    return np.asarray(sigma_db * gauss_markov(rng, len(points), memory), float)


def _along_streets_db(
    streets: _Streets, points: FloatArray, source: _Source, wave_m: float, corner_db: float
) -> FloatArray:
    """Loss (n,) by line of sight, around one corner or around two, whichever way is open."""
    axis, across = source.axis, 1 - source.axis
    half_m = 0.5 * streets.width_m
    from_axis_m = np.abs(points[:, across] - source.line * streets.block_m[across])
    along_m = np.abs(points[:, axis] - source.place_m[axis])
    direct_m = np.hypot(np.hypot(*(points - source.place_m).T), 1.0)
    is_seen = from_axis_m <= half_m + 1.0
    loss_db = np.where(is_seen, _street_db(direct_m, wave_m), _NO_WAY_DB)

    crossing, in_cross_street = _nearest_line(streets, points, axis)
    to_crossing_m = np.maximum(np.abs(crossing * streets.block_m[axis] - source.place_m[axis]), 1.0)
    way_m = np.maximum(to_crossing_m + from_axis_m, 1.0)
    one_db = _street_db(way_m, wave_m) + _corner_db(from_axis_m - half_m, corner_db)
    beyond = way_m / (to_crossing_m + half_m + _CORNER_M)
    one_db += _DECADE_DB * np.log10(np.maximum(beyond, 1.0))
    at_crossing = to_crossing_m < half_m  # the transmitter sees into this street
    one_db = np.where(at_crossing, _street_db(direct_m, wave_m), one_db)
    loss_db = np.where(in_cross_street & ~is_seen, np.minimum(loss_db, one_db), loss_db)

    _, in_parallel = _nearest_line(streets, points, across)
    farthest = round(float(np.max(along_m)) / streets.block_m[axis]) + 2
    nearest = round(source.place_m[axis] / streets.block_m[axis])
    two_db = np.full(len(points), _NO_WAY_DB)
    for number in range(nearest - farthest, nearest + farthest + 1):
        at_m = number * streets.block_m[axis]
        out_m, back_m = abs(at_m - source.place_m[axis]), np.abs(points[:, axis] - at_m)
        way_m = np.maximum(out_m + from_axis_m + back_m, 1.0)
        by_this_db = _street_db(way_m, wave_m) + _corner_db(back_m - half_m, corner_db)
        two_db = np.minimum(two_db, by_this_db + (corner_db if out_m > half_m else 0.0))
    return np.where(in_parallel & ~is_seen, np.minimum(loss_db, two_db), loss_db)


def _nearest_line(streets: _Streets, points: FloatArray, axis: int) -> tuple[IntArray, BoolArray]:
    """Number of the nearest street across an axis, and which points are in it; shape (n,)."""
    number = np.round(points[:, axis] / streets.block_m[axis])
    off_m = np.abs(points[:, axis] - number * streets.block_m[axis])
    return number.astype(np.int64), off_m <= 0.5 * streets.width_m + 1.0


def _street_db(way_m: FloatArray, wave_m: float) -> FloatArray:
    breakpoint_m = 4.0 * _WALKER_M**2 / wave_m
    beyond_db = 20.0 * np.log10(np.maximum(way_m / breakpoint_m, 1.0))
    return np.asarray(_FREE_SPACE_DB + 20.0 * np.log10(way_m / wave_m) + beyond_db, float)


def _corner_db(past_m: FloatArray, corner_db: float) -> FloatArray:
    """Loss of a corner `past_m` behind it, in full from 30 m on."""
    part = np.log10(np.maximum(past_m, 1.0)) / np.log10(1.0 + _CORNER_M)
    return np.asarray(corner_db * np.minimum(part, 1.0), float)
