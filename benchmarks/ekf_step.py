"""One step of the reference EKF against filterpy's, over the same readings in the same run.

python benchmarks/ekf_step.py
"""

import math
import time
from collections.abc import Callable
from statistics import median

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from logger.core import ekf

Readings = list[tuple[float, float, float]]

STEPS = 5_000
ROUNDS = 9


def walk() -> Readings:
    rng = np.random.default_rng(1)
    places = np.cumsum(rng.normal(0.3, 1.0, (STEPS, 2)), axis=0)
    levels = (
        -30.0
        - 31.0 * np.log10(np.maximum(np.hypot(*(places - (150.0, -80.0)).T), 1.0))
        + rng.normal(0, 3, STEPS)
    )
    return [(float(x), float(y), float(z)) for (x, y), z in zip(places, levels, strict=True)]


def ours(readings: Readings) -> ekf.EkfState:
    state = ekf.start(*readings[0][:2])
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


def microseconds(run: Callable[[Readings], object], readings: Readings) -> float:
    start = time.process_time()
    run(readings)
    return (time.process_time() - start) / len(readings) * 1e6


def main() -> None:
    readings = walk()
    apart = max(
        abs(a - b) for a, b in zip(ours(readings)[:4], filterpys(readings).x.ravel(), strict=True)
    )
    times = [
        (microseconds(ours, readings), microseconds(filterpys, readings)) for _ in range(ROUNDS)
    ]
    mine, theirs = (median(column) for column in zip(*times, strict=True))
    print(
        f"reference EKF      {mine:7.2f} us a step (CPU, median of {ROUNDS} rounds of {STEPS} steps)"
    )
    print(f"filterpy EKF       {theirs:7.2f} us a step, same readings, same run")
    print(f"ratio              {theirs / mine:7.1f}")
    print(f"largest difference {apart:.1e} after {STEPS} steps")


if __name__ == "__main__":
    main()
