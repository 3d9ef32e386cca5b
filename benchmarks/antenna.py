"""The sector antenna model against the omnidirectional one, on walks past antennas of both kinds.

python benchmarks/antenna.py [--runs N] [--measured N] [--seed S] [--jobs N]

Simulated sector antennas have the pattern of 3GPP TR 36.942, 4.2.1: a half-power beam width of 65
degrees, 25 dB front to back, and a random azimuth. The walks are those of the scoreboard, with
white noise of 3 dB or with shadowing of 6 dB over 15 m. On these, "known" is the sector model where
the kind of noise is known as well: what no estimator without that knowledge can expect to beat. The
measured walks are located as well, where they lie beside the repository.
"""

import argparse
import os
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import Pool
from typing import NamedTuple
from zlib import crc32

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # each process has one core

import numpy as np
from scoreboard import ours, traces, tree, worlds
from scoreboard.walks import TELLING
from scoreboard.world import Noise, World, observations

from logger.core.locator.pipeline import locate
from logger.core.model.prior import ANTENNAS, prior_for

NOISES = {"white 3 dB": Noise(3.0), "shadowing 6 dB / 15 m": Noise(0.0, 6.0, 15.0, step_db=1.0)}
MEASURED_CLASSES = "ABCDE"
KNOWN = "known"
KINDS = ("omni", "sector")
MODELS = (*KINDS, *(antenna for antenna in ANTENNAS if antenna not in KINDS))
"""That of omnidirectional antennas first: the others are compared with it."""


class Job(NamedTuple):
    """One walk: simulated past an antenna under some noise, or (`noise` is empty) measured."""

    antenna: str
    noise: str
    seed: int
    run: int


class Score(NamedTuple):
    """Error of the position, whether the 95 % region holds the truth, and its area."""

    error_m: float
    covered: bool
    area_m2: float


def world_of(job: Job) -> World:
    """The walk of a job."""
    if not job.noise:
        return traces.world_of(*traces.names(MEASURED_CLASSES)[job.run])
    rng = np.random.default_rng([job.seed, crc32(job.noise.encode()), job.run])
    world = worlds.plain(rng, TELLING[job.run % len(TELLING)], NOISES[job.noise])
    if job.antenna == "omni":
        return world
    return worlds.with_sector_antenna(rng, world)


def score(job: Job) -> tuple[Job, dict[str, Score]]:
    """Scores of the models."""
    world = world_of(job)
    obs = observations(world, world.walk)
    priors = {model: prior_for("any", antenna=model) for model in MODELS}
    if job.noise:
        known = ours.known_noise_prior(NOISES[job.noise])
        priors[KNOWN] = replace(known, stations=ours.SECTOR_PRIOR.stations)
    scores = {}
    for model, prior in priors.items():
        posterior = locate(obs, prior)
        region = tree.region(posterior)
        covered = region.holds(world.sources[0], world.slack_m)
        error_m = world.error_m((posterior.x_m, posterior.y_m))
        scores[model] = Score(error_m, covered, region.area_m2)
    return job, scores


def jobs(runs: int, most_measured: int, seed: int) -> Iterator[Job]:
    """All jobs, those of each kind one after another."""
    for run in range(runs):
        for antenna in KINDS:
            yield from (Job(antenna, noise, seed, run) for noise in NOISES)
    measured = min(len(traces.names(MEASURED_CLASSES)), most_measured)
    yield from (Job("measured", "", seed, run) for run in range(measured))


def row(name: str, scores: list[dict[str, Score]]) -> str:
    """One line: of each model median error, by that of the first, coverage and median area."""
    cells, first_m = [], None
    for model in scores[0]:
        error_m, covered, area_m2 = map(np.array, zip(*(one[model] for one in scores), strict=True))
        first_m = first_m or np.median(error_m)
        cells.append(
            f"{np.median(error_m):8.1f} {np.median(error_m) / first_m:5.2f} "
            f"{np.mean(covered):6.3f} {np.median(area_m2) ** 0.5:6.0f}"
        )
    return f"{name:36} {len(scores):5} {' '.join(cells)}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--measured", type=int, default=1000, help="at most so many of these")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    scores: dict[str, list[dict[str, Score]]] = {}
    with Pool(asked.jobs) as pool:
        for job, found in pool.imap(score, jobs(asked.runs, asked.measured, asked.seed)):
            name = f"{job.antenna} antenna, {job.noise}" if job.noise else "measured walks"
            scores.setdefault(name, []).append(found)
    models = [f"{model:>28}" for model in (*MODELS, KNOWN)]
    print(f"{'error m, by omni, coverage, sqrt area m':42}{' '.join(models)}")
    for name, of_walks in scores.items():
        print(row(name, of_walks))


if __name__ == "__main__":
    main()
