"""False alarms and power of the tests of claimed positions, and speed of the cell database.

python benchmarks/verify.py [alarms|power|measured|database ...] [--minutes M] [--walks N]
                            [--rows N] [--json FILE]

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
from pathlib import Path

import numpy as np
from scipy.stats import binom
from scoreboard import traces
from scoreboard.cell_database import database
from scoreboard.world import Noise, World, observations
from scoreboard.worlds import plain

from logger.core.arrays import FloatArray
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings
from postproc.cell_estimation import too_few
from postproc.verification.claim_test import PreparedWalk, around, claim_test, prepare_walk
from postproc.verification.run_claims import blocks_of

SHAPES = ("L", "square", "random")
NOISES = {"white 3 dB": Noise(3.0), "6 dB over 15 m + 1 dB": Noise(1.0, 6.0, 15.0, step_db=1.0)}
RATES = (0.05, 0.01)
DISPLACED = (0.5, 1.0, 2.0, 5.0)
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


def _walk(rng: np.random.Generator, k: int, noise: Noise) -> tuple[World, PreparedWalk]:
    world = plain(rng, SHAPES[k % len(SHAPES)], noise)
    return world, prepare_walk(blocks_of(observations(world, world.walk)), PRIOR)


def alarms(options: argparse.Namespace) -> Json:
    """False-alarm rates, nuisances unknown."""
    figures: Json = {}
    for name, noise in NOISES.items():
        p = []
        for k in _within(60.0 * options.minutes / len(NOISES), options.walks):
            rng = np.random.default_rng([options.seed, k])
            world, walk = _walk(rng, k, noise)
            test = claim_test(walk, np.array(world.sources[0])[:, None], rng)
            p.append(test.p_values(walk.level_dbm[:, None], trusting=True)[0])
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
            world, walk = _walk(rng, k, noise)
            share = DISPLACED[(k // len(SHAPES)) % len(DISPLACED)]
            true_m = np.array(world.sources[0])
            test = claim_test(walk, _displace(walk, true_m, share, rng)[:, None], rng)
            (predicted,) = test.power(Places.of(*true_m), RATES[0], 48, rng, trusting=True)
            p = test.p_values(walk.level_dbm[:, None], trusting=True)[0]
            rows.append((share, float(p <= RATES[0]), float(predicted)))
        table = np.array(rows)
        for share in (*DISPLACED, None):
            chosen = table if share is None else table[table[:, 0] == share]
            mean = np.mean(chosen[:, 1:], axis=0).tolist()
            figures[f"{name}, {share or 'all'}"] = [len(chosen), *mean]
            print(
                f"power     {name}, {share or 'all'} x distance, {len(chosen)} walks: "
                f"{mean[0]:.3f} (predicted {mean[1]:.3f}); "
                f"+- {0.5 / len(chosen) ** 0.5:.3f}"
            )
    return figures


def _displace(
    walk: PreparedWalk, place_m: FloatArray, share: float, rng: np.random.Generator
) -> FloatArray:
    away_m = float(
        np.min(np.hypot(walk.blocks.places.x_m - place_m[0], walk.blocks.places.y_m - place_m[1]))
    )
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(
        place_m + share * max(away_m, 10.0) * np.array([np.cos(angle), np.sin(angle)]), float
    )


def measured_walks(options: argparse.Namespace) -> Json:
    """Measured walks with a surveyed transmitter."""
    rng = np.random.default_rng(options.seed)
    names = list(traces.names("ABCDE"))
    rng.shuffle(names)  # if time runs out, the walks done are a random sample
    rows: dict[float, list[tuple[bool, ...]]] = {0.0: [], **{share: [] for share in DISPLACED}}
    for k in _within(60.0 * options.minutes, len(names)):
        world = traces.world_of(*names[k])
        obs = observations(world, world.walk)
        gathered = blocks_of(obs)
        if too_few(obs, obs.usable()):
            continue
        walk = prepare_walk(gathered, PRIOR)
        for share, outcomes in rows.items():
            claim = _displace(walk, np.array(world.sources[0]), share, rng)
            sigma_m = float(np.hypot(world.slack_m / 2.0, np.median(world.position_sigma_m)))
            test = claim_test(walk, around(Places.of(*claim), sigma_m), rng)
            p = float(test.p_values(walk.level_dbm[:, None], trusting=False)[0])
            rules = cellguard(obs, claim), crocodile_hunter(obs, claim)
            outcomes.append((*(p <= rate for rate in RATES), *rules))
    result: Json = {}
    for share, outcomes in rows.items():
        if outcomes:
            mean = np.mean(np.array(outcomes, float), axis=0).tolist()
            result[str(share)] = {"walks": len(outcomes), "rejected": mean}
            print(
                f"measured  displaced by {share:g} x distance, {len(outcomes)} walks, "
                f"at {RATES[0]} / {RATES[1]}: {mean[0]:.3f} / {mean[1]:.3f}; "
                f"CellGuard {mean[2]:.3f}, Crocodile Hunter {mean[3]:.3f}"
            )
    if not names:
        print("measured  skipped: the measured walks are not beside this repository")
    return result


def cellguard(obs: Readings, claim_m: FloatArray) -> bool:
    """True for a cell received farther away than 75 km.

    Its margins for accuracy and speed are left out, since a walker is slow.
    """
    return bool(np.max(np.hypot(obs.x_m - claim_m[0], obs.y_m - claim_m[1])) > CELLGUARD_M)


def crocodile_hunter(obs: Readings, claim_m: FloatArray) -> bool:
    """Outside the box of one standard deviation about the mean of all sightings."""
    x, y = obs.x_m, obs.y_m
    return bool(
        abs(claim_m[0] - np.mean(x)) > np.std(x) or abs(claim_m[1] - np.mean(y)) > np.std(y)
    )


if __name__ == "__main__":
    sys.exit(main())
