"""One step of each live EKF in plain Python, over the same readings in the same run.

The reference EKF is compared with filterpy's. The step of the shadowing EKF, whose five columns are
written out, is compared with a loop over n states.

python benchmarks/ekf_step.py
"""

import math
import time
from collections.abc import Callable
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from logger.core import ekf, shadow_ekf
from logger.core.model.path_loss import log_distance_db
from logger.core.places import Places

Readings = list[tuple[float, float, float]]

NOISE = shadow_ekf.ShadowNoise(shadow_db=5.0, decorrelation_m=15.0, white_db=2.0, height_m=8.0)
STEPS = 5_000
ROUNDS = 9


def walk() -> Readings:
    rng = np.random.default_rng(1)
    x_m, y_m = np.cumsum(rng.normal(0.3, 1.0, (STEPS, 2)), axis=0).T
    levels = -30.0 - 3.1 * log_distance_db(x_m - 150.0, y_m + 80.0) + rng.normal(0, 3, STEPS)
    return list(zip(x_m.tolist(), y_m.tolist(), levels.tolist(), strict=True))


def reference(readings: Readings) -> ekf.EkfState:
    state = ekf.start(Places.of(*readings[0][:2]))
    for x_m, y_m, level_dbm in readings:
        state = ekf.step(state, x_m, y_m, level_dbm).state
    return state


def filterpys(readings: Readings) -> ExtendedKalmanFilter:
    oracle = ExtendedKalmanFilter(dim_x=4, dim_z=1)
    oracle.x = np.array([[readings[0][0]], [readings[0][1]], [-40.0], [3.0]])
    oracle.P, oracle.Q, oracle.R, oracle.F = (
        1000.0 * np.eye(4),
        1e-5 * np.eye(4),
        np.array([[9.0]]),
        np.eye(4),
    )
    slope = -10.0 / math.log(10.0)

    def row(x: np.ndarray, x_m: float, y_m: float) -> np.ndarray:
        dx, dy = x[0, 0] - x_m, x[1, 0] - y_m
        d2 = max(dx * dx + dy * dy, 1.0)
        return np.array(
            [[slope * x[3, 0] * dx / d2, slope * x[3, 0] * dy / d2, 1.0, -5.0 * math.log10(d2)]]
        )

    def level(x: np.ndarray, x_m: float, y_m: float) -> np.ndarray:
        d2 = max((x[0, 0] - x_m) ** 2 + (x[1, 0] - y_m) ** 2, 1.0)
        return np.array([[x[2, 0] - 5.0 * x[3, 0] * math.log10(d2)]])

    for x_m, y_m, z in readings:
        oracle.predict()
        oracle.update(np.array([[z]]), row, level, args=(x_m, y_m), hx_args=(x_m, y_m))
    return oracle


def shadowing(readings: Readings) -> shadow_ekf.ShadowState:
    state = shadow_ekf.hold([120.0, -60.0, -30.0, 3.0], NOISE, Places.of(*readings[0][:2]))
    state = shadow_ekf.release(state, np.diag([400.0, 400.0, 20.0, 0.1]))
    for x_m, y_m, level_dbm in readings:
        state = shadow_ekf.step(state, NOISE, x_m, y_m, 3.0, level_dbm).state
    return state


def bierman(
    factors: tuple[float, ...], hx: float, hy: float, he: float, r_db2: float
) -> tuple[tuple[float, ...], list[float], float]:
    """`shadow_ekf._bierman` as a loop over n states."""
    h = (1.0, hx, hy, 1.0, he)
    n, number = len(h), iter(factors[len(h) :])
    d, u = list(factors[:n]), [[0.0] * n for _ in h]
    for i in range(n):
        for j in range(i + 1, n):
            u[j][i] = next(number)
    gain, total = [], r_db2
    for j in range(n):
        column, f = u[j], h[j]
        for i in range(j):
            f += column[i] * h[i]
        g = d[j] * f
        before, total = total, total + f * g
        d[j] *= before / total
        for i in range(j):
            column[i], gain[i] = column[i] - gain[i] * f / before, gain[i] + column[i] * g
        gain.append(g)
    upper = [u[j][i] for i in range(n) for j in range(i + 1, n)]
    return (*d, *upper), gain, total


def step_by_loops(readings: Readings) -> shadow_ekf.ShadowState:
    with patch.object(shadow_ekf, "_bierman", bierman):
        return shadowing(readings)


def microseconds(run: Callable[[Readings], object], readings: Readings) -> float:
    start = time.process_time()
    run(readings)
    return (time.process_time() - start) / len(readings) * 1e6


def compare(
    names: tuple[str, str],
    runs: tuple[Callable[[Readings], Any], Callable[[Readings], Any]],
    readings: Readings,
) -> None:
    """Print the time of two steps, their ratio, and how far their states are apart."""
    states = [run(readings) for run in runs]
    times = [[microseconds(run, readings) for run in runs] for _ in range(ROUNDS)]
    first_us, second_us = (median(column) for column in zip(*times, strict=True))
    apart = max(abs(a - b) for a, b in zip(*(position_of(state) for state in states), strict=True))
    for name, spent_us in zip(names, (first_us, second_us), strict=True):
        print(f"{name:24}{spent_us:7.2f} us a step (CPU, median of {ROUNDS} x {STEPS} steps)")
    print(f"{'ratio':24}{second_us / first_us:7.2f}; states differ by {apart:.1e}")


def position_of(state: Any) -> list[float]:
    """First four values of a state: x, y, P0, eta."""
    values = state.x.ravel() if isinstance(state, ExtendedKalmanFilter) else state
    return [float(value) for value in values[:4]]


def main() -> None:
    readings = walk()
    compare(("reference EKF", "filterpy EKF"), (reference, filterpys), readings)
    compare(("shadowing EKF", "loop over n states"), (shadowing, step_by_loops), readings)


if __name__ == "__main__":
    main()
