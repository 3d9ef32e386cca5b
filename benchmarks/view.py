"""`postproc view` from results to .rrd: time, size and memory, beside logging row by row.

python benchmarks/view.py

Estimating is apart: it is done first, in another process. "row by row" logs the fixes and levels of
the same walk with one call of rerun each, as its tutorials do, and nothing else; of the long walk
only the first part. Beside it stand the same fixes and levels as postproc writes them.
"""

import multiprocessing
import pickle
import re
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr

from logger.core.geo import Utm
from logger.core.model.prior import ENVIRONMENTS
from logger.core.rows import DTYPES
from logger.core.runfile import Run, RunMeta
from logger.core.runfile.meta import Damage
from postproc.smoothing import smooth_runs
from postproc.view.rerun_writer import Sheet
from postproc.view.scene import write_scene
from postproc.view.series import draw_levels
from postproc.view.timeline import unfold
from postproc.view.view_model import estimated, story_of
from tests.kit.headless_viewer import DRIVER, MISSING, headless_viewer, stable_screenshot

CELLS = 8
WALKS = {"1 h": (3_600, 2), "28 h": (100_000, 2)}
"""Fixes, one a second, and seconds between scans."""
PEER_ROWS = 5_000
LAT_DEG, LON_DEG, UTC0_NS = 52.5, 13.4, 1_790_000_000 * 10**9
_STEP_M, _REACH_M = 1.4, 900.0


def main() -> None:
    """Print one block for each walk."""
    for name, (fixes, every) in WALKS.items():
        with tempfile.TemporaryDirectory() as folder:
            _measure(name, walk(fixes, every), Path(folder))


def walk(fixes: int, every: int) -> Run:
    """Streets of a town, a fix a second and a scan of all cells every few seconds, as tables in
    memory.
    """
    rng = np.random.default_rng(1)
    heading = np.repeat(rng.integers(0, 4, fixes // 100 + 1), 100)[:fixes] * np.pi / 2
    x, y = (
        np.abs((np.cumsum(_STEP_M * f(heading)) + 300.0) % (2 * _REACH_M) - _REACH_M)
        for f in (np.cos, np.sin)
    )
    utm = Utm.at(LAT_DEG, LON_DEG)
    x0, y0 = utm.to_xy(LAT_DEG, LON_DEG)
    tables = {name: np.zeros(0, dtype) for name, dtype in DTYPES.items()}
    table = tables["fixes"] = np.zeros(fixes, DTYPES["fixes"])
    table["t_ns"] = np.arange(fixes) * 10**9
    table["seq"], table["valid"], table["utc_ns"] = 2 * np.arange(fixes), 1, UTC0_NS + table["t_ns"]
    table["lat_deg"], table["lon_deg"] = utm.to_latlon_arrays(x0 + x, y0 + y)
    for column in ("acc_m", "speed_mps", "course_deg", "alt_m"):
        table[column] = np.nan
    table["hdop"] = 0.9
    at = np.arange(0, fixes, every)
    scans = tables["scans"] = np.zeros(len(at), DTYPES["scans"])
    scans["t_ns"], scans["t_start_ns"] = table["t_ns"][at] + 2 * 10**8, table["t_ns"][at]
    scans["seq"], scans["fix_seq"] = table["seq"][at] + 1, table["seq"][at]
    scans["fix_start_seq"], scans["n_readings"] = table["seq"][at], CELLS
    tables["readings"] = _readings(rng, scans, x[at], y[at])
    meta = RunMeta(
        run_id=f"benchmark{fixes}",
        boot_id="0",
        started_ns=0,
        origin="simulated",
        program="benchmark",
    )
    return Run(Path(f"walk{fixes}.h5"), "hdf5", meta, None, Damage(), tables, np.zeros(0, np.uint8))


def _readings(
    rng: np.random.Generator, scans: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    rows = np.zeros(len(scans) * CELLS, DTYPES["readings"])
    for column, dtype in rows.dtype.fields.items():
        if dtype[0].kind == "f":
            rows[column] = np.nan
        elif dtype[0].kind == "i":
            rows[column] = -1
    for column in ("seq", "t_ns", "t_start_ns", "fix_seq", "fix_start_seq"):
        rows[column] = np.repeat(scans[column], CELLS)
    source = rng.uniform(0.2 * _REACH_M, 0.8 * _REACH_M, (CELLS, 2))
    distance = np.hypot(x[:, None] - source[:, 0], y[:, None] - source[:, 1]) + 5.0
    level = -20.0 - 30.0 * np.log10(distance) + rng.normal(0.0, 4.0, distance.shape)
    rows["rssi_dbm"] = np.clip(np.round(level), -109.0, -48.0).ravel()
    rows["cell"] = np.tile([f"262-01-1-{i + 1}".encode() for i in range(CELLS)], len(scans))
    rows["rat"], rows["role"] = b"GSM", b"scan"
    return rows


def _measure(name: str, run: Run, folder: Path) -> None:
    begun = time.perf_counter()
    smoothed = smooth_runs([run], ["262-01-1-1"], processes=2)
    told = [(cell, tuple(unfold(cell, ENVIRONMENTS["any"], 2)), ()) for cell in smoothed.cells[:1]]
    estimated_s = time.perf_counter() - begun
    results = folder / "results"
    results.write_bytes(pickle.dumps((estimated(smoothed), told)))
    spent_s, peak_mb, size_mb = _alone(_write, results, folder / "ours.rrd")
    fixes, readings = len(run.tables["fixes"]), len(run.tables["readings"])
    print(
        f"{name}: {fixes} fixes, {readings} readings of {CELLS} cells (estimated in {estimated_s:.1f} s)"
    )
    print(f"  postproc view  {spent_s:7.2f} s {size_mb:7.2f} MB  peak {peak_mb:5.0f} MB")
    columns_s, _, columns_mb = _alone(_columns, results, folder / "columns.rrd")
    print(f"  fixes, levels  {columns_s:7.2f} s {columns_mb:7.2f} MB")
    rows_s, _, rows_mb = _alone(_rows, results, folder / "rows.rrd")
    share = min(PEER_ROWS / fixes, 1.0)
    print(
        f"  row by row     {rows_s / share:7.2f} s {rows_mb / share:7.2f} MB"
        f"{f', scaled up from {share:.0%}' if share < 1.0 else ''}: {rows_s / share / columns_s:.0f} times as long",
        flush=True,
    )
    print(
        f"  opens on software Vulkan in {_opened_s(folder / 'ours.rrd'):.1f} s"
        if DRIVER
        else f"  {MISSING}",
        flush=True,
    )


def _opened_s(path: Path) -> float:
    """Seconds until a fresh viewer shows the walk, its window laid out and the plan at rest."""
    with tempfile.TemporaryDirectory() as folder, headless_viewer(Path(folder)) as client:
        begun = time.perf_counter()
        client.open(str(path))
        while not client.get_state().views:
            time.sleep(0.1)
        stable_screenshot(client, "Plan")
        return time.perf_counter() - begun


def _alone(
    work: Callable[[Path, Path], float], results: Path, path: Path
) -> tuple[float, float, float]:
    """Seconds, megabytes of memory and of file of work done in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        spent_s, peak_mb = pool.apply(_timed, (work, results, path))
    return spent_s, peak_mb, path.stat().st_size / 1e6


def _timed(work: Callable[[Path, Path], float], results: Path, path: Path) -> tuple[float, float]:
    spent_s = work(results, path)
    # not of getrusage: a process begins with the peak of the one it was made from
    status = Path("/proc/self/status")
    peak = re.search(r"VmHWM:\s+(\d+) kB", status.read_text()) if status.exists() else None
    return spent_s, float(peak[1]) / 1e3 if peak else float("nan")


def _write(results: Path, path: Path) -> float:
    found, told = pickle.loads(results.read_bytes())
    begun = time.perf_counter()
    write_scene(story_of(found, told), path)
    return time.perf_counter() - begun


def _columns(results: Path, path: Path) -> float:
    """Fixes and levels alone, as postproc writes them."""
    found, _ = pickle.loads(results.read_bytes())
    story = story_of(found, [])
    begun = time.perf_counter()
    recording = rr.RecordingStream("columns")
    recording.save(path)
    sheet = Sheet(recording, story.clock)
    for walk in story.walks:
        sheet.over_time(
            "walker", walk.t_ns, rr.GeoPoints.columns(positions=story.degrees(walk.track_m))
        )
    draw_levels(sheet, story)
    recording.flush()
    recording.disconnect()
    return time.perf_counter() - begun


def _rows(results: Path, path: Path) -> float:
    found, _ = pickle.loads(results.read_bytes())
    tables = found.runs[0].tables
    share = min(PEER_ROWS / len(tables["fixes"]), 1.0)
    fixes, readings = (
        tables[name][: round(share * len(tables[name]))] for name in ("fixes", "readings")
    )
    begun = time.perf_counter()
    recording = rr.RecordingStream("rows")
    recording.save(path)
    for fix in fixes:
        recording.set_time("elapsed", duration=np.timedelta64(int(fix["t_ns"]), "ns"))
        recording.log("walker", rr.GeoPoints(lat_lon=[(fix["lat_deg"], fix["lon_deg"])]))
    for reading in readings:
        recording.set_time("elapsed", duration=np.timedelta64(int(reading["t_ns"]), "ns"))
        recording.log(f"rssi/{reading['cell'].decode()}", rr.Scalars(float(reading["rssi_dbm"])))
    recording.flush()
    recording.disconnect()
    return time.perf_counter() - begun


if __name__ == "__main__":
    main()
