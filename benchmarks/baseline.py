"""Speed of baselines: walks added in a second, and the time of a lookup.

    .venv/bin/python benchmarks/baseline.py [--walks 1000]

The walks are simulated, ten minutes each, as HDF5 files, over ground that they share: the worst
case for a lookup, as each square and cell has every walk.
"""

import argparse
import resource
import shutil
import sqlite3
import time
from contextlib import closing
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory

import numpy as np

from logger.baseline_file import BaselineFile
from logger.baseline_store import BaselineStore
from logger.core.runfile import RunWriter, convert_journal
from logger.core.runfile.meta import RunMeta
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.baseline import add_runs

N_SCANS, STEP_DEG = 300, 2.5e-5
"""Ten minutes at 1.4 m/s along a meridian, a scan each 2 s."""
CELLS_IN_SCAN, SCANS_BEFORE_NEXT = 8, 25
"""A modem names at most eight cells; each 70 m another one is the weakest."""


def write_run(folder: Path, number: int) -> Path:
    """A walk of ten minutes past 19 cells."""
    journal, random = folder / f"run-{number:06d}.journal", np.random.default_rng(number)
    meta = RunMeta(
        run_id=f"{number:032x}", boot_id="", started_ns=0, origin="benchmark", program="benchmark"
    )
    writer = RunWriter(journal, meta)
    levels = -60.0 - 5.0 * np.arange(CELLS_IN_SCAN) + random.integers(-6, 7, (N_SCANS, 8))
    for k in range(N_SCANS):
        t_ns = 2 * 10**9 * k
        fix = Fix(True, lat_deg=52.5 + k * STEP_DEG, lon_deg=13.4, acc_m=4.0)
        seq = writer.append(Record(t_ns, "gnss", fix))
        first = k // SCANS_BEFORE_NEXT
        readings = tuple(
            CellReading(
                "neighbour", "GSM", "262", "01", 801, cid=1000 + first + j, arfcn=20 + j, bsic=j,
                rssi_dbm=float(levels[k, j]),
            )
            for j in range(CELLS_IN_SCAN)
        )  # fmt: skip
        writer.append(Record(t_ns + 10**8, "modem", Scan(t_ns, readings, seq, seq)))
    writer.close(2 * 10**9 * N_SCANS, "benchmark")
    run = journal.with_suffix(".h5")
    convert_journal(journal, run)
    journal.unlink()
    return run


def measure_lookups(path: Path) -> None:
    """Time of each kind of lookup without an answer that is kept."""
    with closing(sqlite3.connect(path)) as db:
        squares = [row[0] for row in db.execute("SELECT DISTINCT square FROM square_cell")]
        names = [row[0] for row in db.execute("SELECT name FROM cell")]
    asked = {
        "square": (lambda file, square: file.square(square), squares),
        "cell": (lambda file, name: file.cell(name), names),
        "channels": (lambda file, _: file.channels("262", "01", "GSM"), names),
    }
    for kind, (ask, arguments) in asked.items():
        times_ms = []
        for argument in arguments:
            file = BaselineFile(path)
            began_s = time.perf_counter()
            ask(file, argument)
            times_ms.append(1e3 * (time.perf_counter() - began_s))
            file.close()
        worst = quantiles(times_ms, n=20)[-1]
        print(f"lookup {kind:9} median {median(times_ms):.2f} ms, 95 % {worst:.2f} ms (new file)")
    file = BaselineFile(path)
    began_s = time.perf_counter()
    for square in squares * 1000:
        file.square(square)
    kept_us = 1e6 * (time.perf_counter() - began_s) / (1000 * len(squares))
    print(f"lookup of a square that is kept: {kept_us:.2f} us")
    began_s = time.perf_counter()
    BaselineFile(path).close()
    print(f"open: {1e3 * (time.perf_counter() - began_s):.1f} ms")


def used_cpu_s() -> float:
    """Seconds of processors that this process and those that read for it have used."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--walks", type=int, default=1000)
    parser.add_argument("--keep", type=Path, help="keep the baseline here")
    n_walks = parser.parse_args().walks
    with TemporaryDirectory() as folder:
        paths = [write_run(Path(folder), number) for number in range(n_walks)]
        target = Path(folder) / "baseline.db"
        began_s, cpu_s = time.perf_counter(), used_cpu_s()
        with BaselineStore(target, create=True) as store:
            added = list(add_runs(store, paths))
        seconds, cpu_s = time.perf_counter() - began_s, used_cpu_s() - cpu_s
        n_readings = sum(result.n_readings for result in added)
        assert not any(result.problem for result in added)
        print(
            f"{n_walks} walks, {n_readings} readings in {seconds:.1f} s: "
            f"{n_readings / seconds:,.0f} readings/s, "
            f"{n_readings / cpu_s:,.0f} in a second of one processor"
        )
        print(f"file: {target.stat().st_size / 1e6:.1f} MB")
        measure_lookups(target)
        if (kept := parser.parse_args().keep) is not None:
            shutil.copyfile(target, kept)


if __name__ == "__main__":
    main()
