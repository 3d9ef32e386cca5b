"""How honestly claimed positions are verified, and how fast the cell database is.

python benchmarks/verify.py [alarms|power|measured|database ...] [--minutes M] [--walks N] [--rows
N] [--json FILE]

alarms    false-alarm rate of both tests on simulated walks past the claimed place
power     share of displaced claims rejected, beside what each walk's own test predicts
measured  measured walks: claims at the surveyed place and displaced, beside CellGuard's and Crocodile Hunter's rules
database  import of an export, beside pandas where that is installed, and lookups
"""

import argparse
import gzip
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from scipy.stats import binom
from scoreboard import traces
from scoreboard.ours import observations
from scoreboard.world import Noise, World
from scoreboard.worlds import plain

from logger.core.arrays import FloatArray
from logger.core.locator.pipeline import locate
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations
from postproc.cell_estimation import too_few
from postproc.verification.cell_export import COLUMNS
from postproc.verification.celldb import CellDb, CellImport
from postproc.verification.claim_test import Listened, around, claim_test, listened
from postproc.verification.power import power
from postproc.verification.cell_claim import blocks_of, observable

SHAPES = ("L", "square", "random")
NOISES = {"white 3 dB": Noise(3.0), "6 dB over 15 m + 1 dB": Noise(1.0, 6.0, 15.0, step_db=1.0)}
RATES = (0.05, 0.01)
DISPLACED = (0.5, 1.0, 2.0, 5.0)
PRIOR = Prior()

CELLGUARD_M = 75_000.0
"""CellGuard calls a cell suspicious that is farther than this from where its database has it."""

Json = dict[str, object]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts asked for and print what each found."""
    asked = _parser().parse_args(arguments)
    parts: dict[str, Callable[[argparse.Namespace], Json]] = {
        "alarms": alarms,
        "power": powers,
        "measured": measured,
        "database": database,
    }
    found = {name: parts[name](asked) for name in asked.part or parts}
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=2) + "\n")
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


def _walk(rng: np.random.Generator, k: int, noise: Noise) -> tuple[World, Listened]:
    world = plain(rng, SHAPES[k % len(SHAPES)], noise)
    return world, listened(blocks_of(observations(world, world.walk)), PRIOR)


def alarms(asked: argparse.Namespace) -> Json:
    """False-alarm rates, nuisances unknown."""
    found: Json = {}
    for name, noise in NOISES.items():
        p = []
        for k in _within(60.0 * asked.minutes / len(NOISES), asked.walks):
            rng = np.random.default_rng([asked.seed, k])
            world, walk = _walk(rng, k, noise)
            test = claim_test(walk, np.array(world.sources[0])[:, None], rng)
            if test is not None:
                level_dbm = walk.level_dbm[:, None]
                p.append(
                    (
                        test.p_direct(level_dbm, trusting=True)[0],
                        test.p_indirect(level_dbm, trusting=True)[0],
                    )
                )
        shares = {rate: np.mean(np.array(p) <= rate, axis=0).tolist() for rate in RATES}
        found[name] = {
            "walks": len(p),
            "rejected": {str(rate): share for rate, share in shares.items()},
        }
        for rate, (direct, indirect) in shares.items():
            low, high = interval99(len(p), rate)
            print(
                f"alarms    {name}: {len(p)} walks at {rate}: direct {direct:.4f}, indirect {indirect:.4f}"
                f" (99 % of honest tests within {low:.4f} to {high:.4f})"
            )
    return found


def powers(asked: argparse.Namespace) -> Json:
    """Measured and predicted power, by displacement."""
    found: Json = {}
    for name, noise in NOISES.items():
        rows = []
        for k in _within(60.0 * asked.minutes / len(NOISES), asked.walks):
            rng = np.random.default_rng([asked.seed + 1, k])
            world, walk = _walk(rng, k, noise)
            share = DISPLACED[(k // len(SHAPES)) % len(DISPLACED)]
            true_m = np.array(world.sources[0])
            test = claim_test(walk, _displaced(walk, true_m, share, rng)[:, None], rng)
            if test is not None:
                level_dbm = walk.level_dbm[:, None]
                predicted = power(test, true_m[:1], true_m[1:], RATES[0], 48, rng, trusting=True)
                measured_p = (
                    test.p_direct(level_dbm, trusting=True)[0],
                    test.p_indirect(level_dbm, trusting=True)[0],
                )
                rows.append(
                    (
                        share,
                        *(float(p <= RATES[0]) for p in measured_p),
                        *(float(v[0]) for v in predicted),
                    )
                )
        table = np.array(rows)
        for share in (*DISPLACED, None):
            some = table if share is None else table[table[:, 0] == share]
            mean = np.mean(some[:, 1:], axis=0).tolist()
            found[f"{name}, {share or 'all'}"] = [len(some), *mean]
            print(
                f"power     {name}, {share or 'all'} x distance, {len(some)} walks: direct {mean[0]:.3f} (predicted"
                f" {mean[2]:.3f}), indirect {mean[1]:.3f} (predicted {mean[3]:.3f}); +- {0.5 / len(some) ** 0.5:.3f}"
            )
    return found


def _displaced(
    walk: Listened, place_m: FloatArray, share: float, rng: np.random.Generator
) -> FloatArray:
    away_m = float(np.min(np.hypot(walk.blocks.x_m - place_m[0], walk.blocks.y_m - place_m[1])))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(
        place_m + share * max(away_m, 10.0) * np.array([np.cos(angle), np.sin(angle)]), float
    )


def measured(asked: argparse.Namespace) -> Json:
    """Measured walks with a surveyed transmitter."""
    rng = np.random.default_rng(asked.seed)
    names = list(traces.names("ABCDE"))
    rng.shuffle(names)  # where time ends early, the walks done are any of them
    rows: dict[float, list[tuple[bool, ...]]] = {0.0: [], **{share: [] for share in DISPLACED}}
    for k in _within(60.0 * asked.minutes, len(names)):
        world = traces.measured(*names[k])
        obs = observations(world, world.walk)
        gathered = blocks_of(obs)
        if too_few(obs):
            continue
        posterior = locate(obs, PRIOR)
        walk = listened(gathered, PRIOR)
        for share, found in rows.items():
            claim = _displaced(walk, np.array(world.sources[0]), share, rng)
            sigma_m = float(np.hypot(world.slack_m / 2.0, world.position_sigma_m))
            test = claim_test(walk, around(float(claim[0]), float(claim[1]), sigma_m), rng)
            if test is None:
                continue
            level_dbm = walk.level_dbm[:, None]
            p = tuple(
                float(f(level_dbm, trusting=False)[0]) for f in (test.p_direct, test.p_indirect)
            )
            followed = p[1] if observable(posterior) else p[0]
            rules = cellguard(obs, claim), crocodile_hunter(obs, claim)
            found.append(
                (
                    *(v <= RATES[0] for v in (followed, *p)),
                    *(v <= RATES[1] for v in (followed, *p)),
                    *rules,
                )
            )
    result: Json = {}
    for share, found in rows.items():
        if found:
            mean = np.mean(np.array(found, float), axis=0).tolist()
            result[str(share)] = {"walks": len(found), "rejected": mean}
            print(
                f"measured  displaced by {share:g} x distance, {len(found)} walks, at {RATES[0]} / {RATES[1]}: followed"
                f" {mean[0]:.3f} / {mean[3]:.3f}, direct {mean[1]:.3f} / {mean[4]:.3f}, indirect {mean[2]:.3f} /"
                f" {mean[5]:.3f}; CellGuard {mean[6]:.3f}, Crocodile Hunter {mean[7]:.3f}"
            )
    if not names:
        print("measured  left out: the measured walks are not beside this repository")
    return result


def cellguard(obs: CellObservations, claim_m: FloatArray) -> bool:
    """Heard farther away than 75 km (its margins for accuracy and speed left out: a walker is
    slow).
    """
    return bool(np.max(np.hypot(obs.x_m - claim_m[0], obs.y_m - claim_m[1])) > CELLGUARD_M)


def crocodile_hunter(obs: CellObservations, claim_m: FloatArray) -> bool:
    """Outside the box of one standard deviation about the mean of all sightings."""
    x, y = obs.x_m, obs.y_m
    return bool(
        abs(claim_m[0] - np.mean(x)) > np.std(x) or abs(claim_m[1] - np.mean(y)) > np.std(y)
    )


def database(asked: argparse.Namespace) -> Json:
    """Import and lookups; the file has the layout of OpenCelliD's world export, places over a
    continent.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = [
            _export(folder / f"{i}.csv.gz", asked.rows, asked.seed + i) for i in range(asked.more)
        ]
        first_s, first_cpu_s = _imported(files[:1], folder / "first.db")
        found: Json = {
            "rows": asked.rows,
            "import_s": first_s,
            "import_cpu_s": first_cpu_s,
            "pandas_s": None,
        }
        print(
            f"database  import of {asked.rows} rows (gz): {first_s:.1f} s, {asked.rows / first_s:.0f} rows/s; processor"
            f" {first_cpu_s:.1f} s, {asked.rows / first_cpu_s:.0f} rows/s"
        )
        with suppress(ModuleNotFoundError):
            import pandas as pd  # noqa: PLC0415 (a peer that need not be there)

            begun, cpu = time.monotonic(), time.process_time()
            pd.read_csv(files[0])
            found["pandas_s"], cpu = time.monotonic() - begun, time.process_time() - cpu
            print(
                f"database  pandas reads the same file in {found['pandas_s']:.1f} s (processor {cpu:.1f} s), no index"
            )
        if asked.more > 1:
            _imported(files, folder / "first.db")
        found |= _lookups(folder / "first.db", asked.seed)
    return found


def _imported(files: list[Path], target: Path) -> tuple[float, float]:
    begun, cpu = time.monotonic(), time.process_time()
    for _ in CellImport(files, target):
        pass
    return time.monotonic() - begun, time.process_time() - cpu


def _lookups(path: Path, seed: int) -> Json:
    rng, db = np.random.default_rng(seed), CellDb(path)
    n = len(db)
    near, by_name = [], []
    for _ in range(200):
        lat, lon = rng.uniform(36.0, 60.0), rng.uniform(-5.0, 25.0)
        begun = time.perf_counter()
        cells = db.near(lat, lon, 5000.0)
        near.append(time.perf_counter() - begun)
        for cell in cells[:1]:
            begun = time.perf_counter()
            db.by_identity(f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}")
            by_name.append(time.perf_counter() - begun)
    db.close()
    times = {"near_ms": near, "identity_ms": by_name}
    found: Json = {
        key: [1e3 * float(np.quantile(v, q)) for q in (0.5, 0.99)] for key, v in times.items()
    }
    print(f"database  {n} cells; lookups, median and 99 %: {found}")
    return {"cells": n, **found}


def _export(path: Path, rows: int, seed: int) -> Path:
    """An export of made-up cells, in the order of nothing."""
    rng = np.random.default_rng(seed)
    with gzip.open(path, "wt", compresslevel=1, newline="") as file:
        file.write(",".join(COLUMNS) + "\n")
        for begun in range(0, rows, 100_000):
            n = min(100_000, rows - begun)
            radio = rng.choice(["GSM", "UMTS", "LTE"], n)
            mcc, net = rng.integers(200, 300, n), rng.integers(1, 20, n)
            area, cell = rng.integers(1, 60_000, n), rng.integers(1, 2**28, n)
            lon, lat = rng.uniform(-10.0, 30.0, n).round(6), rng.uniform(35.0, 62.0, n).round(6)
            span, samples = rng.integers(100, 9000, n), rng.integers(1, 500, n)
            columns = (c.tolist() for c in (radio, mcc, net, area, cell, lon, lat, span, samples))
            file.writelines(
                f"{r},{m},{o},{a},{c},0,{x},{y},{s},{k},1,1282569574,1700155341,0\n"
                for r, m, o, a, c, x, y, s, k in zip(*columns, strict=True)
            )
    return path


if __name__ == "__main__":
    sys.exit(main())
