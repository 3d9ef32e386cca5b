"""What the timing advance adds: the same simulated walks located without and with it.

python benchmarks/timing_advance.py [--runs N] [--seed S] [--case NAME ...]

The world is not the model: the network rounds to the nearest step, the phone's clock is off by up
to half a symbol for the whole walk, detours are exponential with a mean of 100 m and last for 40 m
of the way, the base station errs evenly by up to a quarter of a symbol, and one reading in fifty is
any number. In LTE the phone is off by up to 12 Ts, the station by a step; one reading in ten has a
TA.
"""

import argparse
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.locator.pipeline import locate
from logger.core.locator.timing_advance import LTE_STEP_M, STEP_M
from logger.core.model.prior import Prior
from logger.core.readings import LAST_LTE_TA, LAST_TA, Readings
from tests.kit.walks import observations, path, region_contains, shadowing

SHAPES = ("L", "square", "random", "straight")


class Case(NamedTuple):
    """Distance of the source from a point of the walk, shadowing, and a shift of all delays."""

    away_m: tuple[float, float]
    shadow_db: float = 0.0
    shift_m: float = 0.0
    idle: bool = False
    rat: str = "GSM"


CASES = {
    "near, TA 0": Case((25.0, 150.0), shadow_db=4.0),
    "0.3-2 km": Case((300.0, 2000.0), shadow_db=4.0),
    "0.3-2 km, white noise": Case((300.0, 2000.0)),
    "2-8 km": Case((2000.0, 8000.0), shadow_db=4.0),
    "0.3-2 km, detour of 500 m": Case((300.0, 2000.0), shadow_db=4.0, shift_m=500.0),
    "near, repeater of 3 km": Case((25.0, 150.0), shadow_db=4.0, shift_m=3000.0),
    "1-2 km, a modem that prints 0": Case((1000.0, 2000.0), shadow_db=4.0, idle=True),
    "LTE, 0.3-2 km": Case((300.0, 2000.0), shadow_db=4.0, rat="LTE"),
    "LTE, 0.3-2 km, fibre of 15 km": Case((300.0, 2000.0), 4.0, shift_m=15_000.0, rat="LTE"),
}


def simulate(
    rng: np.random.Generator, shape: str, case: Case
) -> tuple[Readings, tuple[float, float]]:
    """Readings of a walk of 840 m with levels and timing advances, and the source."""
    x_m, y_m = path(shape, 75, 11.2)
    k, bearing, away_m = (
        rng.integers(len(x_m)),
        rng.uniform(0.0, 2.0 * np.pi),
        rng.uniform(*case.away_m),
    )
    source = float(x_m[k] + away_m * np.cos(bearing)), float(y_m[k] + away_m * np.sin(bearing))
    distance_m = np.maximum(np.hypot(x_m - source[0], y_m - source[1]), 5.0)
    level = rng.uniform(-45.0, -15.0) - 10.0 * rng.uniform(2.3, 3.9) * np.log10(distance_m)
    level += 3.0 * rng.normal(size=len(x_m)) + shadowing(rng, x_m, y_m, case.shadow_db, 25.0)
    ta = (
        np.zeros(len(x_m), np.int64)
        if case.idle
        else timing_advance(rng, x_m, y_m, distance_m + case.shift_m, case.rat)
    )
    readings = replace(observations(x_m, y_m, np.round(level), 3.0), ta=ta, rat=case.rat)
    return readings, source


def timing_advance(
    rng: np.random.Generator, x_m: np.ndarray, y_m: np.ndarray, way_m: np.ndarray, rat: str
) -> np.ndarray:
    """Timing advance that the network sends for path lengths of the signal, -1 for none."""
    a, b = (shadowing(rng, x_m, y_m, 1.0, 40.0) for _ in range(2))
    detour_m = 50.0 * (a**2 + b**2)
    off, stations, step_m, last = {
        "GSM": (0.5, 0.25, STEP_M, LAST_TA),
        "LTE": (0.75, 1.0, LTE_STEP_M, LAST_LTE_TA),
    }[rat]
    phone, station = rng.uniform(-off, off), rng.uniform(-stations, stations, len(way_m))
    step = np.round((way_m + detour_m) / step_m + phone + station)
    wrong = rng.random(len(way_m)) < 0.02
    step[wrong] = rng.integers(0, last + 1, np.count_nonzero(wrong))
    ta = np.clip(step, 0, last).astype(np.int64)
    if rat == "LTE":
        ta[rng.random(len(ta)) > 0.1] = -1
    return ta


def compare(
    case: Case,
    runs: int,
    seed: int,
    prior: Prior = Prior(),  # noqa: B008 (frozen)
) -> np.ndarray:
    """What the locator states of each walk, shape (runs, 2, 4).

    The second axis is without and with timing advance, the third error in m, 95 % region in m2,
    whether that holds the source, and whether the source may be distant.
    """
    rng, outcomes = np.random.default_rng(seed), np.zeros((runs, 2, 4))
    for i in range(runs):
        obs, source = simulate(rng, SHAPES[i % len(SHAPES)], case)
        for j, readings in enumerate((replace(obs, ta=None), obs)):
            answer = locate(readings, prior)
            error_m = np.hypot(answer.x_m - source[0], answer.y_m - source[1])
            is_inside = region_contains(answer, source)
            outcomes[i, j] = error_m, answer.region_area_m2, is_inside, answer.may_be_distant
    return outcomes


def main() -> None:
    """Print two lines for each case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", nargs="+", choices=list(CASES), default=list(CASES))
    arguments = parser.parse_args()
    for name in arguments.case:
        outcomes = compare(CASES[name], arguments.runs, arguments.seed)
        smaller = np.median(outcomes[:, 1, 1] / outcomes[:, 0, 1])
        print(
            f"{name}, {arguments.runs} walks: the region is {smaller:.2f} times as large (median)"
        )
        for row, what in enumerate(("without", "with")):
            error_m, area_m2 = np.median(outcomes[:, row, :2], axis=0)
            mean_m, _, coverage, distant = np.mean(outcomes[:, row], axis=0)
            print(
                f"  {what:7} median error {error_m:5.0f} m, mean {mean_m:5.0f} m; "
                f"95 % in {area_m2 / 1e6:7.3f} km2, coverage {coverage:.2f}, "
                f"may be distant {distant:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
