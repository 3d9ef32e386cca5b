"""Exports of OpenCelliD and Mozilla Location Service, row by row and into a cell database.

Fourteen columns, longitude before latitude, the same in both: radio, mcc, net, area, cell, unit,
lon, lat, range, samples, changeable, created, updated, averageSignal. The world file and all of
Mozilla's have that header line, country files have none; lines end in LF or CRLF; any may be
gzipped. Where there is a header its names count, not its order. Source: mozilla/ichnaea,
docs/import_export.rst, and wiki.opencellid.org, Menu map view.
"""

import csv
import gzip
import sqlite3
import zlib
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from io import BufferedReader
from itertools import chain, islice
from operator import itemgetter
from pathlib import Path
from shutil import copyfile
from typing import NamedTuple

from logger.core.errors import RunFileError
from logger.core.foreign import check_regular, open_regular
from postproc.atomic_write import whole_file
from postproc.foreign_file import Lines
from postproc.verification.celldb import APPLICATION_ID, BELT, open_celldb

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


class Export(NamedTuple):
    """Rows of text, the index of each known column, and the share of the file read so far."""

    rows: Iterator[list[str]]
    column: dict[str, int]
    width: int
    read_share: Callable[[], float]


@contextmanager
def cell_export(path: Path) -> Iterator[Export]:
    """Open an export.

    Raises `RunFileError` for a file that cannot be read, is damaged, or is no such export.
    """
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
                f"{path} is no cell export: it has {len(first)} columns and no header line"
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


class CellImport:
    """Import of exports into a database file, which is replaced at the end or not at all."""

    def __init__(self, files: list[Path], target: Path) -> None:
        self.files, self.target = files, target
        self.imported: Imported | None = None
        if target.exists():
            with closing(open_celldb(target)):
                pass  # raises for a file that is something else

    def __iter__(self) -> Iterator[int]:
        """Do it; yields once for each hundredth of a file.

        Raises `RunFileError`, and nothing has changed then.
        """
        try:
            with whole_file(self.target) as part:
                if self.target.exists():
                    copyfile(self.target, part)
                with closing(sqlite3.connect(part, isolation_level=None)) as db:
                    db.executescript(f"{_FAST}; PRAGMA application_id = {APPLICATION_ID}; {_TABLE}")
                    db.executescript("DROP INDEX IF EXISTS identity; DROP INDEX IF EXISTS place")
                    yield from self._fill(db)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise RunFileError(f"cannot write {self.target}: {error}") from error

    def _fill(self, db: sqlite3.Connection) -> Iterator[int]:
        bad: list[BadRow] = []
        n_rows = n_bad = 0
        for path in self.files:
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
            n_rows, n_bad = n_rows + read + n_short, n_bad + read - good + n_short
        db.executescript(f"{_IDENTITY}; {_PLACE}; {_TWICE}")
        n_replaced = db.execute(_OLDER).rowcount
        n_cells = db.execute("SELECT count(*) FROM cell").fetchone()[0]
        self.imported = Imported(self.target, n_rows, n_bad, n_replaced, n_cells, tuple(bad))


def _insert(db: sqlite3.Connection, export: Export) -> Generator[int, None, int]:
    """Insert texts, which SQLite converts to numbers; returns the number of short rows."""
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
