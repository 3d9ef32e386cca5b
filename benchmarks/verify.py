"""False alarms and power of the tests of claimed positions, and speed of the cell database.

python benchmarks/verify.py [alarms|power|measured|database ...] [--minutes M] [--walks N]
                            [--rows N] [--within-walk M] [--json FILE]

alarms    false-alarm rate of the test on simulated walks past the claimed place
power     share of displaced claims rejected, beside what each walk's own test predicts
measured  measured walks: claims at the surveyed position and displaced, beside the rules of
          CellGuard and Crocodile Hunter
database  import of an export, beside pandas where that is installed, and lookups
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import binom
from scoreboard import traces
from scoreboard.cell_database import database
from scoreboard.world import Noise, World, observations
from scoreboard.worlds import plain

from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings
from postproc.area_file import area_of
from postproc.smoothing import too_few
from postproc.verification.run_claims import ClaimTest

SHAPES = ("L", "square", "random")
NOISES = {"white 3 dB": Noise(3.0), "6 dB over 15 m + 1 dB": Noise(1.0, 6.0, 15.0, step_db=1.0)}
RATES = (0.05, 0.01)
DISPLACED = (0.5, 1.0, 2.0, 5.0)
FALSE_OF_OLD = 0.037
"""Surveyed places that the test before the posterior's own rejected, of 506 walks; of those
displaced by five times the distance it rejected 26 %."""
LEAST_M = 10.0
"""Of the distance to the walk: the errors of survey and receiver."""
PRIOR = Prior()

CELLGUARD_M = 75_000.0
"""CellGuard calls a cell suspicious that is farther than this from where its database has it."""

Json = dict[str, object]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the chosen parts and print their figures."""
    options = _parser().parse_args(arguments)
    parts: dict[str, Callable[[argparse.Namespace], Json]] = {
        "alarms": alarms,
        "power": powers,
        "measured": measured_walks,
        "database": database,
    }
    figures = {name: parts[name](options) for name in options.part or parts}
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "part", nargs="*", metavar="PART", help="alarms, power, measured, database (default: all)"
    )
    parser.add_argument(
        "--minutes", type=float, default=10.0, metavar="M", help="of each part but the last"
    )
    parser.add_argument(
        "--walks", type=int, default=2000, metavar="N", help="simulated walks of each noise"
    )
    parser.add_argument(
        "--rows", type=int, default=5_000_000, metavar="N", help="of the export imported"
    )
    parser.add_argument(
        "--more", type=int, default=1, metavar="N", help="how often, for lookups in a larger file"
    )
    parser.add_argument(
        "--within-walk", type=float, metavar="M", help="of the hull of measured walks"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--json", type=Path, metavar="FILE")
    return parser


def interval99(n: int, rate: float) -> tuple[float, float]:
    """Shares of n trials between which 99 % of the outcomes at this rate lie."""
    low, high = binom.interval(0.99, n, rate)
    return float(low) / n, float(high) / n


def _within(seconds: float, most: int) -> Iterator[int]:
    end = time.monotonic() + seconds
    for k in range(most):
        if time.monotonic() > end:
            return
        yield k


def _walk(rng: np.random.Generator, k: int, noise: Noise) -> tuple[World, Readings, Posterior]:
    world = plain(rng, SHAPES[k % len(SHAPES)], noise)
    obs = observations(world, world.walk).usable()
    return world, obs, locate(obs, PRIOR)


def _test(posterior: Posterior, sigma_m: float = 0.0) -> ClaimTest:
    return ClaimTest.of(posterior, sigma_m)


def alarms(options: argparse.Namespace) -> Json:
    """False-alarm rates, nuisances unknown."""
    figures: Json = {}
    for name, noise in NOISES.items():
        p = []
        for k in _within(60.0 * options.minutes / len(NOISES), options.walks):
            rng = np.random.default_rng([options.seed, k])
            world, _, posterior = _walk(rng, k, noise)
            p.append(_test(posterior).p(Places.of(*world.sources[0])))
        shares = {rate: float(np.mean(np.array(p) <= rate)) for rate in RATES}
        figures[name] = {
            "walks": len(p),
            "rejected": {str(rate): share for rate, share in shares.items()},
        }
        for rate, share in shares.items():
            low, high = interval99(len(p), rate)
            print(
                f"alarms    {name}: {len(p)} walks at {rate}: {share:.4f} "
                f"(99 % of exact tests within {low:.4f} to {high:.4f})"
            )
    return figures


def powers(options: argparse.Namespace) -> Json:
    """Measured and predicted power, by displacement."""
    figures: Json = {}
    for name, noise in NOISES.items():
        rows = []
        for k in _within(60.0 * options.minutes / len(NOISES), options.walks):
            rng = np.random.default_rng([options.seed + 1, k])
            world, obs, posterior = _walk(rng, k, noise)
            share = DISPLACED[(k // len(SHAPES)) % len(DISPLACED)]
            p, predicted = _p_and_power(obs, posterior, world, share, 0.0, rng)
            rows.append((share, p <= RATES[0], predicted))
        table = np.array(rows)
        for displaced in (*DISPLACED, None):
            chosen = table if displaced is None else table[table[:, 0] == displaced]
            mean = np.mean(chosen[:, 1:], axis=0).tolist()
            figures[f"{name}, {displaced or 'all'}"] = [len(chosen), *mean]
            print(
                f"power     {name}, {displaced or 'all'} x distance, {len(chosen)} walks: "
                f"{mean[0]:.3f} (predicted {mean[1]:.3f}); "
                f"+- {0.5 / len(chosen) ** 0.5:.3f}"
            )
    return figures


def _p_and_power(
    obs: Readings,
    posterior: Posterior,
    world: World,
    share: float,
    sigma_m: float,
    rng: np.random.Generator,
) -> tuple[float, float]:
    """The p of a claim displaced by this share of the distance; how often one is rejected."""
    true = Places.of(*world.sources[0])
    off_m = share * max(float(np.min(obs.places.distances_m(true))), LEAST_M)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    claim = true.xy_m[:, 0] + off_m * np.array([np.cos(angle), np.sin(angle)])
    test = _test(posterior, sigma_m)
    power = float(np.mean(test.power(np.array([off_m]), RATES[0])))
    return test.p(Places.of(*claim)), power


def measured_walks(options: argparse.Namespace) -> Json:
    """Measured walks with a surveyed transmitter."""
    rng = np.random.default_rng(options.seed)
    names = list(traces.names("ABCDE"))
    rng.shuffle(names)  # if time runs out, the walks done are a random sample
    prior = replace(PRIOR, area=area_of(options.within_walk, None))
    rows: dict[float, list[tuple[float, ...]]] = {0.0: [], **{share: [] for share in DISPLACED}}
    for k in _within(60.0 * options.minutes, len(names)):
        world = traces.world_of(*names[k])
        obs = observations(world, world.walk)
        if too_few(obs, obs.usable()):
            continue
        posterior = locate(obs.usable(), prior)
        sigma_m = float(np.hypot(world.slack_m / 2.0, np.median(world.position_sigma_m)))
        true = Places.of(*world.sources[0])
        p = _test(posterior, sigma_m).p(true)
        rules = cellguard(obs, true), crocodile_hunter(obs, true)
        rows[0.0].append((p, *rules))
        for share in DISPLACED:
            case = obs.usable(), posterior, world, share, sigma_m
            rows[share].append(_p_and_power(*case, rng))
    result: Json = {}
    tables = {share: np.array(outcomes, float) for share, outcomes in rows.items() if outcomes}
    # the largest p that rejects no more of the surveyed places than the old test did
    of_old = float(np.quantile(tables[0.0][:, 0], FALSE_OF_OLD, method="lower")) if tables else 0.0
    for share, table in tables.items():
        rejected = [float(np.mean(table[:, 0] <= p)) for p in (*RATES, of_old)]
        more = np.mean(table[:, 1:], axis=0).tolist()
        result[str(share)] = {"walks": len(table), "rejected": rejected, "more": more}
        what = (
            f"predicted {more[0]:.3f}"
            if share
            else f"CellGuard {more[0]:.3f}, Crocodile Hunter {more[1]:.3f}"
        )
        print(
            f"measured  displaced by {share:g} x distance, {len(table)} walks, "
            f"at {RATES[0]}: {rejected[0]:.3f}, at {RATES[1]}: {rejected[1]:.3f}, "
            f"at {of_old:.3f}: {rejected[2]:.3f}; {what}"
        )
    if not names:
        print("measured  skipped: the measured walks are not beside this repository")
    return result


def cellguard(obs: Readings, claim: Places) -> bool:
    """True for a cell received farther away than 75 km.

    Its margins for accuracy and speed are left out, since a walker is slow.
    """
    return bool(np.max(obs.places.distances_m(claim)) > CELLGUARD_M)


def crocodile_hunter(obs: Readings, claim: Places) -> bool:
    """Outside the box of one standard deviation about the mean of all sightings."""
    off_m = claim.xy_m[:, 0] - np.mean(obs.places.xy_m, axis=1)
    return bool(np.any(np.abs(off_m) > np.std(obs.places.xy_m, axis=1)))


if __name__ == "__main__":
    sys.exit(main())
