"""A walk as CSV: one row for each level measured, with the place where it was.

Columns: `t_s` (seconds) or `time_utc` (ISO 8601), `lat`, `lon` (WGS 84 degrees), `rssi_dbm`; optional `cell` (name,
default "target"), `acc_m` (radius that holds 68 %), `rat`. Other columns are passed over.
"""

import csv
import math
import secrets
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

from logger.core.errors import GeoError, RunFileError
from logger.core.geo import check_position
from logger.core.runfile import RunMeta, RunWriter, convert_journal, read_run
from logger.core.types import CellReading, Fix, Note, Rat, Record, Scan

DEFAULT_CELL = "target"
ORIGIN = "import of"
LEVEL_RANGE_DBM = (-200.0, 50.0)
_CELL_BYTES = 64
_SYNC_EVERY = 50_000
"""Records; what is not synced is held in memory."""
_GENERATIONS: dict[str, Rat] = {"2G": "GSM", "3G": "WCDMA", "4G": "LTE", "5G": "NR"}
_RATS = _GENERATIONS | {rat.upper(): rat for rat in get_args(Rat)}


@dataclass(frozen=True, slots=True)
class Row:
    """A usable row; `utc_ns` is None where the file counts seconds only."""

    line: int
    t_ns: int
    utc_ns: int | None
    lat_deg: float
    lon_deg: float
    rssi_dbm: float
    cell: str
    acc_m: float | None
    rat: Rat | None


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that could not be used, and why."""

    line: int
    why: str


@dataclass(frozen=True, slots=True)
class Imported:
    """What an import did."""

    path: Path
    n_rows: int
    bad_rows: tuple[BadRow, ...]
    was_sorted: bool


def import_walk(source: Path, target: Path) -> Imported:
    """Make a run of a CSV walk; raises `RunFileError` for a file without a usable row, or to spare data."""
    _spare(target)
    good, bad = read_walk(source)
    if not good:
        why = f"; line {bad[0].line}: {bad[0].why}" if bad else ""
        raise RunFileError(f"{source} has no usable row{why}")
    in_order = all(a.t_ns <= b.t_ns for a, b in pairwise(good))
    imported = Imported(target, len(good), tuple(bad), not in_order)
    _write(sorted(good, key=lambda row: row.t_ns), imported, source)
    return imported


def _spare(target: Path) -> None:
    """Only an earlier import may be replaced: all else in its place, the CSV itself included, cannot be made again."""
    if target.exists() and not read_run(target).meta.origin.startswith(ORIGIN):
        raise RunFileError(f"{target} is a recorded run; choose another name for the import")


def read_walk(source: Path) -> tuple[list[Row], list[BadRow]]:
    """Usable rows in the file's order, and those that are not; raises `RunFileError` without the columns needed."""
    good: list[Row] = []
    bad: list[BadRow] = []
    try:
        with source.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            for line, fields in _rows(file, source):
                try:
                    good.append(_row(line, fields))
                except (ValueError, GeoError) as error:
                    bad.append(BadRow(line, str(error)))
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    except csv.Error as error:
        raise RunFileError(f"{source} is no CSV file: {error}") from error
    return good, bad


def _rows(file: Iterable[str], source: Path) -> Iterator[tuple[int, dict[str, str]]]:
    lines = iter(file)
    header = next(lines, "")
    delimiter = max(",;\t", key=header.count)
    names = [name.strip().lower() for name in next(csv.reader([header], delimiter=delimiter), [])]
    missing = [name for name in ("lat", "lon", "rssi_dbm") if name not in names]
    if not {"t_s", "time_utc"} & set(names):
        missing.insert(0, "t_s or time_utc")
    if missing:
        raise RunFileError(f"{source}: the header line has no column {', '.join(missing)}")
    reader = csv.reader(lines, delimiter=delimiter)
    for values in reader:
        if any(value.strip() for value in values):
            # a short row lacks its last columns; what it lacks is then empty
            padded = values + [""] * (len(names) - len(values))
            yield reader.line_num + 1, {n: v.strip() for n, v in zip(names, padded, strict=False)}


def _row(line: int, fields: Mapping[str, str]) -> Row:
    utc_ns = _utc_ns(fields["time_utc"]) if "t_s" not in fields or fields.get("time_utc") else None
    t_ns = round(_number(fields, "t_s") * 1e9) if "t_s" in fields or utc_ns is None else utc_ns
    lat_deg, lon_deg = _number(fields, "lat"), _number(fields, "lon")
    check_position(lat_deg, lon_deg)
    cell = fields.get("cell") or DEFAULT_CELL
    if len(cell.encode()) > _CELL_BYTES:
        raise ValueError(f"the cell's name is longer than {_CELL_BYTES} bytes")
    if abs(t_ns) >= 2**62:
        raise ValueError("the time is out of range")
    return Row(
        line,
        t_ns,
        utc_ns,
        lat_deg,
        lon_deg,
        _number(fields, "rssi_dbm", LEVEL_RANGE_DBM),
        cell,
        _number(fields, "acc_m", (0.0, 1e6)) if fields.get("acc_m") else None,
        _RATS.get(fields.get("rat", "").upper()),
    )


def _number(fields: Mapping[str, str], name: str, limits: tuple[float, float] = (-1e12, 1e12)) -> float:
    text = fields.get(name, "")
    if not text:
        raise ValueError(f"{name} is empty")
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{name} is no number: {text[:40]!r}") from None
    if not (math.isfinite(value) and limits[0] <= value <= limits[1]):
        raise ValueError(f"{name} is out of range: {text[:40]}")
    return value


def _utc_ns(text: str) -> int:
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"time_utc is no ISO 8601 time: {text[:40]!r}") from None
    if when.tzinfo is None:
        when = when.replace(tzinfo=UTC)
    since = when - datetime(1970, 1, 1, tzinfo=UTC)
    return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1000


def _write(rows: list[Row], imported: Imported, source: Path) -> None:
    start_ns = rows[0].t_ns
    meta = RunMeta(
        run_id=secrets.token_hex(16),
        boot_id="",
        started_ns=0,
        origin=f"{ORIGIN} {source.name}",
        program=f"cellwalk {version('cellwalk')}",
    )
    try:
        with TemporaryDirectory(dir=imported.path.parent) as scratch:
            journal = Path(scratch) / "import.journal"
            writer = RunWriter(journal, meta)
            for record in _records(rows, imported, start_ns):
                if writer.append(record) % _SYNC_EVERY == 0:
                    writer.sync()
            writer.close(rows[-1].t_ns - start_ns, "imported")
            convert_journal(journal, imported.path)
    except OSError as error:
        raise RunFileError(f"cannot write {imported.path}: {error.strerror}") from error


def _records(rows: list[Row], imported: Imported, start_ns: int) -> Iterator[Record]:
    """Notes, then a fix wherever place or time changes, and a scan for each row."""
    notes = list(_notes(imported))
    yield from (Record(0, "import", note) for note in notes)
    seq = len(notes)
    place: tuple[object, ...] = ()
    fix_seq = 0
    for row in rows:
        t_ns = row.t_ns - start_ns
        if place != (row.t_ns, row.lat_deg, row.lon_deg, row.acc_m):
            place = (row.t_ns, row.lat_deg, row.lon_deg, row.acc_m)
            fix_seq = seq
            seq += 1
            fix = Fix(True, utc_ns=row.utc_ns, lat_deg=row.lat_deg, lon_deg=row.lon_deg, acc_m=row.acc_m)
            yield Record(t_ns, "import", fix)
        reading = CellReading("scan", rat=row.rat, rssi_dbm=row.rssi_dbm, label=row.cell)
        seq += 1
        yield Record(t_ns, "import", Scan(t_ns, (reading,), fix_seq, fix_seq))


def _notes(imported: Imported) -> Iterator[Note]:
    if imported.was_sorted:
        yield Note("warning", "sorted", "rows were out of order and have been sorted by time")
    for bad in imported.bad_rows:
        yield Note("warning", "bad-row", f"line {bad.line}: {bad.why}")


def summary(imported: Imported) -> dict[str, object]:
    """What `--json` prints."""
    return {
        "run": str(imported.path),
        "rows": imported.n_rows,
        "sorted": imported.was_sorted,
        "bad_rows": [{"line": bad.line, "why": bad.why} for bad in imported.bad_rows],
    }
