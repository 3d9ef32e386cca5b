import os
import platform
import subprocess
import sys

import pytest

from logger.device.memory import _CELL_MB

CELLS = """
from pathlib import Path

import numpy as np

from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.types import CellReading, Fix, Record, Scan
from logger.device.memory import give_back

S, STEP_M, SHADOW_DB, POLLS, FIRST, CELLS = 10**9, 2.8, 6.0, 250, 4, 16

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

def walk_past(tracker, n_cells):
    rng = np.random.default_rng(1)
    at_m, shadow_db = rng.uniform(-300.0, 300.0, (n_cells, 2)), np.zeros(n_cells)
    corners_m = [0, 200, 400, 600, 800, 1600]
    for k in range(POLLS):
        t_ns, way_m = 2 * k * S, k * STEP_M % 1600.0
        x_m = np.interp(way_m, corners_m, [0, 200, 200, 400, 400, 0])
        y_m = np.interp(way_m, corners_m, [0, 0, 200, 200, 400, 0])
        rho = np.exp(-STEP_M / 15.0)
        shadow_db *= rho
        shadow_db += np.sqrt(1.0 - rho**2) * SHADOW_DB * rng.normal(size=n_cells)
        distance_m = np.hypot(*(at_m - [x_m, y_m]).T) + 10.0
        levels_dbm = np.maximum(np.round(shadow_db - 25.0 - 32.0 * np.log10(distance_m)), -110.0)
        fix = Fix(True, None, 52.5 + y_m / 111_320, 13.4 + x_m / 67_766, acc_m=4.0)
        tracker.feed(2 * k, Record(t_ns, "gnss", fix))
        rows = tuple(
            CellReading("neighbour", "GSM", "262", "01", 4711, cid=cid, rssi_dbm=dbm)
            for cid, dbm in enumerate(levels_dbm.tolist(), 1)
        )
        tracker.feed(2 * k + 1, Record(t_ns + 1, "modem", Scan(t_ns, rows)))

give_back()
few, many = LiveTracker(LiveSettings()), LiveTracker(LiveSettings())
walk_past(few, FIRST)  # what is imported and read once
before_mb = resident_mb()
walk_past(many, CELLS)
print((resident_mb() - before_mb) / CELLS)
"""

PROGRAM = """
import sys
from pathlib import Path

import numpy as np

from logger.device.memory import give_back

if "give" in sys.argv:
    give_back()

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

np.ones(10_000_000 // 8)  # one that is freed raises the bound up to its size
before_mb = resident_mb()
kept = [np.ones(200_000 // 8) for _ in range(500)][::50]
print(resident_mb() - before_mb)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
@pytest.mark.parametrize(
    ("how", "least_mb", "most_mb"), [("give", 0.0, 5.0), ("keep", 50.0, 110.0)]
)
def test_what_is_freed_is_given_back(how, least_mb, most_mb):
    """Of 100 MB freed 2 are kept, here and there; by itself the C library keeps them all."""
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, how], capture_output=True, text=True, check=True
    )
    assert least_mb <= float(process.stdout) <= most_mb


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_a_strong_cell_in_shadowing_takes_no_more_memory_than_is_reckoned():
    done = subprocess.run(
        [sys.executable, "-c", CELLS],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert 0.5 < float(done.stdout) <= _CELL_MB
