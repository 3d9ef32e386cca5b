"""Memory and time, on this machine: the figures differ from run to run, and a Pi is several times
slower.
"""

import sys
import tracemalloc
from statistics import median
from time import thread_time

import numpy as np

from logger.core import ekf
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from postproc.reproductions.validate.check import Check, Effort, promised
from postproc.reproductions.validate.live import records
from postproc.reproductions.validate.walk import Station, heard

TOPIC = "cost"
MOST_BYTES, MOST_STEP_MS, MOST_CYCLE_MS = 5_000, 1.0, 20.0
_CELLS = 7
_STEP_M = 2.8


def checks(effort: Effort) -> list[Check]:
    """State, step and cycle."""
    state_bytes = _bytes(ekf.start(0.0, 0.0))
    step_ms, cycles_ms = _step_ms(effort.timed), _cycles_ms(effort.timed)
    cycle_ms, worst_ms = median(cycles_ms), max(cycles_ms)
    return [
        Check(
            TOPIC,
            "an EKF takes less than 5 KB",
            f"{state_bytes} bytes as Python objects (14 doubles are 112); our locator of a cell, which is no EKF, "
            f"{_locator_mb():.1f} MB",
            promised(state_bytes < MOST_BYTES),
            is_timed=True,
        ),
        Check(
            TOPIC,
            "matrix operations take 1 ms a step",
            f"{1000.0 * step_ms:.1f} us",
            promised(step_ms < MOST_STEP_MS),
            is_timed=True,
        ),
        Check(
            TOPIC,
            "a cycle takes less than 20 ms",
            f"median {cycle_ms:.1f} ms for a fix and a scan of {_CELLS} cells, each with its own locator; "
            f"the longest of {len(cycles_ms)} {worst_ms:.0f} ms, with a search of the places",
            promised(cycle_ms < MOST_CYCLE_MS),
            is_timed=True,
        ),
    ]


def _bytes(value: object) -> int:
    """Size of a tuple with all that is in it."""
    return sys.getsizeof(value) + (
        sum(_bytes(item) for item in value) if isinstance(value, tuple) else 0
    )


def _locator_mb() -> float:
    """What following one cell takes after a first search of the places."""
    x_m, y_m = _STEP_M * np.arange(30.0), np.zeros(30)
    tracemalloc.start()
    tracker = LiveTracker(LiveSettings())
    for number, record in records(x_m, y_m, heard(Station(40.0, 60.0, -30.0, 3.0), x_m, y_m)[None]):
        tracker.feed(number, record)
    kept_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return kept_bytes / 1e6


def _step_ms(steps: int) -> float:
    state = ekf.start(0.0, 0.0)
    begun_s = thread_time()
    for k in range(50 * steps):
        state = ekf.step(state, 3.0 * k, 1.0 * k, -80.0).state
    return 1000.0 * (thread_time() - begun_s) / (50 * steps)


def _cycles_ms(count: int) -> list[float]:
    rng = np.random.default_rng(0)
    x_m = _STEP_M * np.arange(count, dtype=float)
    y_m = np.asarray(40.0 * np.sin(x_m / 140.0), float)
    stations = [
        Station(x, y, -30.0, 3.0) for x, y in rng.uniform(-200.0, 200.0, (_CELLS, 2)).tolist()
    ]
    level_dbm = [heard(station, x_m, y_m) + 3.0 * rng.normal(size=count) for station in stations]
    tracker = LiveTracker(LiveSettings())
    spent_s = []
    for number, record in records(x_m, y_m, np.array(level_dbm, float)):
        begun_s = thread_time()
        tracker.feed(number, record)
        spent_s.append(thread_time() - begun_s)
    return [
        1000.0 * (fix_s + scan_s) for fix_s, scan_s in zip(spent_s[::2], spent_s[1::2], strict=True)
    ]
