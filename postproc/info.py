"""What is in a run: counts, gaps, how it stopped, and whether it is whole."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from logger.core.runfile import Run, Sealing, read_run, sealing_of
from logger.core.scale import levels_dbm
from logger.core.schema import UNKNOWN_ID
from logger.core.timebase import fit
from logger.core.utc import utc_text

GAP_S = 5.0
"""A silence of the receiver or the modem that is worth telling."""


@dataclass(frozen=True, slots=True)
class CellCount:
    """One cell of a run."""

    cell: str
    rat: str | None
    n: int
    strongest_dbm: float | None


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without a record of a kind, in seconds since the start of the run."""

    of: str
    start_s: float
    length_s: float


@dataclass(frozen=True, slots=True)
class Event:
    """A note, with its time since the start of the run."""

    t_s: float
    source: str
    level: str
    code: str
    text: str


@dataclass(frozen=True, slots=True)
class Info:
    """Summary of a run; times in UTC are None where GPS never told the time."""

    path: str
    form: str
    run_id: str
    origin: str
    program: str
    simulated: bool
    started_utc: str | None
    duration_s: float
    stopped: str | None
    missing_frames: int
    skipped_bytes: int
    digest: str
    n_fixes: int
    n_fixes_valid: int
    n_scans: int
    n_readings: int
    n_readings_without_fix: int
    n_readings_without_identity: int
    n_live: int
    n_raw_bytes: int
    cells: tuple[CellCount, ...]
    gaps: tuple[Gap, ...]
    events: tuple[Event, ...]


def describe(run: Run) -> Info:
    """Summary of a run in either form."""
    fixes, scans, readings = run.tables["fixes"], run.tables["scans"], run.tables["readings"]
    start_ns = run.meta.started_ns
    timebase = fit(fixes["t_ns"], fixes["utc_ns"], fixes["valid"])
    stamps = [rows["t_ns"].max() for rows in run.tables.values() if len(rows)]
    end_ns = max([*map(int, stamps), run.end.t_ns if run.end else start_ns])
    return Info(
        path=str(run.path),
        form=run.form,
        run_id=run.meta.run_id,
        origin=run.meta.origin,
        program=run.meta.program,
        simulated=bool(run.meta.truth),
        started_utc=utc_text(timebase.utc_ns(start_ns)) if timebase else None,
        duration_s=(end_ns - start_ns) / 1e9,
        stopped=run.end.reason if run.end else None,
        missing_frames=run.damage.missing_frames,
        skipped_bytes=run.damage.skipped_bytes,
        digest=run.digest,
        n_fixes=len(fixes),
        n_fixes_valid=int(np.count_nonzero(fixes["valid"])),
        n_scans=len(scans),
        n_readings=len(readings),
        n_readings_without_fix=int(np.count_nonzero(readings["fix_seq"] == UNKNOWN_ID)),
        n_readings_without_identity=int(np.count_nonzero(readings["cell"] == b"")),
        n_live=len(run.tables["live"]),
        n_raw_bytes=len(run.raw_bytes),
        cells=_cells(run),
        gaps=(*_gaps("fixes", fixes["t_ns"][fixes["valid"] == 1], start_ns), *_gaps("scans", scans["t_ns"], start_ns)),
        events=_events(run),
    )


def _cells(run: Run) -> tuple[CellCount, ...]:
    readings = run.tables["readings"]
    names, first, which = np.unique(readings["cell"], return_index=True, return_inverse=True)
    cells = []
    for i, name in enumerate(names):
        if not name:
            continue
        mine = readings[which == i]
        levels = levels_dbm(mine)
        levels = levels[np.isfinite(levels)]
        rat = readings["rat"][first[i]].decode() or None
        cells.append(CellCount(name.decode(), rat, len(mine), float(levels.max()) if len(levels) else None))
    return tuple(sorted(cells, key=lambda cell: -cell.n))


def _gaps(of: str, t_ns: np.ndarray[tuple[int], np.dtype[np.int64]], start_ns: int) -> list[Gap]:
    times = np.sort(t_ns)
    lengths_s = np.diff(times) / 1e9
    return [Gap(of, float((times[i] - start_ns) / 1e9), float(lengths_s[i])) for i in np.flatnonzero(lengths_s > GAP_S)]


def _events(run: Run) -> tuple[Event, ...]:
    return tuple(
        Event(
            (int(row["t_ns"]) - run.meta.started_ns) / 1e9,
            row["source"].decode(),
            row["level"].decode(),
            row["code"].decode(),
            row["text"].decode("utf-8", "replace"),
        )
        for row in run.tables["notes"]
    )


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that a run promises, and whether it holds."""

    what: str
    holds: bool
    text: str


def verify(path: Path) -> tuple[Check, ...]:
    """Check a run in either form, with nothing but its file; raises `RunFileError` when it cannot be read at all."""
    run, sealing = read_run(path), sealing_of(path)
    return (
        Check("checksums", not run.damage, str(run.damage) if run.damage else "every frame is there and undamaged"),
        _counts(run),
        _time(run),
        Check("stop", run.end is not None, run.end.reason if run.end else "no record of a stop: the run was cut"),
        _chain(sealing),
    )


def _counts(run: Run) -> Check:
    """One row for each record number, the readings that the scans announce, the bytes that the index names."""
    seqs = np.concatenate([rows["seq"] for table, rows in run.tables.items() if table != "readings"])
    n = run.end.n_records if run.end else int(seqs.max(initial=-1)) + 1
    wrong = []
    if len(np.unique(seqs)) != n or len(seqs) != n:
        wrong.append(f"{n} records were numbered and {len(np.unique(seqs))} are there")
    announced = int(run.tables["scans"]["n_readings"].sum())
    if announced != len(run.tables["readings"]):
        wrong.append(f"{announced} readings were announced and {len(run.tables['readings'])} are there")
    n_bytes = int(run.tables["raw"]["length"].sum())
    if n_bytes != len(run.raw_bytes):
        wrong.append(f"{n_bytes} raw bytes were received and {len(run.raw_bytes)} are there")
    return Check("counts", not wrong, "; ".join(wrong) or f"{n} records, {announced} readings, {n_bytes} raw bytes")


def _time(run: Run) -> Check:
    """Time of each source never goes back in a table; between sources the order is that of arrival."""
    back = 0
    for table, rows in run.tables.items():
        by_source = rows[np.argsort(rows["source"], kind="stable")]
        same = by_source["source"][1:] == by_source["source"][:-1]
        back += int(np.count_nonzero(same & (np.diff(by_source["t_ns"]) < 0))) if table != "live" else 0
    return Check("time", not back, f"goes back {back} times" if back else "never goes back")


def _chain(sealing: Sealing) -> Check:
    if sealing.broken_at is not None:
        text = f"broken: frame {sealing.broken_at} is missing"
    elif sealing.surplus:
        text = f"altered: {sealing.surplus} has rows that were not recorded"
    elif sealing.end is None:
        text = f"not sealed, since the run was cut; digest of what is there {sealing.recomputed}"
    elif not sealing.holds:
        text = f"altered: sealed with {sealing.end.digest}, recomputed {sealing.recomputed}"
    else:
        text = f"sealed with {sealing.recomputed}; compare it with the digest noted at the stop"
    return Check("chain", sealing.holds, text)
