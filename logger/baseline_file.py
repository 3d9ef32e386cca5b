"""A baseline in an SQLite file, read only: on the device and at the desktop.

`logger.baseline_store` makes the file. Answers come from tables that contain the sums over all
walks, so a lookup takes as long after 1000 walks as after one.
"""

import sqlite3
from collections.abc import Mapping
from contextlib import closing
from hashlib import sha256
from math import sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any

from logger.core.baseline import (
    CELL,
    CHANNELS,
    DOUBT,
    SQUARE,
    TRUST,
    Baseline,
    HeardInSquare,
    KnownCell,
    SquareHistory,
)
from logger.core.cell_names import FEWEST_SCANS
from logger.core.errors import RunFileError
from logger.core.latest import Latest
from logger.core.live_settings import OFF, OWN
from logger.sqlite_file import connect

APPLICATION_ID = 0x43574241
"""'CWBA' in the head of the file."""
VERSION = 1
UNKNOWN = -1
"""A channel number or code that no modem printed; NULL cannot be in a key."""
SCALE = 100
"""Sums of levels are in hundredths of a dB: integers do not depend on their order."""

OWN_FILE = "own-baseline.db"
"""That of the device itself, in the folder of its runs (`logger.own_baseline`)."""

_MOST_KEPT = 128
"""Answers of each kind: the cells and squares around a walker."""
_MOST_BYTES, _MOST_KEPT_BYTES = 16 << 20, 64 << 10
"""Of the names of all walks, 100 000, and of an answer that is kept: 500 cells in a square."""
_ROW_BYTES = 100
"""Of a row of numbers; its texts come in addition."""
LONGEST_NS = 86_400_000_000_000  # a day, and no walk is longer: a copy begins within it
NEAR = (
    "SELECT id, digest, marks, is_copy FROM walk JOIN mark ON walk = id "  # noqa: S608
    f"WHERE run_id != ? AND began_utc_ns - ? BETWEEN -{LONGEST_NS} AND {LONGEST_NS}"
)

_HEAP_BYTES, _LONGEST_BYTES = 16 << 20, 64 << 10
"""What SQLite may use in the recorder, which has little memory, and of a value."""


def configured_file(name: str, folder: Path) -> Path | None:
    """The file that `LiveSettings.baseline` names, with runs in `folder`; None for none.

    The device's own begins with the end of its first run.
    """
    if name == OWN:
        path = folder / OWN_FILE
        return path if path.exists() else None
    return None if name in {"", OFF} else Path(name)


def bound_heap() -> None:
    """Bound the memory of SQLite in this process from now on."""
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute(f"PRAGMA hard_heap_limit = {_HEAP_BYTES}")


class BaselineFile(Baseline):
    """A baseline in a file.

    Raises `RunFileError`, also later where the file is damaged inside.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._db = _open(path)
        self._kept = {kind: Latest[Any](_MOST_KEPT) for kind in (SQUARE, CELL, CHANNELS)}
        try:
            self._read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the file."""
        self._db.close()

    def ask(self, kind: str, key: Any) -> Any:
        if kind == TRUST:
            return self._trust.get(key)
        if kind == DOUBT:
            return key in self._doubted
        kept, name = self._kept[kind], str(key)
        if name not in kept:
            try:
                kept.put(name, self._read_answer(kind, key))
            except (TypeError, ValueError, ArithmeticError) as error:  # no value of ours
                raise RunFileError(_reason(self.path, error)) from error
        return kept[name]

    def _read_answer(self, kind: str, key: Any) -> Any:
        if kind == SQUARE:
            return self._read_square(key)
        return self._read_cell(key) if kind == CELL else self._read_channels(*key)

    def _read_doubted(self) -> frozenset[str]:
        if not self._all_rows("SELECT 1 FROM sqlite_master WHERE name = 'doubted'"):
            return frozenset()  # only the device's own has such
        return frozenset([str(cell) for (cell,) in self._all_rows("SELECT cell FROM doubted")])

    def _read_square(self, square: int) -> SquareHistory:
        walks = self._rows("SELECT rat, n_walks FROM square_rat WHERE square = ?", square)
        cells = self._rows(
            "SELECT name, s.n_walks, s.n_scans, s.best_dbm, least_best_dbm, sum_level, sum_squares "
            "FROM square_cell s JOIN cell ON id = s.cell WHERE square = ? AND cell.n_scans >= ? "
            "ORDER BY name",
            square,
            FEWEST_SCANS,
        )
        heard = {row[0]: _square_row(*row[1:]) for row in cells}
        return SquareHistory(square, MappingProxyType(dict(walks)), MappingProxyType(heard))

    def _read_cell(self, name: str) -> KnownCell | None:
        cells = self._rows(
            "SELECT id, rat, n_walks, n_scans FROM cell WHERE name = ? AND n_scans >= ?",
            name,
            FEWEST_SCANS,
        )
        if not cells:
            return None
        number, rat, n_walks, n_scans = cells[0]
        ((n_squares,),) = self._rows("SELECT count(*) FROM square_cell WHERE cell = ?", number)
        ((best_dbm,),) = self._rows(
            "SELECT best_dbm FROM square_cell WHERE cell = ? ORDER BY best_dbm DESC LIMIT 1", number
        )
        pairs = self._rows("SELECT channel, code FROM cell_channel WHERE cell = ?", number)
        channels = frozenset((_or_none(channel), _or_none(code)) for channel, code in pairs)
        return KnownCell(name, rat, n_walks, n_scans, n_squares, best_dbm, channels)

    def _read_channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        rows = self._rows(
            "SELECT channel, count(DISTINCT cell) FROM cell JOIN cell_channel ON cell = id "
            "WHERE (mcc, mnc, rat) = (?, ?, ?) AND channel != ? AND n_scans >= ? "
            "GROUP BY channel ORDER BY channel",
            mcc,
            mnc,
            rat,
            UNKNOWN,
            FEWEST_SCANS,
        )
        return MappingProxyType(dict(rows))

    def marks_near(self, began_utc_ns: int | None) -> dict[str, bytes]:
        """Marks of walks that began within a day, by digest."""
        if not self._all_rows("SELECT 1 FROM sqlite_master WHERE name = 'mark'"):
            return {}  # of an earlier version
        rows = self._rows(NEAR, "", began_utc_ns, most_bytes=_MOST_BYTES)
        return {digest: marks for _, digest, marks, _ in rows}

    def _read(self) -> None:
        trust = self._all_rows("SELECT cell, note FROM trust ORDER BY cell")
        self._trust: dict[str, str] = dict(trust)
        self._doubted = self._read_doubted()
        self.digests = [
            str(row[0]) for row in self._all_rows("SELECT digest FROM walk ORDER BY digest")
        ]
        self.n_walks = len(self.digests)
        answered: tuple[object, ...] = (self.digests, list(self._trust.items()))
        if self._doubted:  # without any it is that of a file which cannot have them
            answered += (sorted(self._doubted),)
        self.fingerprint = sha256(repr(answered).encode()).hexdigest()

    def _all_rows(self, statement: str) -> list[Any]:
        return self._rows(statement, most_bytes=_MOST_BYTES)

    def _rows(
        self, statement: str, *values: object, most_bytes: int = _MOST_KEPT_BYTES
    ) -> list[Any]:
        rows: list[Any] = []
        try:
            for row in self._db.execute(statement, values):
                texts = (value for value in row if isinstance(value, str | bytes))
                most_bytes -= _ROW_BYTES + sum(len(text) for text in texts)
                rows.append(row)
                if most_bytes < 0:
                    break
        except (sqlite3.Error, ValueError, OverflowError, MemoryError) as error:  # no text, no end
            raise RunFileError(_reason(self.path, error)) from error
        if most_bytes < 0:
            raise RunFileError(f"{self.path} has more rows than walks can have")
        return rows


def check_head(path: Path, database: sqlite3.Connection) -> None:
    """Raise `RunFileError` unless the database is a baseline of this version."""
    ((application,),) = database.execute("PRAGMA application_id").fetchall()
    ((version,),) = database.execute("PRAGMA user_version").fetchall()
    if application != APPLICATION_ID:
        raise RunFileError(f"{path} is no baseline; `postproc baseline add` makes one")
    if version != VERSION:
        raise RunFileError(
            f"{path} is a baseline of version {version}, this program reads version {VERSION}"
        )


def _open(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise RunFileError(f"{path}: no such file; `postproc baseline add` makes a baseline")
    try:
        database = connect(path, check=lambda database: check_head(path, database))
    except (sqlite3.Error, ValueError, MemoryError) as error:
        raise RunFileError(_reason(path, error)) from error
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror}") from error
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_BYTES)
    return database


def _reason(path: Path, error: Exception) -> str:
    if path.with_name(f"{path.name}-journal").exists():
        return (
            f"{path} was left in the middle of a change; "
            f"`postproc baseline list --baseline {path}` restores it"
        )
    why = str(error) or "it takes too much memory"
    return f"{path} cannot be read as a baseline: {why}"


def _square_row(
    n_walks: int,
    n_scans: int,
    best_dbm: float,
    least_best_dbm: float,
    sum_level: int,
    sum_squares: int,
) -> HeardInSquare:
    mean = sum_level / n_scans
    # integers, so that equal levels have no variance
    variance = max(n_scans * sum_squares - sum_level**2, 0) / n_scans**2
    return HeardInSquare(
        n_walks, n_scans, best_dbm, least_best_dbm, mean / SCALE, sqrt(variance) / SCALE
    )


def _or_none(value: int) -> int | None:
    return None if value == UNKNOWN else value
