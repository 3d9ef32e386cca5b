"""`postproc view` from results to .rrd: time, size and memory, compared with logging row by row.

python benchmarks/view.py

Estimating is not included: it is done first, in another process. "row by row" logs the fixes and
levels of the same walk with one call of rerun each, as its tutorials do, and nothing else; of the
long walk only the first part. "fixes, levels" is the same content as postproc writes it.
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

from logger.core.model.prior import ENVIRONMENTS
from logger.core.places import Utm
from logger.core.rows import DTYPES
from logger.core.runfile import Run, RunMeta
from logger.core.runfile.meta import Damage
from postproc.pictures.survey import survey_of
from postproc.smoothing import smooth_runs
from postproc.view.plan import RerunWriter
from postproc.view.scene import draw_levels, write_scene
from postproc.view.view_model import answer_steps, cell_view, view_model
from tests.kit.headless_viewer import DRIVER, MISSING, headless_viewer, stable_screenshot

CELLS = 8
WALKS = {"1 h": (3_600, 2), "28 h": (100_000, 2)}
"""Fixes, one a second, and seconds between scans."""
PEER_ROWS = 5_000
"""Logged row by row and scaled up: all rows of the long walk would take minutes."""
LAT_DEG, LON_DEG, UTC0_NS = 52.5, 13.4, 1_790_000_000 * 10**9
_STEP_M, _REACH_M = 1.4, 900.0
"""Metres walked in a second, and half the side of the town."""


def main() -> None:
    """Print one block for each walk."""
    for name, (fixes, every) in WALKS.items():
        with tempfile.TemporaryDirectory() as folder:
            _measure(name, walk(fixes, every), Path(folder))


def walk(fixes: int, every: int) -> Run:
    """A walk in the streets of a town, with a scan of all cells every `every` seconds."""
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
    start_s = time.perf_counter()
    result = smooth_runs([run], ["262-01-1-1"], processes=2)
    cell = result.cells[0]
    steps = tuple(answer_steps(cell, ENVIRONMENTS["any"], 2))
    estimation_s = time.perf_counter() - start_s
    estimates = folder / "results"
    estimates.write_bytes(pickle.dumps((result, steps)))
    fixes, readings = len(run.tables["fixes"]), len(run.tables["readings"])
    print(
        f"{name}: {fixes} fixes, {readings} readings of {CELLS} cells "
        f"(estimated in {estimation_s:.1f} s)"
    )
    spent_s, peak_mb, size_mb = _in_process(_write_view, estimates, folder / "ours.rrd")
    print(f"  postproc view  {spent_s:7.2f} s {size_mb:7.2f} MB  peak {peak_mb:5.0f} MB")
    columns_s, _, columns_mb = _in_process(_write_columns, estimates, folder / "columns.rrd")
    print(f"  fixes, levels  {columns_s:7.2f} s {columns_mb:7.2f} MB")
    rows_s, _, rows_mb = _in_process(_write_rows, estimates, folder / "rows.rrd")
    share = min(PEER_ROWS / fixes, 1.0)
    scaled = f", scaled up from {share:.0%}" if share < 1.0 else ""
    print(
        f"  row by row     {rows_s / share:7.2f} s {rows_mb / share:7.2f} MB{scaled}: "
        f"{rows_s / share / columns_s:.0f} times as long",
        flush=True,
    )
    opening = f"opens on software Vulkan in {_opening_s(folder / 'ours.rrd'):.1f} s"
    print(f"  {opening if DRIVER else MISSING}", flush=True)


def _opening_s(path: Path) -> float:
    """Seconds until a new viewer shows the walk, with its layout complete and the plan stable."""
    if not DRIVER:
        return float("nan")
    with tempfile.TemporaryDirectory() as folder, headless_viewer(Path(folder)) as client:
        start_s = time.perf_counter()
        client.open(str(path))
        while not client.get_state().views:
            time.sleep(0.1)
        stable_screenshot(client, "Plan")
        return time.perf_counter() - start_s


def _in_process(
    work: Callable[[Path, Path], float], estimates: Path, path: Path
) -> tuple[float, float, float]:
    """Seconds, megabytes of memory and of file of work done in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        spent_s, peak_mb = pool.apply(_measure_memory, (work, estimates, path))
    return spent_s, peak_mb, path.stat().st_size / 1e6


def _measure_memory(
    work: Callable[[Path, Path], float], estimates: Path, path: Path
) -> tuple[float, float]:
    spent_s = work(estimates, path)
    # getrusage would start with the peak of the parent process
    status = Path("/proc/self/status")
    peak = re.search(r"VmHWM:\s+(\d+) kB", status.read_text()) if status.exists() else None
    return spent_s, float(peak[1]) / 1e3 if peak else float("nan")


def _write_view(estimates: Path, path: Path) -> float:
    result, steps = pickle.loads(estimates.read_bytes())
    start_s = time.perf_counter()
    survey = survey_of(result)
    write_scene(view_model(result, survey, [cell_view(survey, result.cells[0], steps)], ()), path)
    return time.perf_counter() - start_s


def _write_columns(estimates: Path, path: Path) -> float:
    """Fixes and levels alone, as postproc writes them."""
    result, _ = pickle.loads(estimates.read_bytes())
    view = view_model(result, survey_of(result), [], ())
    start_s = time.perf_counter()
    recording = rr.RecordingStream("columns")
    recording.save(path)
    writer = RerunWriter(recording, view.survey.clock)
    for walk in view.survey.walks:
        columns = rr.GeoPoints.columns(positions=view.survey.degrees(walk.track_m))
        writer.send_columns("walker", walk.t_ns, columns)
    draw_levels(writer, view)
    recording.flush()
    recording.disconnect()
    return time.perf_counter() - start_s


def _write_rows(estimates: Path, path: Path) -> float:
    """Fixes and levels alone, one call for each."""
    result, _ = pickle.loads(estimates.read_bytes())
    tables = result.runs[0].run.tables
    share = min(PEER_ROWS / len(tables["fixes"]), 1.0)
    fixes, readings = (
        tables[name][: round(share * len(tables[name]))] for name in ("fixes", "readings")
    )
    start_s = time.perf_counter()
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
    return time.perf_counter() - start_s


if __name__ == "__main__":
    main()
