"""Walks in worlds that have what the model has not: effects, scores and their table."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing import Pool
from zlib import crc32

import numpy as np
from threadpoolctl import threadpool_limits

from logger.core.arrays import FloatArray

from . import tree, worlds
from .tables import Table
from .walks import STEP_M, TELLING
from .world import Noise, Place, Walk, World, observations

NOISES = {"white 3 dB": Noise(3.0, step_db=1.0), "two scales 7 dB": worlds.TWO_SCALE}
RUNS = 40
SEED = 51
STATED_SIGMA_M = 3.0
"""What the receiver states of its positions, right or wrong."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A walk past a transmitter, a reading a second, and random numbers for the effect."""

    walk: Walk
    source: Place
    rng: np.random.Generator

    @property
    def to_source_m(self) -> FloatArray:
        """From the receiver to the transmitter, shape (2, n)."""
        x_m, y_m = self.source
        return np.stack([x_m - self.walk.x_m, y_m - self.walk.y_m])

    @property
    def distance_m(self) -> FloatArray:
        """Horizontal distance, shape (n,)."""
        return np.hypot(*self.to_source_m)

    @property
    def heading(self) -> FloatArray:
        """Unit vectors of the way, shape (2, n)."""
        way = np.stack([np.gradient(self.walk.x_m), np.gradient(self.walk.y_m)])
        return way / np.hypot(*way)

    @property
    def ahead(self) -> FloatArray:
        """Cosine of the transmitter's bearing from the heading, shape (n,)."""
        return np.sum(self.heading * self.to_source_m, axis=0) / self.distance_m

    def with_levels(self, change_db: FloatArray) -> Walk:
        """The walk with changed levels, in whole dBm as modems give them."""
        return replace(self.walk, level_dbm=np.round(self.walk.level_dbm + change_db))

    def at(self, moved_m: FloatArray) -> Walk:
        """The walk with positions that are off by (2, n)."""
        return replace(self.walk, x_m=self.walk.x_m + moved_m[0], y_m=self.walk.y_m + moved_m[1])


def _second_slope(scene: Scene) -> Walk:
    """Beyond 60 to 150 m the levels fall faster, by 10 to 25 dB a decade."""
    beyond = np.maximum(scene.distance_m / scene.rng.uniform(60.0, 150.0), 1.0)
    return scene.with_levels(-scene.rng.uniform(10.0, 25.0) * np.log10(beyond))


def _absorption(scene: Scene) -> Walk:
    """Each metre of leaves or walls takes 0.02 to 0.1 dB."""
    return scene.with_levels(-scene.rng.uniform(0.02, 0.1) * scene.distance_m)


def _body(scene: Scene) -> Walk:
    """The walker's body behind a backpack takes up to 10 dB of what comes from ahead."""
    return scene.with_levels(-10.0 * np.maximum(scene.ahead, 0.0))


def _half_shaded(scene: Scene) -> Walk:
    """A house beside the transmitter takes 15 dB in half of all directions."""
    angle = scene.rng.uniform(0.0, 2.0 * np.pi)
    is_shaded = np.array([np.cos(angle), np.sin(angle)]) @ scene.to_source_m > 0.0
    return scene.with_levels(-15.0 * is_shaded)


def _rayleigh(scene: Scene) -> Walk:
    """Each level is a single sample of a Rayleigh channel."""
    return scene.with_levels(10.0 * np.log10(scene.rng.exponential(size=len(scene.walk))))


def _outliers(scene: Scene) -> Walk:
    """A tenth of the levels is off by 15 dB more."""
    off_db = 15.0 * scene.rng.normal(size=len(scene.walk))
    return scene.with_levels(np.where(scene.rng.random(len(off_db)) < 0.1, off_db, 0.0))


def _power_step(scene: Scene) -> Walk:
    """The operator changes the power by 8 dB in the middle of the walk."""
    count = len(scene.walk)
    is_after = np.arange(count) > scene.rng.uniform(0.3, 0.7) * count
    return scene.with_levels(scene.rng.choice([-8.0, 8.0]) * is_after)


def _drift(scene: Scene) -> Walk:
    """The receiver's gain drifts by 6 dB along the walk."""
    return scene.with_levels(np.linspace(0.0, scene.rng.choice([-6.0, 6.0]), len(scene.walk)))


def _slow_levels(scene: Scene) -> Walk:
    """The modem averages over 10 s, the longest of an idle phone (3GPP TS 45.008, 6.6.1)."""
    total_db = np.cumsum(scene.walk.level_dbm)
    count = np.minimum(np.arange(1, len(total_db) + 1), 10)
    slow_dbm = (total_db - np.concatenate([np.zeros(10), total_db[:-10]])) / count
    return scene.with_levels(slow_dbm - scene.walk.level_dbm)


def _late_fixes(scene: Scene) -> Walk:
    """Positions are five seconds old, at a step a second."""
    return scene.at(-5.0 * STEP_M * scene.heading)


def _optimistic_fixes(scene: Scene) -> Walk:
    """Positions are off by 15 m an axis for a minute each: five times what is stated."""
    kept = np.exp(-1.0 / 60.0)
    count = len(scene.walk)
    return scene.at(np.stack([15.0 * worlds.gauss_markov(scene.rng, count, kept) for _ in "xy"]))


EFFECTS: dict[str, Callable[[Scene], Walk]] = {
    "none": lambda scene: scene.walk,
    "second slope": _second_slope,
    "absorption": _absorption,
    "body in the way": _body,
    "half shaded": _half_shaded,
    "Rayleigh": _rayleigh,
    "outliers": _outliers,
    "power changed": _power_step,
    "gain drifts": _drift,
    "levels of 10 s": _slow_levels,
    "fixes 5 s late": _late_fixes,
    "fixes five times worse": _optimistic_fixes,
}
HEIGHTS_M = {"60 m up": 60.0, "100 m up": 100.0}
"""Higher than any height of the prior, passed at 15 to 80 m."""
KINDS = (*EFFECTS, *HEIGHTS_M)


@dataclass(frozen=True, slots=True)
class Job:
    """One walk; `run` counts those of an effect and a noise."""

    effect: str
    noise: str
    run: int

    @property
    def world(self) -> World:
        """The walk, by the numbers of the job alone."""
        key = [SEED, crc32(self.effect.encode()), crc32(self.noise.encode()), self.run]
        rng, noise = np.random.default_rng(key), NOISES[self.noise]
        if self.effect in HEIGHTS_M:
            return worlds.past_antenna(
                rng,
                noise,
                height_m=HEIGHTS_M[self.effect],
                pass_m=rng.uniform(15.0, 80.0),
                count=400,
            )
        world = worlds.plain(rng, TELLING[self.run % len(TELLING)], noise)
        walk = EFFECTS[self.effect](Scene(world.walk, world.sources[0], rng))
        return replace(world, walk=walk)


@dataclass(frozen=True, slots=True)
class Score:
    """What the locator states of one walk, and whether it is true."""

    job: Job
    is_covered: bool
    error_m: float
    r95_m: float
    verdict: str


def score(job: Job) -> Score:
    """Score of one walk."""
    with threadpool_limits(1):
        world = replace(job.world, position_sigma_m=STATED_SIGMA_M)
        obs = observations(world, world.walk)
        posterior = tree.locate(obs)
        return Score(
            job,
            is_covered=tree.region(posterior).holds(world.sources[0], 0.0),
            error_m=world.error_m((posterior.x_m, posterior.y_m)),
            r95_m=float(posterior.r95_m),
            verdict=tree.decide(posterior, obs)[0],
        )


def scores(wanted: Sequence[Job], processes: int) -> list[Score]:
    """Scores of several walks in their order."""
    with Pool(processes) as pool:
        return pool.map(score, wanted, chunksize=4)


def jobs(runs: int = RUNS, only: str | None = None) -> Iterator[Job]:
    """All walks, those of an effect one after another."""
    for effect in [only] if only else KINDS:
        for noise in NOISES:
            yield from (Job(effect, noise, run) for run in range(runs))


def tables(found: Sequence[Score]) -> list[Table | str]:
    """A line for each effect and noise."""
    by_line: dict[tuple[str, str], list[Score]] = {}
    for one in found:
        by_line.setdefault((one.job.effect, one.job.noise), []).append(one)
    headings = ("effect", "noise", "walks", "coverage", "error m", "r95 m", "located", "outside")
    lines = [(*name, *_line(some)) for name, some in by_line.items()]
    return [Table("what the model has not", headings, lines)]


def _line(some: Sequence[Score]) -> tuple[str, ...]:
    located = [one for one in some if one.verdict == "located"]
    return (
        str(len(some)),
        f"{np.mean([one.is_covered for one in some]):.3f}",
        f"{np.median([one.error_m for one in some]):.0f}",
        f"{np.median([one.r95_m for one in some]):.0f}",
        str(len(located)),
        str(sum(not one.is_covered for one in located)),
    )
