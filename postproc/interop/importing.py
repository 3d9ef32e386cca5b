"""A walk recorded by another program, made into a run."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from logger.core.errors import GeoError, RunFileError
from logger.core.geo import Utm
from logger.core.provenance import IMPORT, IMPORT_WITHOUT_TIMES
from logger.core.track import Track, fix_sigma_m
from logger.core.types import Fix, Note, Record, Scan
from postproc.estimators import stale_fixes, track_plausibility, walker
from postproc.interop.decompression import plain_file
from postproc.interop.formats import WALK_CSV, Format, recognise
from postproc.interop.run_builder import Append, meta_of, spare, write_run
from postproc.interop.sighting import BadRow, NoCell, Sighting

_ROW_NS = 10**9
"""From row to row where only their order is known."""


@dataclass(frozen=True, slots=True)
class Imported:
    """The result of an import; `n_other` counts rows that are no cells, `n_repeated` repetitions.

    Without `has_times` the run's times only count the rows.
    """

    path: Path
    format: str
    n_rows: int
    n_other: int
    n_repeated: int
    bad_rows: tuple[BadRow, ...]
    was_sorted: bool
    has_times: bool = True


def import_walk(source: Path, target: Path, *, times: bool = True) -> Imported:
    """Make a run of a third-party file; without `times` only the order of the rows counts.

    Raises `RunFileError` for a file without a usable row, for times that cannot be right, or to
    spare data.
    """
    spare(target, (IMPORT, IMPORT_WITHOUT_TIMES), "import")
    with plain_file(source) as plain:
        form = recognise(plain)
        rows = list(form.read(plain))
    sightings = [row for row in rows if isinstance(row, Sighting)]
    bad = tuple(row for row in rows if isinstance(row, BadRow))
    n_other = sum(isinstance(row, NoCell) for row in rows)
    if not sightings:
        why = (
            f"; line {bad[0].line}: {bad[0].why}"
            if bad
            else f"; {n_other} rows are no cells" * bool(n_other)
        )
        raise RunFileError(f"{source} has no usable row{why}")
    n_read = len(sightings)
    if form is not WALK_CSV:
        # apps repeat measurements when they export again
        sightings = list(
            {(row.t_ns, row.fix, row.reading): row for row in reversed(sightings)}.values()
        )[::-1]
    in_time = sorted(sightings, key=lambda row: row.t_ns) if times else _without_times(sightings)
    if times:
        _check_times(source, form, in_time)
    was_sorted = times and not all(a.t_ns <= b.t_ns for a, b in pairwise(sightings))
    imported = Imported(
        target, form.name, len(sightings), n_other, n_read - len(sightings), bad, was_sorted, times
    )
    scans = scans_of(in_time) if form.has_scans and times else [[row] for row in in_time]
    origin = f"{IMPORT if times else IMPORT_WITHOUT_TIMES} {source.name}"
    write_run(target, meta_of(origin), lambda append: _fill(append, scans, imported), "imported")
    return imported


def _without_times(sightings: Sequence[Sighting]) -> list[Sighting]:
    """The rows in the file's order, with their number for a time."""
    return [
        replace(row, t_ns=i * _ROW_NS, fix=replace(row.fix, utc_ns=None))
        for i, row in enumerate(sightings)
    ]


def _check_times(source: Path, form: Format, sightings: Sequence[Sighting]) -> None:
    """Raise `RunFileError` where the positions and their times contradict each other."""
    try:
        track = _track(sightings)
    except GeoError:  # outside of UTM: the estimators report that
        return
    why = track_plausibility.too_fast(track) or track_plausibility.too_many_apart(
        walker.smooth_track(stale_fixes.without_stale(track))
    )
    if why:
        raise RunFileError(
            f"{source}: its times ({form.times}) cannot be right: {why}. Name the right column, "
            "or import the rows in their order, without times: --times none"
        )


def _track(sightings: Sequence[Sighting]) -> Track:
    fixes = list(dict.fromkeys((row.t_ns, row.fix) for row in sightings))
    lat_deg, lon_deg = (
        np.array([getattr(fix, name) for _, fix in fixes]) for name in ("lat_deg", "lon_deg")
    )
    utm = Utm.at(float(lat_deg[0]), float(lon_deg[0]))
    x_m, y_m = utm.to_xy_arrays(lat_deg, lon_deg)
    sigma_m = np.array([fix_sigma_m(fix.acc_m, fix.hdop, fix.quality) for _, fix in fixes])
    return Track(
        utm, np.array([t_ns for t_ns, _ in fixes]), np.arange(len(fixes)), x_m, y_m, sigma_m
    )


def scans_of(sightings: Sequence[Sighting]) -> list[list[Sighting]]:
    """Rows of each scan; of a cell that a scan has twice, the last one."""
    scans = []
    for _, rows in groupby(sightings, key=lambda row: row.t_ns):
        cells = {_cell_of(row): row for row in rows}
        scans.append(list(cells.values()))
    return scans


def _cell_of(row: Sighting) -> tuple[object, ...]:
    reading = row.reading
    return reading.role, reading.rat, reading.cell, reading.arfcn, reading.bsic


def _fill(append: Append, scans: list[list[Sighting]], imported: Imported) -> int:
    """Notes, then each scan, with a fix before it wherever position or time changes."""
    start_ns = scans[0][0].t_ns
    for note in _notes(imported):
        append(Record(0, "import", note))
    last: tuple[int, Fix] | None = None
    fix_seq = 0
    for rows in scans:
        row = rows[0]
        t_ns = row.t_ns - start_ns
        if last != (row.t_ns, row.fix):
            last = (row.t_ns, row.fix)
            fix_seq = append(Record(t_ns, "import", row.fix))
        append(Record(t_ns, "import", Scan(t_ns, tuple(r.reading for r in rows), fix_seq, fix_seq)))
    return scans[-1][0].t_ns - start_ns


def _notes(imported: Imported) -> Iterator[Note]:
    if not imported.has_times:
        yield Note("warning", "no-times", "imported without times: seconds count the rows")
    if imported.was_sorted:
        yield Note("warning", "sorted", "rows were out of order and have been sorted by time")
    if imported.n_other:
        yield Note("info", "no-cells", f"{imported.n_other} rows are no cells and were passed over")
    if imported.n_repeated:
        yield Note(
            "info", "repeated", f"{imported.n_repeated} rows repeat others and were left out"
        )
    for bad in imported.bad_rows:
        yield Note("warning", "bad-row", f"line {bad.line}: {bad.why}")


def summary(imported: Imported) -> dict[str, object]:
    """What `--json` prints."""
    return {
        "run": str(imported.path),
        "format": imported.format,
        "rows": imported.n_rows,
        "other_rows": imported.n_other,
        "repeated_rows": imported.n_repeated,
        "sorted": imported.was_sorted,
        "times": imported.has_times,
        "bad_rows": [{"line": bad.line, "why": bad.why} for bad in imported.bad_rows],
    }
