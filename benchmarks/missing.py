"""What missing readings add: a full scan without a cell says that the cell was weak there.

python benchmarks/missing.py [--runs N] [--seed S] [--noise NAME ...] [--loss NAME ...] [--live]
                             [--json FILE]

A walk of 2 km through a simulated city has the target in 10 to 70 % of its scans. Where a full scan
is without it, its level is at most that of the weakest neighbour reported, otherwise at most the
floor. Four ways to use that are compared:

    readings  not at all: the locator with the readings alone
    regular   as `postproc` does: readings count where most scans nearby have the target
    every     each scan without the target is a censored reading
    careful   stretches of 16 m in which the target comes and goes lose as many of the highest
              levels as they have scans without it (Powell, Econometrica 54(6), 1986). A scan is a
              censored reading only with no reading within 10 m, and if its serving cell has had
              the target as a neighbour elsewhere

`--loss` removes the target: from 10 or 30 % of the scans, in stretches of 60 m, or from all scans
whose serving cell does not list it.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import NamedTuple

from logger.core.places import Places

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as fieldlogger does

import numpy as np
from scoreboard.city import FLOOR_DBM, NOISES, SCANS, City, Report, city, outages, report
from scoreboard.live import last_estimate

from logger.core.arrays import BoolArray
from logger.core.certainty import CHI2_95_2DOF
from logger.core.errors import EstimationError
from logger.core.locator.pipeline import locate
from logger.core.locator.quadtree import Effort
from logger.core.locator.region import contains, highest_density
from logger.core.places import Utm
from logger.core.readings import Readings
from postproc.walk import Naming, named_shares

LOSSES = {"none": 0.0, "10 %": 0.1, "30 %": 0.3, "list": 0.0}
"""Share of the scans that are removed."""
LEAST_SHARE, MOST_SHARE = 0.1, 0.7
"""Of the scans, with the target before any loss."""
FEWEST_READINGS = 20
POSITION_SIGMA_M = 2.0
STRETCH, APART = 8, 5
"""Scans that are trimmed at a time, and from a reading to the nearest censored one."""
EFFORT = Effort(most_squares=2500, split_share=0.004, most_blocks=120, samples=4)
"""Half the usual time; all ways have the same."""

Way = Callable[[City, Report, int, BoolArray], Readings]


class Estimate(NamedTuple):
    """Error and 95 % region of one estimate; a bias is the estimated minus the true value."""

    error_m: float
    covered: bool
    area_m2: float
    seconds: float
    p0_bias_db: float
    eta_bias: float


def readings_alone(made: City, heard: Report, target: int, at: BoolArray) -> Readings:
    """The readings of the target, in the scans `at` (n,)."""
    return _observations(made, heard, target, at, np.zeros_like(at))


def regular(made: City, heard: Report, target: int, at: BoolArray) -> Readings:
    """Readings in places where most scans have the target."""
    is_there = heard.is_there.copy()
    is_there[target] = at
    cell, scan = np.nonzero(is_there)
    share = named_shares(Places.of(made.x_m, made.y_m), Naming(cell, scan, np.zeros_like(cell)))
    return replace(readings_alone(made, heard, target, at), named_share=share[cell == target])


def every(made: City, heard: Report, target: int, at: BoolArray) -> Readings:
    """Each other scan is a censored reading."""
    return _observations(made, heard, target, at, ~at)


def careful(made: City, heard: Report, target: int, at: BoolArray) -> Readings:
    """Stretches where the target comes and goes are trimmed; scans far from readings count."""
    level_dbm, keep = made.level_dbm[target], np.zeros_like(at)
    for first in range(0, SCANS, STRETCH):
        stretch = np.arange(first, min(first + STRETCH, SCANS))
        scans = stretch[at[stretch]]
        rest = max(2 * len(scans) - len(stretch), 0)
        keep[scans[np.argsort(level_dbm[scans], kind="stable")[:rest]]] = True
    is_apart = np.convolve(at, np.ones(2 * APART + 1), "same") < 0.5
    is_listed = np.isin(made.serving, made.serving[at])
    return _observations(made, heard, target, keep, is_apart & is_listed)


WAYS: dict[str, Way] = {
    "readings": readings_alone,
    "regular": regular,
    "every": every,
    "careful": careful,
}


def _observations(
    made: City, heard: Report, target: int, at: BoolArray, censored: BoolArray
) -> Readings:
    scans = np.flatnonzero(at | censored)
    level_dbm = np.where(at, made.level_dbm[target], heard.limit_dbm)[scans]
    is_limit = censored[scans] | (level_dbm <= FLOOR_DBM)
    return Readings(
        "cell",
        None,
        Places.of(
            made.x_m[scans],
            made.y_m[scans],
            utm=Utm(32),
            sigma_m=np.full(len(scans), POSITION_SIGMA_M),
            t_ns=scans * 10**9,
        ),
        level_dbm,
        scans,
        known_limit=-is_limit.astype(np.int64),
        without_spikes=True,
    )


def desk(made: City, target: int, obs: Readings) -> Estimate:
    """The posterior at the desktop."""
    start = process_time()
    found = locate(obs, effort=EFFORT)
    seconds = process_time() - start
    squares, source_m = found.squares, made.cell_m[target]
    return Estimate(
        error_m=float(np.hypot(*(source_m - (found.x_m, found.y_m)))),
        covered=contains(squares, highest_density(squares), Places.of(*source_m.tolist())),
        area_m2=found.region_area_m2,
        seconds=seconds,
        p0_bias_db=found.p0_dbm - float(made.p0_dbm[target]),
        eta_bias=found.eta - float(made.eta[target]),
    )


def live(made: City, target: int, obs: Readings) -> Estimate:
    """The last estimate on the device; its region is the ellipse of the strongest mode."""
    start = process_time()
    last = last_estimate(obs)
    seconds = process_time() - start
    covariance = np.array([[last.p_xx, last.p_xy], [last.p_xy, last.p_yy]])
    off_m = made.cell_m[target] - (last.x_m, last.y_m)
    return Estimate(
        error_m=float(np.hypot(*off_m)),
        covered=bool(off_m @ np.linalg.solve(covariance, off_m) <= CHI2_95_2DOF),
        area_m2=float(np.pi * CHI2_95_2DOF * np.sqrt(np.linalg.det(covariance))),
        seconds=seconds,
        p0_bias_db=last.p0_dbm - float(made.p0_dbm[target]),
        eta_bias=last.eta - float(made.eta[target]),
    )


def walk(seed: int, number: int, noise: str) -> tuple[City, int]:
    """A city and its target, the same for every loss."""
    rng = np.random.default_rng([seed, number, list(NOISES).index(noise)])
    while True:
        made = city(rng, noise)
        share = np.mean(report(made).is_there, axis=1)
        targets = np.flatnonzero((share > LEAST_SHARE) & (share < MOST_SHARE))
        if len(targets):
            return made, int(rng.choice(targets))


def estimates(
    seed: int, number: int, noise: str, loss: str, *, on_device: bool
) -> dict[str, Estimate] | None:
    """Estimates of one walk by each way; None if too few readings are left."""
    made, target = walk(seed, number, noise)
    heard = report(made, from_lists=loss == "list")
    at = heard.is_there[target] & ~outages(np.random.default_rng([seed, number]), LOSSES[loss])
    if np.count_nonzero(at) < FEWEST_READINGS:
        return None
    answer = live if on_device else desk
    return {name: answer(made, target, way(made, heard, target, at)) for name, way in WAYS.items()}


def rows(found: list[dict[str, Estimate]]) -> list[str]:
    """One row for each way: coverage, medians, and ratios to the readings alone."""
    lines = []
    for name in WAYS:
        value = {field: np.array([getattr(e[name], field) for e in found]) for field in FIELDS}
        base = {field: np.array([getattr(e["readings"], field) for e in found]) for field in FIELDS}
        median = {field: float(np.median(value[field])) for field in FIELDS}
        ratio = {field: float(np.median(value[field] / base[field])) for field in RATIOS}
        seconds = float(np.sum(value["seconds"]) / np.sum(base["seconds"]))
        lines.append(
            f"{name:9} {np.mean(value['covered']):5.2f} {median['error_m']:7.0f}"
            f" {ratio['error_m']:5.2f} {median['area_m2'] / 1e6:7.3f} {ratio['area_m2']:6.2f}"
            f" {seconds:5.1f} {median['p0_bias_db']:6.1f} {median['eta_bias']:6.2f}"
        )
    return lines


FIELDS = Estimate._fields
RATIOS = ("error_m", "area_m2")
TITLE = "          cover error m     x area km2     x  time P0 bias, eta bias"


def main() -> int:
    """Compare and print."""
    asked = _parser().parse_args()
    cases = [(noise, loss) for noise in asked.noise for loss in asked.loss]
    found: dict[str, list[dict[str, Estimate]]] = {f"{n}, loss {loss}": [] for n, loss in cases}
    for number in range(asked.runs):
        for noise, loss in cases:
            try:
                one = estimates(asked.seed, number, noise, loss, on_device=asked.live)
            except EstimationError as error:
                print(f"{number}, {noise}, {loss}: {error}", file=sys.stderr)
            else:
                found[f"{noise}, loss {loss}"] += [] if one is None else [one]
        if asked.json:
            asked.json.write_text(json.dumps(_plain(found)))
    print(TITLE)
    for title, some in found.items():
        if some:
            print(f"{title}: {len(some)} walks", *rows(some), sep="\n", flush=True)
    return 0


def _plain(found: dict[str, list[dict[str, Estimate]]]) -> dict[str, list[dict[str, object]]]:
    return {
        title: [{name: one._asdict() for name, one in by_way.items()} for by_way in some]
        for title, some in found.items()
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=60, metavar="N", help="walks for each noise")
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--noise", nargs="+", choices=list(NOISES), default=list(NOISES))
    parser.add_argument("--loss", nargs="+", choices=list(LOSSES), default=["none", "10 %"])
    parser.add_argument("--live", action="store_true", help="the estimate on the device")
    parser.add_argument("--json", type=Path, metavar="FILE")
    return parser


if __name__ == "__main__":
    sys.exit(main())
