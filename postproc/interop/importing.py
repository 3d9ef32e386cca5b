"""A walk recorded by another program, made into a run."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from logger.core.errors import GeoError, RunFileError
from logger.core.geo import Utm
from logger.core.provenance import IMPORT, IMPORT_WITHOUT_TIMES
from logger.core.reportable import range_dbm, reportable
from logger.core.track import Track, fix_sigma_m
from logger.core.types import Fix, Note, Record, Scan
from logger.core.utc import utc_text
from postproc.estimators import stale_fixes, track_plausibility, walker
from postproc.interop.decompression import plain_file
from postproc.interop.formats import WALK_CSV, Format, recognise
from postproc.interop.join_track import in_zone, on_track, with_position
from postproc.interop.run_builder import Append, meta_of, spare, write_run
from postproc.interop.sighting import BadRow, NoCell, Remark, Row, Sighting
from postproc.interop.track_file import GpsTrack

_ROW_NS = 10**9
"""From row to row where only their order is known."""


@dataclass(frozen=True, slots=True)
class Imported:
    """The result of an import; `n_other` counts rows that are no cells, `n_repeated` repetitions.

    Without `has_times` the run's times only count the rows. `other` states why the rows of
    `n_other` were passed over and how many each, `n_remarks` counts what another program noticed.
    `no_level` states the same of rows whose cell counts as heard without its level, `n_unnamed`
    counts levels of no named cell.
    """

    path: Path
    format: str
    n_rows: int
    n_other: int
    n_repeated: int
    bad_rows: tuple[BadRow, ...]
    was_sorted: bool
    has_times: bool = True
    other: tuple[tuple[str, int], ...] = ()
    n_remarks: int = 0
    no_level: tuple[tuple[str, int], ...] = ()
    n_unnamed: int = 0


@dataclass(frozen=True, slots=True)
class Reading:
    """How to read a file: without `times` only the order of the rows counts.

    `columns` maps our names to those of a table, `track` gives positions by time, and `zone` is
    that of a clock whose zone the file does not name.
    """

    times: bool = True
    columns: Mapping[str, str] = field(default_factory=dict)
    track: GpsTrack | None = None
    zone: ZoneInfo | None = None


def import_walk(
    source: Path,
    target: Path,
    *,
    times: bool = True,
    reading: Reading | None = None,
    member: str | None = None,
) -> Imported:
    """Make a run of a third-party file; without `times` only the order of the rows counts.

    `reading` states more than `times`, and takes its place; `member` is the file of a zip
    that is read. Raises `RunFileError` for a file without a usable row, for times that cannot be
    right, or to spare data.
    """
    reading = reading or Reading(times)
    spare(target, (IMPORT, IMPORT_WITHOUT_TIMES), "import")
    name = source if member is None else Path(f"{source}/{member}")
    with plain_file(source, member) as plain:
        form = recognise(plain, reading.columns)
        no_level: Counter[str] = Counter()
        rows = [_in_range(row, no_level) for row in _with_places(form.read(plain), reading)]
    sightings = [row for row in rows if isinstance(row, Sighting)]
    remarks = tuple(row for row in rows if isinstance(row, Remark))
    left = _Left.of(rows, no_level)
    has_levels = any(row.reading.level_dbm is not None for row in sightings)
    if not has_levels and not (remarks and reading.track):
        raise RunFileError(f"{name} has no usable row{left.reason}")
    n_read = len(sightings)
    if form is not WALK_CSV:
        # apps repeat measurements when they export again
        sightings = list(
            {(row.t_ns, row.fix, row.reading): row for row in reversed(sightings)}.values()
        )[::-1]
    has_times = reading.times and bool(form.times)
    in_time = (
        sorted(sightings, key=lambda row: row.t_ns) if has_times else _without_times(sightings)
    )
    if has_times and sightings:
        _check_times(name, form, in_time)
    imported = Imported(
        target,
        form.name,
        len(sightings),
        left.n_other,
        n_read - len(sightings),
        left.bad,
        has_times and not all(a.t_ns <= b.t_ns for a, b in pairwise(sightings)),
        has_times,
        left.other,
        len(remarks),
        left.no_level,
        sum(row.reading.cell is None for row in sightings),
    )
    scans = scans_of(in_time) if form.has_scans and has_times else [[row] for row in in_time]
    origin = f"{IMPORT if has_times else IMPORT_WITHOUT_TIMES} {name.name}"
    walk = _Walk(scans, remarks, reading.track)
    write_run(target, meta_of(origin), lambda append: _fill(append, walk, imported), "imported")
    return imported


def _with_places(rows: Iterable[Row], reading: Reading) -> Iterator[Row]:
    if reading.zone is not None:
        rows = in_zone(rows, reading.zone)
    return on_track(rows, reading.track) if reading.track else with_position(rows)


def _in_range(row: Row, no_level: Counter[str]) -> Row:
    """A row without a level that its technology cannot report; one without a name is left out.

    Without a technology nothing is known of the range.
    """
    if not isinstance(row, Sighting) or row.reading.rat is None:
        return row
    reading = reportable(row.reading)
    if reading is row.reading:
        return row
    if reading.level_dbm is not None:
        return replace(row, reading=reading)
    low, high = range_dbm(row.reading.rat)
    why = f"level outside of what {row.reading.rat} reports, {low:g} to {high:g} dBm"
    if reading.cell is None:
        return NoCell(row.line, why)
    no_level[why] += 1
    return replace(row, reading=reading)


@dataclass(frozen=True, slots=True)
class _Left:
    """What of a file does not become part of the run."""

    bad: tuple[BadRow, ...]
    other: tuple[tuple[str, int], ...]
    no_level: tuple[tuple[str, int], ...]
    n_remarks: int

    @classmethod
    def of(cls, rows: Sequence[Row], no_level: Counter[str]) -> "_Left":
        bad = tuple(row for row in rows if isinstance(row, BadRow))
        other = Counter(row.why for row in rows if isinstance(row, NoCell))
        n_remarks = sum(isinstance(row, Remark) for row in rows)
        return cls(bad, tuple(other.most_common()), tuple(no_level.most_common()), n_remarks)

    @property
    def n_other(self) -> int:
        return sum(n for _, n in self.other)

    @property
    def reason(self) -> str:
        """Why nothing is left, as the end of a sentence."""
        if self.bad:
            return f"; line {self.bad[0].line}: {self.bad[0].why}"
        if self.n_remarks:
            return (
                f"; {self.n_remarks} remarks have no place: "
                "add the GPX track of the walk with --track"
            )
        return "".join(f"; {n} rows: {why}" for why, n in (*self.other, *self.no_level))


@dataclass(frozen=True, slots=True)
class _Walk:
    """Content of a run; the track counts where no level has a position of its own."""

    scans: list[list[Sighting]]
    remarks: tuple[Remark, ...]
    track: GpsTrack | None

    @property
    def start_ns(self) -> int:
        starts = [self.scans[0][0].t_ns] if self.scans else []
        starts += [min(remark.utc_ns for remark in self.remarks)] if self.remarks else []
        if not self.scans and self.track:
            starts.append(self.track.fixes[0].utc_ns or 0)
        return min(starts)


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


def _fill(append: Append, walk: _Walk, imported: Imported) -> int:
    """Notes, then each scan, with a fix before it wherever position or time changes."""
    start_ns = walk.start_ns
    for note in _notes(imported):
        append(Record(0, "import", note))
    for remark in walk.remarks:
        note = Note("warning", "remark", _with_place(remark, walk.track))
        append(Record(remark.utc_ns - start_ns, "import", note))
    if not walk.scans:
        return _fill_track(append, walk, start_ns)
    last: tuple[int, Fix] | None = None
    fix_seq = 0
    for rows in walk.scans:
        row = rows[0]
        t_ns = row.t_ns - start_ns
        if last != (row.t_ns, row.fix):
            last = (row.t_ns, row.fix)
            fix_seq = append(Record(t_ns, "import", row.fix))
        append(Record(t_ns, "import", Scan(t_ns, tuple(r.reading for r in rows), fix_seq, fix_seq)))
    return walk.scans[-1][0].t_ns - start_ns


def _fill_track(append: Append, walk: _Walk, start_ns: int) -> int:
    """The walk of a log that has remarks and no levels."""
    end_ns = max(remark.utc_ns for remark in walk.remarks)
    for fix in walk.track.fixes if walk.track else []:
        end_ns = max(end_ns, fix.utc_ns or 0)
        append(Record((fix.utc_ns or 0) - start_ns, "import", fix))
    return end_ns - start_ns


def _with_place(remark: Remark, track: GpsTrack | None) -> str:
    fix = track.at(remark.utc_ns) if track else None
    where = f"{fix.lat_deg:.6f}, {fix.lon_deg:.6f}" if fix else "no place, the track has a gap"
    return f"{utc_text(remark.utc_ns)} at {where}: {remark.text}"


def _notes(imported: Imported) -> Iterator[Note]:
    if not imported.has_times:
        yield Note("warning", "no-times", "imported without times: seconds count the rows")
    if imported.was_sorted:
        yield Note("warning", "sorted", "rows were out of order and have been sorted by time")
    for why, n in imported.other:
        yield Note("info", "no-cells", f"{n} rows were passed over: {why}")
    for why, n in imported.no_level:
        yield Note("info", "no-level", f"{n} levels were not read: {why}")
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
        "left_out": dict(imported.other),
        "left_out_levels": dict(imported.no_level),
        "unnamed_rows": imported.n_unnamed,
        "repeated_rows": imported.n_repeated,
        "remarks": imported.n_remarks,
        "sorted": imported.was_sorted,
        "times": imported.has_times,
        "bad_rows": [{"line": bad.line, "why": bad.why} for bad in imported.bad_rows],
    }
