"""Memory and time on this machine; a Pi is several times slower."""

import sys
import tracemalloc
from statistics import median
from time import thread_time

import numpy as np

from logger.core import ekf
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.places import Places
from postproc.reproductions.validate.check import Check, Effort, Line, checks_of, theirs
from postproc.reproductions.validate.live import records
from postproc.reproductions.validate.walk import Station, noisy_level_dbm, true_level_dbm

MOST_BYTES, MOST_STEP_MS, MOST_CYCLE_MS = 5_000, 1.0, 20.0  # the checklist's
_CELLS = 7  # a modem reports at most six neighbours
_STEP_M = 2.8


def checks(effort: Effort) -> list[Check]:
    """State, step and cycle."""
    state_bytes = _bytes(ekf.start(Places.of(0.0, 0.0)))
    step_ms, cycles_ms = _step_ms(50 * effort.timed), _cycles_ms(effort.timed)
    return checks_of(
        "cost",
        Line(
            "an EKF takes less than 5 KB",
            f"{state_bytes} bytes as Python objects (14 doubles are 112); "
            f"our locator of a cell, which is no EKF, {_locator_mb():.1f} MB",
            theirs(state_bytes < MOST_BYTES),
        ),
        Line(
            "matrix operations take 1 ms a step",
            f"{1000.0 * step_ms:.1f} us",
            theirs(step_ms < MOST_STEP_MS),
        ),
        Line(
            "a cycle takes less than 20 ms",
            f"median {median(cycles_ms):.1f} ms for a fix and a scan of {_CELLS} cells, each with "
            f"its own locator; the longest of {len(cycles_ms)} {max(cycles_ms):.0f} ms, with a "
            "search of the positions",
            theirs(median(cycles_ms) < MOST_CYCLE_MS),
        ),
        is_timed=True,
    )


def _bytes(value: object) -> int:
    """Size of a tuple with all that is in it."""
    parts = value if isinstance(value, tuple) else ()
    return sys.getsizeof(value) + sum(_bytes(part) for part in parts)


def _locator_mb() -> float:
    """Memory of one cell's locator after its first search."""
    x_m, y_m = _STEP_M * np.arange(30.0), np.zeros(30)
    level_dbm = true_level_dbm(Station(40.0, 60.0, -30.0, 3.0), x_m, y_m)
    tracemalloc.start()
    tracker = LiveTracker(LiveSettings())
    for number, record in records(x_m, y_m, level_dbm[None]):
        tracker.feed(number, record)
    size_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return size_bytes / 1e6


def _step_ms(steps: int) -> float:
    state = ekf.start(Places.of(0.0, 0.0))
    begin_s = thread_time()
    for k in range(steps):
        state = ekf.step(state, 3.0 * k, 1.0 * k, -80.0).state
    return 1000.0 * (thread_time() - begin_s) / steps


def _cycles_ms(count: int) -> list[float]:
    """Time of each fix with its scan."""
    x_m = _STEP_M * np.arange(count, dtype=float)
    y_m = np.asarray(40.0 * np.sin(x_m / 140.0), float)
    positions = np.random.default_rng(0).uniform(-200.0, 200.0, (_CELLS, 2)).tolist()
    stations = [Station(x, y, -30.0, 3.0) for x, y in positions]
    level_dbm = [noisy_level_dbm(s, x_m, y_m, [k], 3.0) for k, s in enumerate(stations)]
    tracker = LiveTracker(LiveSettings())
    spent_ms = []
    for number, record in records(x_m, y_m, np.array(level_dbm)):
        begin_s = thread_time()
        tracker.feed(number, record)
        spent_ms.append(1000.0 * (thread_time() - begin_s))
    cycles_ms: list[float] = np.sum(np.reshape(spent_ms, (count, 2)), axis=1).tolist()
    return cycles_ms
