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
from logger.sim.scenario import BLOCK

S, STEP_M, SHADOW_DB, POLLS, FIRST, CELLS = 10**9, 2.8, 4.0, 300, 4, 16
EAST_M, NORTH_M = np.array(BLOCK[:11]).T
CORNERS_M = np.cumsum([0.0, *np.hypot(np.diff(EAST_M), np.diff(NORTH_M))])

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

def walk_past(tracker, n_cells):
    rng = np.random.default_rng(1)
    at_m, shadow_db = rng.uniform(-500.0, 700.0, (n_cells, 2)), np.zeros(n_cells)
    for k in range(POLLS):
        t_ns = 2 * k * S
        x_m, y_m = (np.interp(k * STEP_M, CORNERS_M, one) for one in (EAST_M, NORTH_M))
        rho = np.exp(-STEP_M / 20.0)
        shadow_db *= rho
        shadow_db += np.sqrt(1.0 - rho**2) * SHADOW_DB * rng.normal(size=n_cells)
        distance_m = np.hypot(*(at_m - [x_m, y_m]).T) + 10.0
        levels_dbm = np.maximum(np.round(shadow_db - 8.0 - 29.0 * np.log10(distance_m)), -110.0)
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
kept = [np.ones(2_000_000 // 8) for _ in range(50)][24::25]
print(resident_mb() - before_mb)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
@pytest.mark.parametrize(
    ("how", "least_mb", "most_mb"), [("give", 0.0, 5.0), ("keep", 50.0, 110.0)]
)
def test_what_is_freed_is_given_back(how, least_mb, most_mb):
    """Of 100 MB freed 4 are kept, here and there; by itself the C library keeps them all."""
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, how], capture_output=True, text=True, check=True
    )
    assert least_mb <= float(process.stdout) <= most_mb


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_a_cell_of_a_long_walk_takes_no_more_memory_than_is_reckoned():
    done = subprocess.run(
        [sys.executable, "-c", CELLS],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert 0.5 < float(done.stdout) <= _CELL_MB
