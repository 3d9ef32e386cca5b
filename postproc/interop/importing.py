"""A walk recorded by another program, made into a run."""

import errno
import hashlib
import pkgutil
import re
import secrets
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from importlib.metadata import version
from itertools import chain, groupby
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

import numpy as np

from logger.core.cell_names import channel_name
from logger.core.document import number_of
from logger.core.errors import FieldLoggerError, GeoError, RunFileError
from logger.core.foreign import open_regular
from logger.core.runfile import RunMeta, RunWriter, convert_journal, read_sound_run
from logger.core.runfile.meta import DATED, IMPORT, IMPORT_WITHOUT_TIMES
from logger.core.types import Fix, Note, Record, Scan, range_dbm, reportable, utc_text
from postproc.estimators import track_plausibility
from postproc.foreign_file import (
    MOST_BAD_ROWS,
    MOST_READINGS,
    MOST_REMARKS,
    most_unpacked_bytes,
    with_limit,
)
from postproc.interop import readers
from postproc.interop.contents import Contents, Format, look_at, members, plain_file, unknown_format
from postproc.interop.readers import named_columns, rayhunter
from postproc.interop.readers.rayhunter import CLOCK_SET_NS
from postproc.interop.sighting import (
    RATS,
    REMARK,
    BadRow,
    NoCell,
    Remark,
    Row,
    Sighting,
    SightingFile,
)
from postproc.interop.track_file import (
    MOST_APART_S,
    POSITIONS,
    GpsTrack,
    in_zone,
    on_track,
    read_track,
    with_position,
)
from postproc.progress import with_progress

_SYNC_EVERY = 50_000
"""Records; what is not synced is held in memory."""

Append = Callable[[Record], int]


def meta_of(origin: str, **more: object) -> RunMeta:
    """Description of a run that was not recorded but made; it names no machine."""
    named = {
        "run_id": secrets.token_hex(16),
        "boot_id": "",
        "started_ns": 0,
        "program": f"cellwalk {version('cellwalk')}",
    }
    return RunMeta(**named, origin=origin, **more)  # type: ignore[arg-type]


def spare(target: Path, origin: str | tuple[str, ...], what: str) -> None:
    """Only a run of the same origin may be replaced: all else cannot be made again.

    Raises `RunFileError`.
    """
    if target.exists() and not read_sound_run(target).meta.origin.startswith(origin):
        raise RunFileError(f"{target} is a recorded run; choose another name for the {what}")


def write_run(target: Path, meta: RunMeta, fill: Callable[[Append], int], reason: str) -> None:
    """A run as HDF5; `fill` appends its records and returns the time of the end.

    Raises `RunFileError`.
    """
    try:
        with TemporaryDirectory(dir=target.parent) as scratch:
            journal = Path(scratch) / "made.journal"
            writer = RunWriter(journal, meta)

            def append(record: Record) -> int:
                seq = writer.append(record)
                if seq % _SYNC_EVERY == 0:
                    writer.sync()
                return seq

            end_ns = fill(append)
            writer.close(end_ns, reason)
            convert_journal(journal, target)
    except OSError as error:
        raise RunFileError(f"cannot write {target}: {error.strerror}") from error


def formats() -> list[Format]:
    """Those in the `IMPORTS` of the modules in `readers`; the first that fits a file reads it.

    Those with names of their own come first.
    """
    return sorted(_all_formats(), key=lambda form: form.is_general)


def _all_formats() -> Iterator[Format]:
    for module in pkgutil.iter_modules(readers.__path__, f"{readers.__name__}."):
        yield from import_module(module.name).IMPORTS


def recognise(
    source: Path, columns: Mapping[str, str] | None = None, *, times: bool = True
) -> Format:
    """Format of a file by its content, or the one that reads the `columns` named by the user.

    Without `times` a table is read without its column of times.

    Raises `RunFileError` for a file that is none of them.
    """
    seen = look_at(source)
    if columns and seen.kind in {"text", "json"}:
        return named_columns.format_of(source, columns, times=times)
    if columns:
        raise unknown_format(source, seen.words, seen.kind)
    if _is_cell_list(seen):
        raise RunFileError(
            f"{source} is a list of cells, not a walk; `postproc celldb import` reads those of "
            "OpenCelliD and Mozilla"
        )
    form = next((form for form in formats() if form.is_it(seen)), None)
    if form is None and seen.kind == "xml" and seen.has("gpx"):
        raise RunFileError(
            f"{source} is a track without cells: import the log that has them with --track {source}"
        )
    if form is None:
        raise unknown_format(source, seen.words, seen.kind)
    if form.name != named_columns.NAME:
        return form
    return named_columns.format_of(source, {}, times=times)


def _is_cell_list(seen: Contents) -> bool:
    """Whether a text lists cells: country files of OpenCelliD and NTM files have no header.

    They begin with the technology of a cell. A walk of CellMapper does not.
    """
    first = seen.head.replace(";", ",").partition(",")[0].strip().upper()
    has_names = seen.has("radio", "net", "area", "cell") and not named_columns.is_it(seen)
    return seen.kind == "text" and (has_names or first in {*RATS, "CDMA"})


_ROW_NS = 10**9  # from row to row where only their order is known
_SHARE_OF_ONE_TIME = 0.2
"""Of the rows: a clock that shows minutes gives most of them the time of others."""
_CURRENT_NS = 10 * 10**9  # an older fix is not current at a scan


class LeftOut:
    """What of a file does not become part of the run: the first bad rows, and how many others."""

    def __init__(self) -> None:
        self.bad: list[BadRow] = []
        self.n_bad = 0
        self.remarks: list[Remark] = []
        self.n_levels = self.n_unnamed = self.n_swapped = 0
        self.first: dict[str, int] = {}  # line of the first that is left out for a reason
        self._other: Counter[str] = Counter()
        self._no_level: Counter[str] = Counter()

    def in_range(self, row: Row) -> Row:
        """A row without a level that its technology cannot report; one without a name is none."""
        if not isinstance(row, Sighting) or row.is_position:
            return row
        reading = row.reading if row.reading.rat is None else reportable(row.reading)
        self.n_levels += reading.level_dbm is not None
        if row.reading.rat is not None and reading.level_dbm != row.reading.level_dbm is not None:
            low, high = range_dbm(row.reading.rat)
            why = f"level outside of what {row.reading.rat} reports, {low:g} to {high:g} dBm"
            if reading.cell is None:
                return NoCell(row.line, why)
            if reading.level_dbm is None:
                self._no_level[why] += 1
        self.n_unnamed += (reading.cell or channel_name(reading)) is None
        self.n_swapped += track_plausibility.is_swapped(reading.mcc, row.fix)
        return row if reading is row.reading else replace(row, reading=reading)

    def take(self, row: BadRow | NoCell | Remark) -> None:
        """Count a row; raises `RunFileError` for more remarks than a walk has."""
        if isinstance(row, NoCell):
            self._other[row.why] += row.n
            self.first.setdefault(row.why, row.line)
        elif isinstance(row, Remark):
            if len(self.remarks) >= MOST_REMARKS and row.code != REMARK:
                self._other[f"signals after the first {MOST_REMARKS:,}"] += 1
                return
            if len(self.remarks) == MOST_REMARKS:
                raise RunFileError(f"line {row.line} is the {MOST_REMARKS:,}th with a remark")
            self.remarks.append(row)
        else:
            self.n_bad += 1
            if len(self.bad) < MOST_BAD_ROWS:
                self.bad.append(row)

    @property
    def doubt(self) -> str:
        """That latitudes seem to be longitudes, or nothing."""
        if not self.n_swapped:
            return ""
        return (
            f"the country codes of {number_of(self.n_swapped, 'reading')} are of another "
            "continent than the positions, and would fit with latitude and longitude exchanged"
        )

    @property
    def other(self) -> tuple[tuple[str, int], ...]:
        return tuple(self._other.most_common())

    @property
    def no_level(self) -> tuple[tuple[str, int], ...]:
        return tuple(self._no_level.most_common())

    @property
    def n_other(self) -> int:
        return self._other.total()

    @property
    def reason(self) -> str:
        """Why nothing is left, as the end of a sentence."""
        if self.bad:
            return f"; line {self.bad[0].line}: {self.bad[0].why}"
        if self.remarks:
            return (
                f"; {len(self.remarks)} remarks have no place: "
                "add the GPX track of the walk with --track"
            )
        left = (*self.other, *self.no_level)
        return "".join(f"; {number_of(n, 'row')}: {why}" for why, n in left)


@dataclass(frozen=True, slots=True)
class Imported:
    """The result of an import, and what of the file it has `left` out; `n_repeated` rows repeat.

    `n_positions` rows beside the `n_rows` readings have a position alone. Without `has_times` the
    run's times only count the rows; `no_clock` states why those of the file, if asked for, are not
    used, `no_track` why there are no positions.
    """

    path: Path
    format: str
    n_rows: int
    n_positions: int
    n_repeated: int
    was_sorted: bool
    left: LeftOut
    has_times: bool = True
    no_clock: str | None = None
    sha256: str | None = None
    no_track: str | None = None


@dataclass(frozen=True, slots=True)
class Reading:
    """How to read a file: without `times` only the order of the rows counts.

    `columns` maps our names to those of a table, `track` gives positions by time, and `zone` is
    that of a clock whose zone the file does not name. A capture's name may contain a telephone
    number and is lost unless `keep_name`; `no_track` states why it has no positions.
    """

    times: bool = True
    columns: Mapping[str, str] = field(default_factory=dict)
    track: GpsTrack | None = None
    zone: ZoneInfo | None = None
    keep_name: bool = False
    no_track: str | None = None


def import_walk(
    source: Path,
    target: Path,
    *,
    times: bool = True,
    reading: Reading | None = None,
    member: str | None = None,
) -> Imported:
    """Make a run of a third-party file; without `times` only the order of the rows counts.

    `reading` replaces `times`; `member` is the file of a zip that is read. Raises `RunFileError`
    for a file without a usable row, for times that cannot be right, or to spare data.
    """
    reading = reading or Reading(times)
    if member is None and len(sizes := members(source)) > 1 and len(walks := walks_in(sizes)) == 1:
        member = next(iter(walks))
    spare(target, (IMPORT, IMPORT_WITHOUT_TIMES), "import")
    name = source if member is None else Path(f"{source}/{member}")
    with _sighting_file(target) as sightings, ExitStack() as files:
        left = LeftOut()
        plain = files.enter_context(plain_file(source, member))
        if member is not None and member.endswith(_CAPTURES[1]):
            plain = files.enter_context(plain_file(plain))
        form = recognise(plain, reading.columns, times=reading.times)
        rows: Iterable[Row]
        if form.capture:
            if not reading.times:
                raise RunFileError(f"{name} has the times of a modem: leave out --times none")
            reading, rows = _capture(form.read(plain), source, member, reading, files)
        else:
            rows = _with_places(with_limit(form.read(plain), plain, "rows"), reading)
        for read in rows:
            row = left.in_range(read)
            if not isinstance(row, Sighting):
                left.take(row)
            elif len(sightings) < MOST_READINGS:
                sightings.append(row)
            else:
                raise RunFileError(
                    f"{name} has more than {MOST_READINGS:,} readings, the last in line "
                    f"{row.line:,}: divide it into several files"
                )
        sha256 = _sha256(source) if form.capture else None
        return _write(name, target, form, sightings, left, reading, sha256)


_CAPTURES = (".qmdl", ".qmdl.gz")
_ANALYSIS, *_POSITIONS = ".ndjson", POSITIONS, ".pcapng"
"""What Rayhunter's zip of a recording has beside it: its warnings; its positions, best first."""


def _beside(names: Iterable[str], capture: str) -> dict[str, str]:
    """Files of a zip that belong to a recording, by the ending of their names."""
    stem = capture.removesuffix(".gz").removesuffix(".qmdl")
    ends = {f"{stem}{end}": end for end in (_ANALYSIS, *_POSITIONS)}
    return {ends[name]: name for name in names if name in ends}


def walks_in(sizes: Mapping[str, int]) -> dict[str, int]:
    """Of the files in a zip, by their sizes, those that become a run each."""
    captures = [name for name in sizes if name.endswith(_CAPTURES)]
    beside = {name for one in captures for name in _beside(sizes, one).values()}
    return {name: size for name, size in sizes.items() if name not in beside}


def _capture(
    rows: Iterable[Row], source: Path, member: str | None, reading: Reading, files: ExitStack
) -> tuple[Reading, Iterator[Row]]:
    beside = _beside(members(source), member) if member is not None else {}
    if (analysis := beside.get(_ANALYSIS)) is not None:
        warnings = rayhunter.read(files.enter_context(plain_file(source, analysis)))
        rows = chain(rows, (row for row in warnings if isinstance(row, Remark)))
    why = None
    for end in _POSITIONS if reading.track is None else ():
        if end in beside:
            try:
                reading = replace(reading, track=read_track(source, beside[end]), no_track=None)
                break
            except RunFileError as error:
                why = why or str(error)
                reading = replace(reading, no_track=why)
    track = reading.track
    if track and track.n_bad:
        rows = chain(rows, [NoCell(0, "lines of positions that have none", track.n_bad)])
    return reading, _on_one_clock(rows, track.undated_shift_ns if track else None)


def _on_one_clock(rows: Iterable[Row], shift_ns: int | None) -> Iterator[Row]:
    """The same rows; those of before the modem's clock was set are moved to after it."""
    for row in rows:
        if shift_ns is not None and isinstance(row, Sighting) and row.fix.utc_ns is None:
            t_ns = row.t_ns + shift_ns
            yield replace(row, t_ns=t_ns, fix=replace(row.fix, utc_ns=t_ns))
        elif shift_ns is not None and isinstance(row, Remark) and row.utc_ns < CLOCK_SET_NS:
            yield replace(row, utc_ns=row.utc_ns + shift_ns)
        else:
            yield row


def _sha256(source: Path) -> str:
    try:
        with open_regular(source) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error


@contextmanager
def _sighting_file(target: Path) -> Iterator[SightingFile]:
    """Raises `RunFileError` where the target's folder takes no file, or is full."""
    try:
        sightings = SightingFile(target.parent)
    except OSError as error:
        raise RunFileError(f"cannot write {target}: {error.strerror}") from error
    try:
        with closing(sightings):
            yield sightings
    except OSError as error:
        if error.errno not in {errno.ENOSPC, errno.EDQUOT}:  # of the file that is read
            raise
        raise RunFileError(f"cannot write {target}: {error.strerror}") from error


def _write(
    name: Path,
    target: Path,
    form: Format,
    sightings: SightingFile,
    left: LeftOut,
    reading: Reading,
    sha256: str | None,
) -> Imported:
    has_something = left.n_levels or (left.remarks and reading.track) or (sha256 and sightings)
    if not has_something:
        what = "no cell that its records name, and no level" if sha256 else "no usable row"
        n = sightings.n_positions
        alone = f"; {number_of(n, 'row')} with a position alone" * bool(n)
        raise RunFileError(f"{name} has {what}{alone}{left.reason}")
    n_read = len(sightings)
    if not form.unrepeated:
        sightings.leave_out_repeated()
    n_repeated = n_read - len(sightings)
    has_times = reading.times and bool(form.times)
    was_sorted = has_times and sightings.sort_by_time() and not form.capture
    no_clock, track, no_track = None, reading.track, None
    if form.capture:
        if n_undated := sightings.leave_out_before(CLOCK_SET_NS):
            left.take(NoCell(0, "readings of before the modem's clock was set", n_undated))
        if _span_ns(sightings, left.remarks)[1] >= CLOCK_SET_NS:
            dated = [one for one in left.remarks if one.utc_ns >= CLOCK_SET_NS]
            if n_undated := len(left.remarks) - len(dated):
                left.remarks = dated
                why = "remarks and signals of before the modem's clock was set"
                left.take(NoCell(0, why, n_undated))
        track, no_track = _part_of_track(_span_ns(sightings, left.remarks), reading)
    elif has_times and sightings:
        no_clock = _why_no_clock(name, form, sightings)
    has_times = has_times and no_clock is None
    imported = Imported(
        target,
        form.name,
        len(sightings) - sightings.n_positions,
        sightings.n_positions,
        n_repeated,
        was_sorted,
        left,
        has_times,
        no_clock,
        sha256,
        no_track,
    )
    what = name.name
    if sha256 is not None:
        what = f"{what if reading.keep_name else 'a capture'}, SHA-256 {sha256}"
    origin = f"{IMPORT if has_times else IMPORT_WITHOUT_TIMES} {what}"
    if (
        has_times
        and sightings
        and _is_dated(sightings)
        and next(iter(sightings)).fix.utc_ns is None
    ):
        origin += DATED
    rows = with_progress(
        sightings if has_times else _without_times(sightings), "writing", len(sightings)
    )
    scans = scans_of(rows, form) if form.has_scans and has_times else ([row] for row in rows)
    fill = partial(
        _fill_capture if form.capture else _fill,
        notes=_notes(imported),
        scans=scans,
        remarks=left.remarks,
        track=track,
    )
    write_run(target, meta_of(origin), fill, "imported")
    return imported


def _span_ns(sightings: SightingFile, remarks: Sequence[Remark]) -> tuple[int, int]:
    if sightings:
        return sightings.span_ns()
    # signals alone: an early Rayhunter records no levels
    times_ns = [one.utc_ns for one in remarks]
    return min(times_ns), max(times_ns)


def _part_of_track(
    span_ns: tuple[int, int], reading: Reading
) -> tuple[GpsTrack | None, str | None]:
    """The track around a capture's stretch of time, or why it has none."""
    if reading.track is None:
        return None, reading.no_track or "it has none; --track adds those of a walk"
    first_ns, last_ns = span_ns
    if last_ns < CLOCK_SET_NS:
        return None, "the modem's clock was never set, so that no position has its time"
    if (track := reading.track.part(first_ns, last_ns)) is None:
        return None, f"the track has no points within {MOST_APART_S:.0f} s of it"
    return track, None


def _with_places(rows: Iterable[Row], reading: Reading) -> Iterator[Row]:
    if reading.zone is not None:
        rows = in_zone(rows, reading.zone)
    return on_track(rows, reading.track) if reading.track else with_position(rows)


def _start_ns(first: Sequence[Sighting], remarks: Sequence[Remark], track: GpsTrack | None) -> int:
    """Time of the first scan, of which there may be none, or of what comes before it."""
    starts = [first[0].t_ns] if first else []
    starts += [min(remark.utc_ns for remark in remarks)] if remarks else []
    if not first and track:
        starts.append(track.fixes[0].utc_ns or 0)
    return min(starts)


def _without_times(sightings: Iterable[Sighting]) -> Iterator[Sighting]:
    """The readings in the file's order, with their number for a time."""
    for i, row in enumerate(row for row in sightings if not row.is_position):
        yield replace(row, t_ns=i * _ROW_NS, fix=replace(row.fix, utc_ns=None))


def _why_no_clock(source: Path, form: Format, sightings: SightingFile) -> str | None:
    """Why the times of a file are no clock's; raises `RunFileError` for an impossible speed."""
    try:
        track = sightings.track()
    except GeoError:  # outside of UTM: the estimators report that
        return None
    if why := track_plausibility.why_no_clock(track, is_dated=_is_dated(sightings)):
        return why
    n_of_one_time = int(np.count_nonzero(np.diff(track.t_ns) == 0))
    if not form.unrepeated and n_of_one_time > _SHARE_OF_ONE_TIME * len(track.t_ns):
        n_hidden = _n_hidden(sightings)
        if n_hidden > _SHARE_OF_ONE_TIME * len(sightings):
            return f"{n_hidden} rows have the time of another row of their cell"
    if why := track_plausibility.too_fast(track):
        raise RunFileError(
            f"{source}: its times ({form.times}) cannot be right: {why}. Name the right column, "
            "or import the rows in their order, without times: --times none"
        )
    return None


def _is_dated(sightings: SightingFile) -> bool:
    return sightings.span_ns()[0] >= track_plausibility.FIRST_DATED_NS


def _n_hidden(sightings: Iterable[Sighting]) -> int:
    """Rows that another of their time and cell would replace although its level differs."""
    n_hidden = 0
    for _, rows in groupby(sightings, key=lambda row: (row.t_ns, row.receiver)):
        levels_dbm: dict[tuple[object, ...], float | None] = {}
        for row in rows:
            cell, level_dbm = _cell_of(row), row.reading.level_dbm
            n_hidden += levels_dbm.get(cell, level_dbm) != level_dbm
            levels_dbm[cell] = level_dbm
    return n_hidden


def scans_of(sightings: Iterable[Sighting], form: Format) -> Iterator[list[Sighting]]:
    """Rows of one time and receiver; of a cell that apps repeat, also elsewhere, the last counts.

    Of an `unrepeated` form a repeated cell begins another scan.
    """

    def key(row: Sighting) -> tuple[object, ...]:
        return row.t_ns, row.receiver, row.fix if form.unrepeated else None

    for _, rows in groupby(sightings, key=key):
        cells: dict[tuple[object, ...], Sighting] = {}
        for row in rows:
            cell = _cell_of(row)
            if form.unrepeated and cell in cells:
                yield list(cells.values())
                cells = {}
            cells[cell] = row
        yield list(cells.values())


def _cell_of(row: Sighting) -> tuple[object, ...]:
    reading = row.reading
    codes = reading.bsic, reading.psc, reading.pci
    return reading.role, reading.rat, reading.cell, reading.arfcn, *codes


def _fill(
    append: Append,
    notes: Iterable[Note],
    scans: Iterator[list[Sighting]],
    remarks: Sequence[Remark],
    track: GpsTrack | None,
) -> int:
    """Notes, then fixes wherever position or time changes, and each scan after its fix.

    The track counts where no level has a position of its own.
    """
    first = next(scans, [])
    start_ns = _start_ns(first, remarks, track)
    for note in notes:
        append(Record(0, "import", note))
    for remark in remarks:
        note = Note("warning", REMARK, _with_place(remark, track))
        append(Record(remark.utc_ns - start_ns, "import", note))
    if not first:
        return _fill_track(append, remarks, track, start_ns)
    last: tuple[int, Fix] | None = None
    fix_seq = t_ns = 0
    for rows in chain([first], scans):
        row = rows[0]
        t_ns = row.t_ns - start_ns
        if last != (row.t_ns, row.fix):
            last = (row.t_ns, row.fix)
            fix_seq = append(Record(t_ns, "import", row.fix))
        if readings := tuple(r.reading for r in rows if not r.is_position):
            append(Record(t_ns, "import", Scan(t_ns, readings, fix_seq, fix_seq)))
    return t_ns


def _fill_capture(
    append: Append,
    notes: Iterable[Note],
    scans: Iterator[list[Sighting]],
    remarks: Sequence[Remark],
    track: GpsTrack | None,
) -> int:
    """As `_fill`, but with the fixes of a receiver beside the modem, or their times alone.

    Between fixes the smoother knows how far a walker may be from the straight line.
    """
    first = next(scans, [])
    fixes = list(track.fixes) if track else []
    start_ns = min([_start_ns(first, remarks, track), *((fix.utc_ns or 0) for fix in fixes[:1])])
    for note in notes:
        append(Record(0, "import", note))
    for remark in remarks:
        note = Note("info", remark.code, remark.text)
        if remark.code == REMARK:
            note = Note("warning", remark.code, _with_place(remark, track))
        append(Record(max(remark.utc_ns - start_ns, 0), "import", note))
    fixes.reverse()
    latest: tuple[int, int] | None = None
    t_ns = 0
    for rows in chain([first] if first else [], scans):
        at_ns = rows[0].t_ns
        t_ns = at_ns - start_ns
        while fixes and (fixes[-1].utc_ns or 0) <= at_ns:
            fix = fixes.pop()
            utc_ns = fix.utc_ns or 0
            latest = utc_ns, append(Record(utc_ns - start_ns, "import", fix))
        if track is None and rows[0].fix.utc_ns is not None:
            append(Record(t_ns, "import", rows[0].fix))
        is_current = latest is not None and at_ns - latest[0] <= _CURRENT_NS
        fix_seq = latest[1] if latest is not None and is_current else None
        scan = Scan(t_ns, tuple(row.reading for row in rows), fix_seq, fix_seq)
        receiver = rows[0].receiver
        append(Record(t_ns, f"import-{receiver}" if receiver else "import", scan))
    for fix in reversed(fixes):
        t_ns = (fix.utc_ns or 0) - start_ns
        append(Record(t_ns, "import", fix))
    return max([t_ns, *(remark.utc_ns - start_ns for remark in remarks)])


def _fill_track(
    append: Append, remarks: Sequence[Remark], track: GpsTrack | None, start_ns: int
) -> int:
    """The walk of a log that has remarks and no levels."""
    end_ns = max(remark.utc_ns for remark in remarks)
    for fix in track.fixes if track else []:
        end_ns = max(end_ns, fix.utc_ns or 0)
        append(Record((fix.utc_ns or 0) - start_ns, "import", fix))
    return end_ns - start_ns


def _with_place(remark: Remark, track: GpsTrack | None) -> str:
    fix = track.at(remark.utc_ns) if track else None
    where = f"{fix.lat_deg:.6f}, {fix.lon_deg:.6f}" if fix else "no place, the track has a gap"
    return f"{utc_text(remark.utc_ns)} at {where}: {remark.text}"


def _notes(imported: Imported) -> Iterator[Note]:
    if not imported.has_times:
        why = f", since those of the file are no clock's ({imported.no_clock})"
        text = f"seconds count the rows, without times{why if imported.no_clock else ''}"
        yield Note("warning", "no-times", text)
    if imported.was_sorted:
        yield Note("warning", "sorted", "rows were out of order and have been sorted by time")
    if imported.left.doubt:
        yield Note("warning", "swapped", imported.left.doubt)
    if imported.n_positions:
        text = f"{imported.n_positions} rows have a position alone"
        yield Note("info", "positions", text)
    for why, n in imported.left.other:
        what = f"{why}: {n} not read" if imported.sha256 else f"{n} rows were passed over: {why}"
        yield Note("info", "no-cells", what)
    for why, n in imported.left.no_level:
        yield Note("info", "no-level", f"{n} levels were not read: {why}")
    if imported.no_track:
        yield Note("warning", "no-positions", f"no positions: {imported.no_track}")
    if imported.n_repeated:
        yield Note(
            "info", "repeated", f"{imported.n_repeated} rows repeat others and were left out"
        )
    yield from _notes_of_bad_rows(imported.left)


def _notes_of_bad_rows(left: LeftOut) -> Iterator[Note]:
    for bad in left.bad:
        yield Note("warning", "bad-row", f"line {bad.line}: {bad.why}")
    if more := left.n_bad - len(left.bad):
        yield Note("warning", "bad-rows", f"{more} more rows could not be read")


def summary(imported: Imported) -> dict[str, object]:
    """What `--json` prints."""
    return {
        "run": str(imported.path),
        "format": imported.format,
        "rows": imported.n_rows,
        "position_rows": imported.n_positions,
        "other_rows": imported.left.n_other,
        "left_out": dict(imported.left.other),
        "left_out_levels": dict(imported.left.no_level),
        "unnamed_rows": imported.left.n_unnamed,
        "repeated_rows": imported.n_repeated,
        "remarks": len(imported.left.remarks),
        "sorted": imported.was_sorted,
        "times": imported.has_times,
        "no_clock": imported.no_clock,
        "sha256": imported.sha256,
        "no_positions": imported.no_track,
        "n_bad_rows": imported.left.n_bad,
        "bad_rows": [{"line": bad.line, "why": bad.why} for bad in imported.left.bad],
    }


_LONGEST = 60
"""Characters of a name: a file system accepts 255 bytes."""
_UNUSUAL = re.compile(r"[^\w.-]+")


def import_members(
    source: Path, target: Path, sizes: Mapping[str, int], reading: Reading
) -> Iterator[tuple[str, Imported | str]]:
    """Import each file of a zip; yield its name with the result, or with why it is left out.

    Runs are named by `target` and the file: `walk.h5` becomes `walk-monday.h5`. Raises
    `RunFileError` if the files are too large together: they may share their bytes.
    """
    most = most_unpacked_bytes(source.stat().st_size)
    if sum(sizes.values()) > most:
        raise RunFileError(f"{source} unpacks to more than {most >> 20} MB: unpack it yourself")
    for name, path in zip(sizes, _targets(target, list(sizes)), strict=True):
        try:
            yield name, import_walk(source, path, reading=reading, member=name)
        except FieldLoggerError as error:
            yield name, str(error)


def _targets(target: Path, names: list[str]) -> Iterator[Path]:
    """A name that comes again gets a number."""
    taken: set[str] = set()
    for name in names:
        stem = _UNUSUAL.sub("-", PurePosixPath(name).stem).strip(".-")[:_LONGEST] or "log"
        free, number = stem, 1
        while free.lower() in taken:
            number += 1
            free = f"{stem}-{number}"
        taken.add(free.lower())
        yield target.with_name(f"{target.stem}-{free}{target.suffix}")
