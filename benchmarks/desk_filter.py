"""The compiled shadowing EKF and its smoother against filterpy's, over the same readings.

python benchmarks/desk_filter.py
"""

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, rts_smoother

from logger.core import shadow_ekf
from logger.core.arrays import FloatArray
from logger.core.model.path_loss import log_distance_db
from logger.core.places import Places, Utm
from logger.core.readings import Readings
from logger.core.shadow_ekf import ShadowNoise, ShadowState
from postproc.estimators import rts
from postproc.estimators.filters import reference_ekf, retained_rows, shadow_pass

COUNTS = (10_000, 100_000, 1_000_000)
FILTERPY_MOST = 100_000
NOISE = ShadowNoise(shadow_db=5.0, decorrelation_m=15.0, white_db=2.0, height_m=8.0)
STATE = np.array([60.0, 95.0, -30.0, 3.0])
SPREAD = np.diag([100.0, 100.0, 20.0, 0.1])
FIRST = "first"


def walk(count: int) -> Readings:
    """Rounds of a square of 800 m, 1.4 m from reading to reading."""
    rng = np.random.default_rng(1)
    s = np.arange(count) * 1.4 % 800.0
    corner = [0, 200, 400, 600, 800]
    x, y = np.interp(s, corner, [0, 200, 200, 0, 0]), np.interp(s, corner, [0, 0, 200, 200, 0])
    level = STATE[2] - STATE[3] * log_distance_db(x - STATE[0], y - STATE[1])
    level = np.round(level + 3.0 * rng.normal(size=count))
    number = np.arange(count)
    return Readings(
        "c",
        None,
        Places.of(x, y, utm=Utm(32), sigma_m=np.full(count, 3.0), t_ns=number * 10**9),
        level,
        number,
    )


def start(obs: Readings) -> ShadowState:
    state = shadow_ekf.hold(STATE, NOISE, Places.of(float(obs.x_m[0]), float(obs.y_m[0])))
    return shadow_ekf.release(state, SPREAD)


def ours(obs: Readings) -> tuple[FloatArray, FloatArray]:
    """Last filtered and first smoothed state."""
    conditionals = np.empty((len(obs), 6))
    ahead = shadow_pass(obs, start(obs), NOISE, conditionals=conditionals)
    moved_m = np.hypot(np.diff(obs.x_m), np.diff(obs.y_m))
    rows = retained_rows(len(obs))
    rows[0] = 0
    x, _ = rts.smooth(conditionals, moved_m, NOISE, STATE, ahead.end, rows)
    return ahead.path.x[-1], x[0]


def filterpys(obs: Readings) -> tuple[FloatArray, FloatArray]:
    """The same of filterpy's ExtendedKalmanFilter and rts_smoother."""
    oracle = ExtendedKalmanFilter(dim_x=5, dim_z=1)
    oracle.x = np.append(STATE, 0.0).reshape(5, 1)
    oracle.P = np.zeros((5, 5))
    oracle.P[:4, :4], oracle.P[4, 4] = SPREAD, NOISE.shadow_db**2
    slope = -10.0 / math.log(10.0)

    def row(x: FloatArray, x_m: float, y_m: float, d2: float) -> FloatArray:
        c = slope * x[3, 0] / d2
        return np.array(
            [[c * (x[0, 0] - x_m), c * (x[1, 0] - y_m), 1.0, -5.0 * math.log10(d2), 1.0]]
        )

    def level(x: FloatArray, d2: float) -> FloatArray:
        return np.array([[x[2, 0] - 5.0 * x[3, 0] * math.log10(d2) + x[4, 0]]])

    states, covariances, fs, qs = [], [], [], []
    at = float(obs.x_m[0]), float(obs.y_m[0])
    columns = (
        obs.x_m.tolist(),
        obs.y_m.tolist(),
        obs.position_sigma_m.tolist(),
        obs.level_dbm.tolist(),
    )
    for x_m, y_m, sigma_m, level_dbm in zip(*columns, strict=True):
        rho = math.exp(-math.hypot(x_m - at[0], y_m - at[1]) / NOISE.decorrelation_m)
        at = x_m, y_m
        oracle.F = np.diag([1.0, 1.0, 1.0, 1.0, rho])
        oracle.Q = np.diag([0.0, 0.0, 0.0, 0.0, NOISE.shadow_db**2 * (1.0 - rho * rho)])
        oracle.predict()
        d2 = (
            (oracle.x[0, 0] - x_m) ** 2
            + (oracle.x[1, 0] - y_m) ** 2
            + NOISE.height_m**2
            + 2.0 * sigma_m**2
        )
        r = NOISE.white_db**2 + 1.0 / 12.0 + (slope * oracle.x[3, 0] * sigma_m) ** 2 / d2
        oracle.update(
            np.array([[level_dbm]]),
            row,
            level,
            R=np.array([[r]]),
            args=(x_m, y_m, d2),
            hx_args=(d2,),
        )
        states.append(oracle.x.ravel())
        covariances.append(oracle.P)
        fs.append(oracle.F)
        qs.append(oracle.Q)
    last = states[-1].copy()
    x, *_ = rts_smoother(
        np.array(states), np.array(covariances), [*fs[1:], fs[-1]], [*qs[1:], qs[-1]]
    )
    return last, x[0]


def seconds(run: Callable[[Readings], object], obs: Readings, rounds: int) -> float:
    """CPU time, median of some rounds."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        run(obs)
        times.append(time.process_time() - begin)
    return float(np.median(times))


def time_first_calls() -> None:
    """Time of the first call of each loop in a new process."""
    obs = walk(1000)
    for name, run in (("filter and smoother", ours), ("reference filter", reference_ekf)):
        begin = time.perf_counter()
        run(obs)
        print(f"  {name:22s}{time.perf_counter() - begin:6.2f} s")


def main() -> None:
    with tempfile.TemporaryDirectory() as cache:
        for origin in ("compiling", "from the cache"):
            print(f"first call in a new process, {origin}:", flush=True)
            subprocess.run(
                [sys.executable, __file__, FIRST],
                check=True,
                env=os.environ | {"NUMBA_CACHE_DIR": cache},
            )
    small = walk(COUNTS[0])
    pairs = zip(ours(small), filterpys(small), strict=True)
    apart = max(np.max(np.abs(a - b)) for a, b in pairs)
    print(f"largest difference after {COUNTS[0]} readings: {apart:.1e}")
    reference_ekf(small)
    print(
        "CPU seconds, filter and smoother; filterpy on at most 100 000 readings, scaled beyond (*)"
    )
    print(
        f"{'readings':>10}{'ours':>10}{'us each':>10}{'filterpy':>11}{'ratio':>8}"
        f"{'reference':>11}{'peak MB':>9}"
    )
    for count in COUNTS:
        obs = walk(count)
        ours_s, reference = seconds(ours, obs, 5), seconds(reference_ekf, obs, 5)
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        filterpy_s = seconds(filterpys, walk(min(count, FILTERPY_MOST)), 1) * max(
            count / FILTERPY_MOST, 1.0
        )
        star = "*" if count > FILTERPY_MOST else " "
        print(
            f"{count:10d}{ours_s:10.4f}{ours_s / count * 1e6:10.3f}{filterpy_s:10.2f}{star}"
            f"{filterpy_s / ours_s:8.0f}{reference:11.4f}{peak_mb:9.0f}"
        )


if __name__ == "__main__":
    time_first_calls() if sys.argv[1:] == [FIRST] else main()
