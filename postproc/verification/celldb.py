"""Cells of OpenCelliD and Mozilla exports in one indexed SQLite file.

A cell stands in it once: of several rows of one identity the one last updated is kept. Places are
found by belts of a hundredth of a degree of latitude, in each of which the index is ordered by
longitude. A database tells where cells were seen by others, not which cells there are: absence is
never an alarm by itself.
"""

import sqlite3
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import chain, islice
from math import cos, floor, radians
from operator import itemgetter
from pathlib import Path
from shutil import copyfile
from typing import Any

import numpy as np
from pyproj import Geod

from logger.core.errors import ConfigError, RunFileError
from logger.core.geo import check_position
from postproc.atomic_write import whole_file
from postproc.sqlite_file import connected
from postproc.verification.cell_export import Export, cell_export
from postproc.verification.parsing import identity_of

FARTHEST_M = 200_000.0

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
_BELTS_PER_DEG = 100
_METRES_PER_DEG = 110_500.0
_MOST_BAD = 20
_BATCH = 20_000
_SHORT_CID = 1 << 16
_APPLICATION = 0x43574442
_GEOD = Geod(ellps="WGS84")
_FAST = "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA cache_size = -200000; PRAGMA threads = 4"
_TABLE = """CREATE TABLE IF NOT EXISTS cell (
    radio TEXT, mcc INTEGER, net INTEGER, area INTEGER, cell INTEGER, lon REAL, lat REAL,
    unit INTEGER, range_m INTEGER, samples INTEGER, changeable INTEGER, updated_s INTEGER)"""
_IDENTITY = "CREATE INDEX identity ON cell (mcc, net, area, cell)"
_BELT = "CAST((lat + 90) * 100 AS INTEGER)"
_FIELDS = "radio, mcc, net, area, cell, lat, lon, range_m, samples, updated_s"
# all that is asked for is in the index: neighbours on the ground lie anywhere in the table, a page
# of the disk each
_PLACE = f"CREATE INDEX place ON cell ({_BELT}, lon, lat, radio, mcc, net, area, cell, range_m, samples, updated_s)"
_GOOD = """radio IN ('GSM', 'CDMA', 'UMTS', 'LTE', 'NR') AND typeof(mcc) = 'integer' AND mcc BETWEEN 1 AND 999
    AND typeof(net) = 'integer' AND net BETWEEN 0 AND 65535
    AND typeof(area) = 'integer' AND area BETWEEN 0 AND 16777215
    AND typeof(cell) = 'integer' AND cell BETWEEN 0 AND 68719476735
    AND typeof(lat) = 'real' AND lat BETWEEN -90 AND 90 AND typeof(lon) = 'real' AND lon BETWEEN -180 AND 180"""
"""CDMA counts its system identity, up to 65535, as net."""
_TWICE = """CREATE TEMP TABLE twice AS
    SELECT mcc, net, area, cell FROM cell GROUP BY mcc, net, area, cell HAVING count(*) > 1"""
_OLDER = """DELETE FROM cell WHERE rowid IN (SELECT id FROM (
    SELECT c.rowid AS id, row_number() OVER (
        PARTITION BY c.radio, c.mcc, c.net, c.area, c.cell ORDER BY CAST(c.updated_s AS INTEGER) DESC, c.rowid DESC
    ) AS n
    FROM twice t JOIN cell c ON (c.mcc, c.net, c.area, c.cell) = (t.mcc, t.net, t.area, t.cell)) WHERE n > 1)"""


@dataclass(frozen=True, slots=True)
class DbCell:
    """A cell of the database: identity, place, range and number of observations, when it was last
    updated (Unix time).

    `distance_m` is that from the place asked for, None where an identity was. `short_cid` tells
    that only the lower 16 bits of the identity are those asked for, which is all that some 3G
    modems print.
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


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that could not be used, counted from the first below the header, as it stands in the
    file.
    """

    file: str
    row: int
    text: str


@dataclass(frozen=True, slots=True)
class Imported:
    """What an import did: rows read, unusable, and replaced by a newer one of the same identity;
    cells now there.

    `bad_rows` are the first twenty of each file.
    """

    path: Path
    n_rows: int
    n_bad: int
    n_replaced: int
    n_cells: int
    bad_rows: tuple[BadRow, ...]


class CellImport:
    """Import of exports into a database file, which is replaced whole at the end or not at all."""

    def __init__(self, files: list[Path], target: Path) -> None:
        self.files, self.target = files, target
        self.imported: Imported | None = None
        if target.exists():
            with closing(_connected(target)):
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
                    db.executescript(f"{_FAST}; PRAGMA application_id = {_APPLICATION}; {_TABLE}")
                    db.executescript("DROP INDEX IF EXISTS identity; DROP INDEX IF EXISTS place")
                    yield from self._filled(db)
        except sqlite3.Error as error:
            raise RunFileError(f"cannot write {self.target}: {error}") from error

    def _filled(self, db: sqlite3.Connection) -> Iterator[int]:
        bad: list[BadRow] = []
        n_rows = n_bad = 0
        for path in self.files:
            first = db.execute("SELECT coalesce(max(rowid), 0) FROM cell").fetchone()[0]
            with cell_export(path) as export:
                n_short = yield from _inserted(db, export)
            read = db.execute("SELECT coalesce(max(rowid), 0) FROM cell").fetchone()[0] - first
            found = _without_bad(db, path, first)
            good = db.execute("SELECT count(*) FROM cell WHERE rowid > ?", (first,)).fetchone()[0]
            if not good:
                why = f"; its row {found[0].row} is {found[0].text}" if found else ""
                raise RunFileError(f"{path} has no usable row{why}")
            bad += found
            n_rows, n_bad = n_rows + read + n_short, n_bad + read - good + n_short
        db.executescript(f"{_IDENTITY}; {_PLACE}; {_TWICE}")
        n_replaced = db.execute(_OLDER).rowcount
        n_cells = db.execute("SELECT count(*) FROM cell").fetchone()[0]
        self.imported = Imported(self.target, n_rows, n_bad, n_replaced, n_cells, tuple(bad))


def _inserted(db: sqlite3.Connection, export: Export) -> Generator[int, None, int]:
    """Insert texts, which SQLite makes numbers of where they are; returns how many rows were too
    short to be any.
    """
    width, done = export.width, 0
    known = [name for name in _KEPT if name in export.column]
    kept = itemgetter(*(export.column[name] for name in known))
    names = ", ".join(_STORED.get(name, name) for name in known)
    statement = f"INSERT INTO cell ({names}) VALUES ({', '.join('?' * len(known))})"  # noqa: S608 (our own names)
    odd: list[int] = []
    db.execute("BEGIN")
    for first in export.rows:
        some = chain([first], islice(export.rows, _BATCH))
        db.executemany(statement, map(kept, _of_width(some, width, odd)))
        now = int(100.0 * export.read_share())
        yield from range(done, now)
        done = max(done, now)
    db.execute("COMMIT")
    yield from range(done, 100)
    return len(odd) - odd.count(0)


def _of_width(rows: Iterable[list[str]], width: int, odd: list[int]) -> Iterator[list[str]]:
    """Rows that are whole; the lengths of others are noted."""
    for row in rows:
        if len(row) == width:
            yield row
        else:
            odd.append(len(row))


def _without_bad(db: sqlite3.Connection, path: Path, first: int) -> list[BadRow]:
    """Delete rows that name no cell or no place; returns the first of them."""
    where = f"WHERE rowid > {first} AND NOT ({_GOOD})"
    columns = f"rowid - {first}, radio, mcc, net, area, cell, lon, lat"
    found = db.execute(f"SELECT {columns} FROM cell {where} LIMIT {_MOST_BAD}")  # noqa: S608 (numbers and our own text)
    bad = [
        BadRow(str(path), row[0], ",".join(str(value)[:24] for value in row[1:])) for row in found
    ]
    if bad:
        db.execute(f"DELETE FROM cell {where}")  # noqa: S608
    return bad


class CellDb:
    """A database open for reading; raises `RunFileError` for a file that is none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._db = _connected(path)

    def __len__(self) -> int:
        return int(self._db.execute("SELECT count(*) FROM cell").fetchone()[0])

    def close(self) -> None:
        """Release the file."""
        self._db.close()

    def by_identity(self, name: str) -> list[DbCell]:
        """Cells with the identity `mcc-mnc-area-cid`, of any radio; raises `ConfigError` for what
        is no identity.

        Where there is none, cells of the area whose lower 16 bits are those of a short identity.
        """
        identity = identity_of(name)
        if identity is None:
            raise ConfigError(
                f"{name!r} is no cell: mcc-mnc-area-cid is wanted, like 262-01-801-86355"
            )
        same = "mcc = ? AND net = ? AND area = ?"
        found = self._cells(f"{same} AND cell = ?", identity)
        if found or identity[3] >= _SHORT_CID:
            return found
        short = self._cells(f"{same} AND cell & 65535 = ? AND radio = 'UMTS'", identity)
        return [replace(cell, short_cid=True) for cell in short]

    def near(
        self, lat_deg: float, lon_deg: float, radius_m: float, most: int = 100
    ) -> list[DbCell]:
        """Cells within a radius, nearest first; raises `ConfigError` for a radius beyond 200 km,
        `GeoError`.
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
        for low, high in _wrapped(lon_deg, reach_deg / narrowest):
            for belt in belts:
                inside += self._cells(f"{_BELT} = ? AND lon BETWEEN ? AND ?", (belt, low, high))
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
        try:
            rows = self._db.execute(f"SELECT {_FIELDS} FROM cell WHERE {where}", values).fetchall()  # noqa: S608
        except sqlite3.Error as error:
            raise RunFileError(f"{self.path}: {error}") from error
        return [
            DbCell(*row[:7], *(v if isinstance(v, int) else None for v in row[7:])) for row in rows
        ]


def is_celldb(path: Path) -> bool:
    """Whether the file is an SQLite database."""
    try:
        with path.open("rb") as file:
            return file.read(16) == b"SQLite format 3\0"
    except OSError:
        return False


def _connected(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise RunFileError(f"{path}: no such file")
    try:
        db = connected(path)
        if db.execute("PRAGMA application_id").fetchone()[0] != _APPLICATION:
            db.close()
            raise RunFileError(f"{path} is no cell database; `postproc celldb import` makes one")
    except sqlite3.Error as error:
        raise RunFileError(f"{path} is no cell database: {error}") from error
    return db


def _belt(lat_deg: float) -> int:
    return floor((min(max(lat_deg, -90.0), 90.0) + 90.0) * _BELTS_PER_DEG)


def _wrapped(lon_deg: float, reach_deg: float) -> list[tuple[float, float]]:
    """Intervals of longitude, two where they cross the date line."""
    low, high = lon_deg - reach_deg, lon_deg + reach_deg
    if reach_deg >= 180.0:
        return [(-180.0, 180.0)]
    if low < -180.0:
        return [(-180.0, high), (low + 360.0, 180.0)]
    if high > 180.0:
        return [(low, 180.0), (-180.0, high - 360.0)]
    return [(low, high)]
