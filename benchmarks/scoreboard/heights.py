"""Walks below an antenna that is higher than assumed: scores, tables and what is wanted."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil
from multiprocessing import Pool
from zlib import crc32

import numpy as np
from threadpoolctl import threadpool_limits

from . import tree
from .tables import Table
from .world import Noise, World, observations
from .worlds import TWO_SCALE, past_antenna

HEIGHTS_M = (2.0, 5.0, 10.0, 20.0, 30.0)
PASSES_M = (5.0, 15.0, 25.0, 60.0)
"""Closest horizontal distance of the walk."""
NOISES = {"white 3 dB": Noise(3.0), "two scales 7 dB": TWO_SCALE}
COUNT = 400
"""Readings of a walk: 560 m of streets."""
RUNS = 60
SEED = 37

LEAST_COVERAGE, LEAST_IN_CELL, MOST_WRONG = 0.93, 0.85, 0.02
"""Wanted: of all walks of one height, distance or noise; of one cell (51 of 60); of *located*."""
LOW_M = (2.0, 5.0)
"""Heights at which a mixture of heights may lose what one fixed height of 5 m had."""


@dataclass(frozen=True, slots=True)
class HeightJob:
    """One walk; `run` counts the walks of a cell of the table."""

    noise: str
    height_m: float
    pass_m: float
    run: int

    @property
    def world(self) -> World:
        """The walk, by the numbers of the job alone."""
        key = [SEED, crc32(self.noise.encode()), int(self.height_m), int(self.pass_m), self.run]
        return past_antenna(
            np.random.default_rng(key),
            NOISES[self.noise],
            height_m=self.height_m,
            pass_m=self.pass_m,
            count=COUNT,
        )


@dataclass(frozen=True, slots=True)
class HeightScore:
    """What the locator states of one walk, and whether its 95 % region holds the antenna."""

    job: HeightJob
    is_covered: bool
    error_m: float
    r95_m: float
    area_m2: float
    verdict: str

    @property
    def is_located(self) -> bool:
        """Whether the verdict is *located*."""
        return self.verdict == "located"


def jobs(runs: int = RUNS) -> Iterator[HeightJob]:
    """All walks, those of a cell one after another."""
    for noise in NOISES:
        for height_m in HEIGHTS_M:
            for pass_m in PASSES_M:
                yield from (HeightJob(noise, height_m, pass_m, run) for run in range(runs))


def score(job: HeightJob) -> HeightScore:
    """Score of one walk, on one core."""
    with threadpool_limits(1):
        world = job.world
        obs = observations(world, world.walk)
        posterior = tree.locate(obs)
        region = tree.region(posterior)
        return HeightScore(
            job,
            is_covered=region.holds(world.sources[0], 0.0),
            error_m=world.error_m((posterior.x_m, posterior.y_m)),
            r95_m=float(posterior.r95_m),
            area_m2=region.area_m2,
            verdict=tree.decide(posterior, obs)[0],
        )


def scores(wanted: Sequence[HeightJob], processes: int) -> list[HeightScore]:
    """Scores of several walks in their order."""
    with Pool(processes) as pool:
        return pool.map(score, wanted, chunksize=4)


def tables(found: Sequence[HeightScore]) -> list[Table | str]:
    """Coverage of each cell, margins, and what is wanted."""
    return [_cells(found), _margins(found), _target_table(found), _legend(found)]


def _cells(found: Sequence[HeightScore]) -> Table:
    lines = []
    for noise in NOISES:
        for height_m in HEIGHTS_M:
            row = [one for one in found if (one.job.noise, one.job.height_m) == (noise, height_m)]
            by_pass = [[one for one in row if one.job.pass_m == pass_m] for pass_m in PASSES_M]
            lines.append((f"{noise}, {height_m:.0f} m", *map(_held_text, by_pass)))
    headings = ("noise, height", *(f"passed at {pass_m:.0f} m" for pass_m in PASSES_M))
    return Table("walks whose 95 % region holds the antenna", headings, lines)


def _held_text(some: Sequence[HeightScore]) -> str:
    return f"{sum(one.is_covered for one in some)} of {len(some)}"


def groups(found: Sequence[HeightScore]) -> Iterator[tuple[str, list[HeightScore]]]:
    """All walks, those of each noise, of each height and of each distance."""
    yield "all", list(found)
    for noise in NOISES:
        yield noise, [one for one in found if one.job.noise == noise]
    for height_m in HEIGHTS_M:
        yield f"height {height_m:.0f} m", [one for one in found if one.job.height_m == height_m]
    for pass_m in PASSES_M:
        yield f"passed at {pass_m:.0f} m", [one for one in found if one.job.pass_m == pass_m]


def _margins(found: Sequence[HeightScore]) -> Table:
    headings = ("walks", "coverage", "located", "outside", "error m", "r95 m", "area km2")
    lines = [(name, *_margin(some)) for name, some in groups(found) if some]
    return Table("walks by noise, height and distance; medians", headings, lines)


def _margin(some: Sequence[HeightScore]) -> tuple[str, ...]:
    located = [one for one in some if one.is_located]
    return (
        f"{coverage(some):.3f} of {len(some)}",
        str(len(located)),
        str(wrong(located)),
        f"{np.median([one.error_m for one in some]):.1f}",
        f"{np.median([one.r95_m for one in some]):.0f}",
        f"{np.median([one.area_m2 for one in some]) / 1e6:.3g}",
    )


def coverage(some: Sequence[HeightScore]) -> float:
    """Share of the walks whose 95 % region holds the antenna."""
    return float(np.mean([one.is_covered for one in some]))


def wrong(some: Sequence[HeightScore]) -> int:
    """Number of the walks whose 95 % region misses the antenna."""
    return sum(not one.is_covered for one in some)


def right_located(found: Sequence[HeightScore]) -> int:
    """How many walks below a low antenna are located by a region that holds it."""
    return sum(one.is_located and one.is_covered for one in found if one.job.height_m in LOW_M)


def _target_table(found: Sequence[HeightScore]) -> Table:
    margins = [(coverage(some), name) for name, some in groups(found) if some]
    by_cell: dict[tuple[str, float, float], list[HeightScore]] = {}
    for one in found:
        by_cell.setdefault((one.job.noise, one.job.height_m, one.job.pass_m), []).append(one)
    held = [(sum(one.is_covered for one in some), some) for some in by_cell.values()]
    fewest, cell = min(held, key=lambda each: each[0] / len(each[1]))
    least = ceil(LEAST_IN_CELL * len(cell))
    located = [one for one in found if one.is_located]
    share = wrong(located) / len(located) if located else 0.0
    worst, name = min(margins)
    at = cell[0].job
    where = f"{at.noise}, {at.height_m:.0f} m high, passed at {at.pass_m:.0f} m"
    low = " and ".join(f"{height_m:.0f}" for height_m in LOW_M)
    lines = [
        _line(f"lowest coverage of a margin ({name})", worst, LEAST_COVERAGE, low=True),
        _line(f"fewest held in a cell ({where})", fewest, least, low=True),
        _line("of located, share outside their region", share, MOST_WRONG, low=False),
        (f"located and right at {low} m", str(right_located(found)), "as many as before", ""),
    ]
    return Table("what is wanted", ("figure", "value", "limit", ""), lines)


def _line(what: str, value: float, limit: float, *, low: bool) -> tuple[str, str, str, str]:
    is_reached = value >= limit if low else value <= limit
    return (
        what,
        f"{value:.3g}",
        f"{'>=' if low else '<='} {limit:g}",
        "" if is_reached else "missed",
    )


def _legend(found: Sequence[HeightScore]) -> str:
    runs = 1 + max(one.job.run for one in found)
    return (
        f"Walks of {COUNT} readings along streets; P0 from -45 to -15 dBm, exponent from 2.3 to "
        f"3.9. Seed of a walk: {SEED}, CRC-32 of the noise's name, height, distance, run 0 to "
        f"{runs - 1}. Positions have no error."
    )
