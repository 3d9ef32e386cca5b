"""Speed of the cell database: import of an export, and lookups by position and identity."""

import argparse
import gzip
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from postproc.verification.celldb import COLUMNS, CellDb, import_exports

Json = dict[str, object]


def database(options: argparse.Namespace) -> Json:
    """Times of import and lookups for a file in the layout of OpenCelliD's world export.

    The positions are spread over a continent.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = [
            _export(folder / f"{i}.csv.gz", options.rows, options.seed + i)
            for i in range(options.more)
        ]
        first_s, first_cpu_s = _import_s(files[:1], folder / "first.db")
        figures: Json = {
            "rows": options.rows,
            "import_s": first_s,
            "import_cpu_s": first_cpu_s,
            "pandas_s": None,
        }
        print(
            f"database  import of {options.rows} rows (gz): {first_s:.1f} s, "
            f"{options.rows / first_s:.0f} rows/s; processor"
            f" {first_cpu_s:.1f} s, {options.rows / first_cpu_s:.0f} rows/s"
        )
        with suppress(ModuleNotFoundError):
            import pandas as pd  # noqa: PLC0415 (a peer that need not be there)

            start, cpu = time.monotonic(), time.process_time()
            pd.read_csv(files[0])
            figures["pandas_s"], cpu = time.monotonic() - start, time.process_time() - cpu
            print(
                f"database  pandas reads the same file in {figures['pandas_s']:.1f} s (processor "
                f"{cpu:.1f} s), no index"
            )
        if options.more > 1:
            _import_s(files, folder / "first.db")
        figures |= _lookups(folder / "first.db", options.seed)
    return figures


def _import_s(files: list[Path], target: Path) -> tuple[float, float]:
    start, cpu = time.monotonic(), time.process_time()
    import_exports(files, target)
    return time.monotonic() - start, time.process_time() - cpu


def _lookups(path: Path, seed: int) -> Json:
    rng, db = np.random.default_rng(seed), CellDb(path)
    n = len(db)
    near, by_name = [], []
    for _ in range(200):
        lat, lon = rng.uniform(36.0, 60.0), rng.uniform(-5.0, 25.0)
        start = time.perf_counter()
        cells = db.near(lat, lon, 5000.0)
        near.append(time.perf_counter() - start)
        for cell in cells[:1]:
            start = time.perf_counter()
            db.by_identity(f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}")
            by_name.append(time.perf_counter() - start)
    db.close()
    times = {"near_ms": near, "identity_ms": by_name}
    figures: Json = {
        key: [1e3 * float(np.quantile(v, q)) for q in (0.5, 0.99)] for key, v in times.items()
    }
    print(f"database  {n} cells; lookups, median and 99 %: {figures}")
    return {"cells": n, **figures}


def _export(path: Path, rows: int, seed: int) -> Path:
    """An export of random cells in random order."""
    rng = np.random.default_rng(seed)
    with gzip.open(path, "wt", compresslevel=1, newline="") as file:
        file.write(",".join(COLUMNS) + "\n")
        for start in range(0, rows, 100_000):
            n = min(100_000, rows - start)
            radio = rng.choice(["GSM", "UMTS", "LTE"], n)
            mcc, net = rng.integers(200, 300, n), rng.integers(1, 20, n)
            area, cell = rng.integers(1, 60_000, n), rng.integers(1, 2**28, n)
            lon, lat = rng.uniform(-10.0, 30.0, n).round(6), rng.uniform(35.0, 62.0, n).round(6)
            span, samples = rng.integers(100, 9000, n), rng.integers(1, 500, n)
            columns = (c.tolist() for c in (radio, mcc, net, area, cell, lon, lat, span, samples))
            file.writelines(
                f"{r},{m},{o},{a},{c},0,{x},{y},{s},{k},1,1282569574,1700155341,0\n"
                for r, m, o, a, c, x, y, s, k in zip(*columns, strict=True)
            )
    return path
