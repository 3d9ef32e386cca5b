"""`postproc smooth` over runs of 20 cells: time and memory by the number of readings.

python benchmarks/desk.py [READINGS ...]
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from logger.core.geo import Utm
from logger.core.runfile import RunMeta, RunWriter, finish_journal
from logger.core.types import CellReading, Fix, Record, Scan

CELLS = 20
COUNTS = (10_000, 100_000, 1_000_000)
LAT_DEG, LON_DEG = 52.5, 13.4
STEP_M = 1.4


def write_run(folder: Path, readings: int) -> Path:
    """A walk through streets, with a fix and a scan of all cells a second; returns the HDF5."""
    rng = np.random.default_rng(1)
    scans = readings // CELLS
    heading = np.repeat(rng.integers(0, 4, scans // 100 + 1), 100)[:scans] * np.pi / 2
    x, y = (
        np.cumsum(STEP_M * np.cos(heading)) % 2000.0,
        np.cumsum(STEP_M * np.sin(heading)) % 2000.0,
    )
    source = rng.uniform(0.0, 2000.0, (CELLS, 2))
    utm = Utm.at(LAT_DEG, LON_DEG)
    x0, y0 = utm.to_xy(LAT_DEG, LON_DEG)
    lat, lon = utm.to_latlon_arrays(x0 + x, y0 + y)
    level = [
        -20.0 - 30.0 * np.log10(np.hypot(x - a, y - b) + 5.0) + rng.normal(0.0, 5.0, scans)
        for a, b in source
    ]
    level_dbm = np.clip(np.round(level), -109.0, -48.0).T.tolist()
    writer = RunWriter(
        folder / "run.journal",
        RunMeta(
            run_id="benchmark", boot_id="0", started_ns=0, origin="simulated", program="benchmark"
        ),
    )
    for k in range(scans):
        t_ns = k * 10**9
        writer.append(Record(t_ns, "gnss", Fix(True, None, float(lat[k]), float(lon[k]), hdop=0.9)))
        heard = tuple(
            CellReading("scan", "GSM", "262", "01", 1, 1 + i, rssi_dbm=v)
            for i, v in enumerate(level_dbm[k])
        )
        writer.append(Record(t_ns + 1, "modem", Scan(t_ns, heard)))
    writer.close(scans * 10**9, "done")
    return finish_journal(folder / "run.journal")


def main() -> None:
    """Print one line for each size."""
    for count in [int(a) for a in sys.argv[1:]] or COUNTS:
        with tempfile.TemporaryDirectory() as folder:
            run = write_run(Path(folder), count)
            begun = time.perf_counter()
            subprocess.run(
                [sys.executable, "-m", "postproc.cli", "smooth", str(run)],
                check=True,
                capture_output=True,
            )
            spent_s = time.perf_counter() - begun
            peak_gb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
            print(
                f"{count:>9} readings, {CELLS} cells: {spent_s:6.1f} s, "
                f"{1e6 * spent_s / count:7.1f} us a reading, "
                f"peak so far {peak_gb:.2f} GB",
                flush=True,
            )


if __name__ == "__main__":
    main()
