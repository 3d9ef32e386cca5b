"""Cells of OpenCelliD and Mozilla exports in one indexed SQLite file.

Each cell has one row: of several rows of one identity it is the one last updated. Positions are
indexed by belts of a hundredth of a degree of latitude, in each by longitude. A database lists
where others observed cells, not which exist: absence is never an alarm by itself.

Exports have fourteen columns, longitude before latitude, the same in both: radio, mcc, net, area,
cell, unit, lon, lat, range, samples, changeable, created, updated, averageSignal. The world file
and all of Mozilla's have that header line, country files have none; lines end in LF or CRLF; any
may be gzipped. Where there is a header its names count, not its order. Source: mozilla/ichnaea,
docs/import_export.rst, and wiki.opencellid.org, Menu map view.
"""

import csv
import gzip
import sqlite3
import zlib
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from io import BufferedReader
from itertools import chain, islice
from math import cos, floor, radians
from operator import itemgetter
from pathlib import Path
from shutil import copyfile
from typing import Any, NamedTuple

import numpy as np
from pyproj import Geod

from logger.core.cell_names import identity_of
from logger.core.document import Column, Degrees, Document, Table, Value
from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.foreign import check_regular, open_regular
from logger.core.places import check_position
from logger.sqlite_file import connect
from postproc.atomic_write import whole_file
from postproc.foreign_file import Lines
from postproc.progress import Progress

FARTHEST_M = 200_000.0

_BELTS_PER_DEG = 100
_METRES_PER_DEG = 110_500.0
_SHORT_CID = 1 << 16
APPLICATION_ID = 0x43574442
_GEOD = Geod(ellps="WGS84")
BELT = "CAST((lat + 90) * 100 AS INTEGER)"
_FIELDS = "radio, mcc, net, area, cell, lat, lon, range_m, samples, updated_s"

_CELL_COLUMNS = (
    Column("cell"),
    Column("type"),
    Column("position"),
    Column("range", ".0f", "m"),
    Column("observations", "d"),
    Column("away", ".0f", "m"),
)
COLUMNS = (
    "radio", "mcc", "net", "area", "cell", "unit", "lon", "lat", "range",
    "samples", "changeable", "created", "updated", "averageSignal",
)  # fmt: skip
"""Layout of a file without header."""
NEEDED = ("radio", "mcc", "net", "area", "cell", "lon", "lat")

_GZIP = b"\x1f\x8b"
_KEPT = (
    "radio",
    "mcc",
    "net",
    "area",
    "cell",
    "lon",
    "lat",
    "unit",
    "range",
    "samples",
    "changeable",
    "updated",
)
_STORED = {"range": "range_m", "updated": "updated_s"}
_MOST_BAD = 20
_BATCH = 20_000
_FAST = (
    "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA cache_size = -200000; PRAGMA "
    "threads = 4"
)
_TABLE = """CREATE TABLE IF NOT EXISTS cell (
    radio TEXT, mcc INTEGER, net INTEGER, area INTEGER, cell INTEGER, lon REAL, lat REAL,
    unit INTEGER, range_m INTEGER, samples INTEGER, changeable INTEGER, updated_s INTEGER)"""
_IDENTITY = "CREATE INDEX identity ON cell (mcc, net, area, cell)"
# a covering index: neighbours on the ground lie anywhere in the table, a page of the disk each
_PLACE = (
    f"CREATE INDEX place ON cell ({BELT}, lon, lat, radio, mcc, net, area, cell, range_m, "
    "samples, updated_s)"
)
_GOOD = """radio IN ('GSM', 'CDMA', 'UMTS', 'LTE', 'NR')
    AND typeof(mcc) = 'integer' AND mcc BETWEEN 1 AND 999
    AND typeof(net) = 'integer' AND net BETWEEN 0 AND 65535
    AND typeof(area) = 'integer' AND area BETWEEN 0 AND 16777215
    AND typeof(cell) = 'integer' AND cell BETWEEN 0 AND 68719476735
    AND typeof(lat) = 'real' AND lat BETWEEN -90 AND 90
    AND typeof(lon) = 'real' AND lon BETWEEN -180 AND 180"""
"""CDMA counts its system identity, up to 65535, as net."""
_TWICE = """CREATE TEMP TABLE twice AS
    SELECT mcc, net, area, cell FROM cell GROUP BY mcc, net, area, cell HAVING count(*) > 1"""
_OLDER = """DELETE FROM cell WHERE rowid IN (SELECT id FROM (
    SELECT c.rowid AS id, row_number() OVER (
        PARTITION BY c.radio, c.mcc, c.net, c.area, c.cell
        ORDER BY CAST(c.updated_s AS INTEGER) DESC, c.rowid DESC
    ) AS n
    FROM twice t JOIN cell c ON (c.mcc, c.net, c.area, c.cell)
        = (t.mcc, t.net, t.area, t.cell)) WHERE n > 1)"""


@dataclass(frozen=True, slots=True)
class DbCell:
    """A cell of the database; `updated_s` is Unix time, `samples` the number of observations.

    `distance_m` is that from the requested position, None for a search by identity. `short_cid`
    means that only the lower 16 bits of the identity match: some 3G modems print no more.
    """

    radio: str
    mcc: int
    net: int
    area: int
    cell: int
    lat: float
    lon: float
    range_m: int | None
    samples: int | None
    updated_s: int | None
    distance_m: float | None = None
    short_cid: bool = False


class CellDb:
    """A database open for reading; raises `RunFileError` for a file that is none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._db = open_celldb(path)

    def __len__(self) -> int:
        with _damage_named(self.path):
            return int(self._db.execute("SELECT count(*) FROM cell").fetchone()[0])

    def close(self) -> None:
        """Release the file."""
        self._db.close()

    def by_identity(self, name: str) -> list[DbCell]:
        """Cells with the identity `mcc-mnc-area-cid`, of any radio.

        Raises `ConfigError` for what is no identity.

        Where there is none, cells of the area whose lower 16 bits are those of a short identity.
        """
        identity = identity_of(name)
        if identity is None:
            raise ConfigError(
                f"{name!r} is no cell: mcc-mnc-area-cid is wanted, like 262-01-801-86355"
            )
        same = "mcc = ? AND net = ? AND area = ?"
        cells = self._cells(f"{same} AND cell = ?", identity)
        if cells or identity[3] >= _SHORT_CID:
            return cells
        short = self._cells(f"{same} AND cell & 65535 = ? AND radio = 'UMTS'", identity)
        return [replace(cell, short_cid=True) for cell in short]

    def near(
        self, lat_deg: float, lon_deg: float, radius_m: float, most: int = 100
    ) -> list[DbCell]:
        """Cells within a radius, nearest first.

        Raises `ConfigError` for a radius beyond 200 km, `GeoError` for no position.
        """
        check_position(lat_deg, lon_deg)
        if not 0.0 < radius_m <= FARTHEST_M:
            raise ConfigError(
                f"a radius lies between 0 and {FARTHEST_M / 1000:.0f} km, not at {radius_m:g} m"
            )
        reach_deg = radius_m / _METRES_PER_DEG
        narrowest = cos(radians(min(abs(lat_deg) + reach_deg, 89.9)))
        belts = range(_belt(lat_deg - reach_deg), _belt(lat_deg + reach_deg) + 1)
        inside: list[DbCell] = []
        for low, high in _longitude_intervals(lon_deg, reach_deg / narrowest):
            for belt in belts:
                inside += self._cells(f"{BELT} = ? AND lon BETWEEN ? AND ?", (belt, low, high))
        if not inside:
            return []
        n = len(inside)
        away_m = _GEOD.inv(
            np.full(n, lon_deg),
            np.full(n, lat_deg),
            [cell.lon for cell in inside],
            [cell.lat for cell in inside],
        )[2]
        order = [i for i in np.argsort(away_m) if away_m[i] <= radius_m][:most]
        return [replace(inside[i], distance_m=float(away_m[i])) for i in order]

    def _cells(self, where: str, values: tuple[Any, ...]) -> list[DbCell]:
        with _damage_named(self.path):
            rows = self._db.execute(f"SELECT {_FIELDS} FROM cell WHERE {where}", values).fetchall()  # noqa: S608
            return [_cell_of(*row) for row in rows]


def _cell_of(
    radio: str,
    mcc: int,
    net: int,
    area: int,
    cell: int,
    lat: float,
    lon: float,
    *more: int | None,
) -> DbCell:
    """A row as a cell; raises ValueError or TypeError for values that the import never writes."""
    check_position(float(lat), float(lon))
    range_m, samples, updated_s = (value if isinstance(value, int) else None for value in more)
    return DbCell(
        str(radio),
        int(mcc),
        int(net),
        int(area),
        int(cell),
        lat,
        lon,
        range_m=range_m,
        samples=samples,
        updated_s=updated_s,
    )


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    """What a damaged file raises becomes one `RunFileError`."""
    try:
        yield
    except (sqlite3.Error, GeoError, TypeError, ValueError, OverflowError) as error:
        raise RunFileError(f"{path} is damaged: {error}; import the exports again") from error


def open_celldb(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise RunFileError(f"{path}: no such file")

    def check(db: sqlite3.Connection) -> None:
        if db.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
            raise RunFileError(f"{path} is no cell database; `postproc celldb import` makes one")

    try:
        return connect(path, check=check)
    except (sqlite3.Error, ValueError) as error:
        why = f"{error}; `postproc celldb import` makes one of a cell export"
        raise RunFileError(f"{path} is no cell database: {why}") from error


def _belt(lat_deg: float) -> int:
    return floor((min(max(lat_deg, -90.0), 90.0) + 90.0) * _BELTS_PER_DEG)


def _longitude_intervals(lon_deg: float, reach_deg: float) -> list[tuple[float, float]]:
    """Intervals of longitude, two where they cross the date line."""
    low, high = lon_deg - reach_deg, lon_deg + reach_deg
    if reach_deg >= 180.0:
        return [(-180.0, 180.0)]
    if low < -180.0:
        return [(-180.0, high), (low + 360.0, 180.0)]
    if high > 180.0:
        return [(low, 180.0), (-180.0, high - 360.0)]
    return [(low, high)]


def document_of_cells(cells: Sequence[DbCell]) -> Document:
    """What `postproc celldb lookup` says."""
    content = {"cells": cells, "absence_is_an_alarm": False}
    if not cells:
        absent = (
            "not in the database, which is no alarm by itself: it lists what others have "
            "observed, not what exists"
        )
        return Document(content, body=[absent])
    return Document(content, body=[Table(_CELL_COLUMNS, [_cell_row(cell) for cell in cells])])


def _cell_row(cell: DbCell) -> tuple[Value, ...]:
    short = " (short identity)" if cell.short_cid else ""
    name = f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}{short}"
    position = Degrees(cell.lat, cell.lon)
    return name, cell.radio, position, cell.range_m, cell.samples, cell.distance_m


class Export(NamedTuple):
    """Rows of text, the index of each known column, and the share of the file read so far."""

    rows: Iterator[list[str]]
    column: dict[str, int]
    width: int
    read_share: Callable[[], float]


@contextmanager
def cell_export(path: Path) -> Iterator[Export]:
    """Open an export; raises `RunFileError` for a file that is damaged or none."""
    try:
        with open_regular(path) as raw:
            size = max(check_regular(path), 1)
            lines = _lines(raw, path)  # held here: it closes the file when it goes
            yield _export(lines, path, lambda: raw.tell() / size)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RunFileError(f"{path}: the compressed file is damaged or cut: {error}") from error
    except OSError as error:
        raise RunFileError(f"{path}: {error.strerror or error}") from error
    except csv.Error as error:
        raise RunFileError(f"{path} is no CSV file: {error}") from error


def _lines(raw: BufferedReader, path: Path) -> Lines:
    packed = raw.peek(2).startswith(_GZIP)
    return Lines(gzip.GzipFile(fileobj=raw) if packed else raw, path)


def _rows(lines: Lines) -> Iterator[list[str]]:
    for row in csv.reader(lines):
        lines.end_row()
        yield row


def _export(lines: Lines, path: Path, read_share: Callable[[], float]) -> Export:
    rows = _rows(lines)
    first = next(rows, None)
    if first is None:
        raise RunFileError(f"{path} is empty")
    names = [name.strip() for name in first]
    if "radio" not in names:
        if len(first) != len(COLUMNS):
            raise RunFileError(
                f"{path} is no cell export: its first line names no column radio, as separated by "
                "commas; claims of your own have cell,lat,lon"
            )
        return Export(
            chain([first], rows),
            {name: i for i, name in enumerate(COLUMNS)},
            len(COLUMNS),
            read_share,
        )
    if missing := [name for name in NEEDED if name not in names]:
        raise RunFileError(f"{path}: the header line has no column {', '.join(missing)}")
    return Export(
        rows, {name: names.index(name) for name in COLUMNS if name in names}, len(names), read_share
    )


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that could not be used, counted from the first below the header, with its text."""

    file: str
    row: int
    text: str


@dataclass(frozen=True, slots=True)
class Imported:
    """The result of an import: rows read, unusable and replaced, and cells now stored.

    `bad_rows` are the first twenty of each file.
    """

    path: Path
    n_rows: int
    n_bad: int
    n_replaced: int
    n_cells: int
    bad_rows: tuple[BadRow, ...]


def import_exports(
    files: Sequence[Path], target: Path, progress: Progress | None = None
) -> Imported:
    """Import exports into a database file, which is replaced at the end or not at all.

    `progress` shows hundredths of files. Raises `RunFileError`, and nothing has changed then.
    """
    if target.exists():
        with closing(open_celldb(target)):
            pass  # raises for a file that is something else
    counts, bad = Counter[str](), list[BadRow]()
    names = [path.name for path in files for _ in range(100)]
    try:
        with whole_file(target) as part:
            if target.exists():
                copyfile(target, part)
            with closing(sqlite3.connect(part, isolation_level=None)) as db:
                db.executescript(f"{_FAST}; PRAGMA application_id = {APPLICATION_ID}; {_TABLE}")
                db.executescript("DROP INDEX IF EXISTS identity; DROP INDEX IF EXISTS place")
                steps: Iterable[int] = _fill(db, files, counts, bad)
                for _ in progress(steps, "importing", len(names), names) if progress else steps:
                    pass
                db.executescript(f"{_IDENTITY}; {_PLACE}; {_TWICE}")
                n_replaced = db.execute(_OLDER).rowcount
                n_cells = db.execute("SELECT count(*) FROM cell").fetchone()[0]
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise RunFileError(f"cannot write {target}: {error}") from error
    return Imported(target, counts["rows"], counts["bad"], n_replaced, n_cells, tuple(bad))


def _fill(
    db: sqlite3.Connection, files: Sequence[Path], counts: Counter[str], bad: list[BadRow]
) -> Iterator[int]:
    """Yields once for each hundredth of a file."""
    for path in files:
        first = db.execute("SELECT coalesce(max(rowid), 0) FROM cell").fetchone()[0]
        with cell_export(path) as export:
            n_short = yield from _insert(db, export)
        read = db.execute("SELECT coalesce(max(rowid), 0) FROM cell").fetchone()[0] - first
        bad_rows = _without_bad(db, path, first)
        good = db.execute("SELECT count(*) FROM cell WHERE rowid > ?", (first,)).fetchone()[0]
        if not good:
            why = f"; its row {bad_rows[0].row} is {bad_rows[0].text}" if bad_rows else ""
            raise RunFileError(f"{path} has no usable row{why}")
        bad += bad_rows
        counts.update(rows=read + n_short, bad=read - good + n_short)


def _insert(db: sqlite3.Connection, export: Export) -> Generator[int, None, int]:
    width, done = export.width, 0
    known = [name for name in _KEPT if name in export.column]
    kept = itemgetter(*(export.column[name] for name in known))
    names = ", ".join(_STORED.get(name, name) for name in known)
    statement = f"INSERT INTO cell ({names}) VALUES ({', '.join('?' * len(known))})"  # noqa: S608 (our own names)
    n_short = [0]
    db.execute("BEGIN")
    for first in export.rows:
        some = chain([first], islice(export.rows, _BATCH))
        db.executemany(statement, map(kept, _of_width(some, width, n_short)))
        now = int(100.0 * export.read_share())
        yield from range(done, now)
        done = max(done, now)
    db.execute("COMMIT")
    yield from range(done, 100)
    return n_short[0]


def _of_width(rows: Iterable[list[str]], width: int, n_short: list[int]) -> Iterator[list[str]]:
    """Rows that are complete; of the others those that are not empty are counted."""
    for row in rows:
        if len(row) == width:
            yield row
        else:
            n_short[0] += bool(row)


def _without_bad(db: sqlite3.Connection, path: Path, first: int) -> list[BadRow]:
    """Delete rows that name no cell or no position; returns the first of them."""
    where = f"WHERE rowid > {first} AND NOT ({_GOOD})"
    columns = f"rowid - {first}, radio, mcc, net, area, cell, lon, lat"
    bad_rows = db.execute(f"SELECT {columns} FROM cell {where} LIMIT {_MOST_BAD}")  # noqa: S608 (numbers and our own text)
    bad = [
        BadRow(str(path), row[0], ",".join(str(value)[:24] for value in row[1:]))
        for row in bad_rows
    ]
    if bad:
        db.execute(f"DELETE FROM cell {where}")  # noqa: S608
    return bad
