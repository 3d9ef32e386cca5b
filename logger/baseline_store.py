"""A baseline that is changed: walks added and removed, cells trusted.

Each change is one transaction of SQLite with its rollback journal, so a program that is killed, or
a power cut, leaves the baseline before the change or after it. The file has no write-ahead log: it
can be copied to the device as one file.
"""

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from logger.baseline_file import APPLICATION_ID, VERSION, check_head, parts_of
from logger.core.errors import ConfigError, FieldLoggerError, RunFileError
from logger.core.runfile import sealing_of
from logger.walk_summary import WalkSummary

# heard, visit and heard_channel have what each walk contributes, so that a walk can be removed
# again; square_cell, square_rat, cell and cell_channel have the sums over all walks, from
# which lookups answer. SUMS computes the sums of what one walk touches anew.

TABLES = (
    """CREATE TABLE walk (
        id INTEGER PRIMARY KEY, digest TEXT NOT NULL UNIQUE, run_id TEXT NOT NULL,
        name TEXT NOT NULL, began_utc_ns INTEGER, n_readings INTEGER NOT NULL,
        n_squares INTEGER NOT NULL, n_cells INTEGER NOT NULL,
        seal TEXT) STRICT""",
    """CREATE TABLE cell (
        id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, rat TEXT NOT NULL,
        mcc TEXT NOT NULL, mnc TEXT NOT NULL, area TEXT NOT NULL, cid TEXT NOT NULL,
        n_walks INTEGER NOT NULL DEFAULT 0, n_scans INTEGER NOT NULL DEFAULT 0) STRICT""",
    "CREATE INDEX cell_identity ON cell (mcc, mnc, cid)",
    "CREATE INDEX cell_operator ON cell (mcc, mnc, rat)",
    """CREATE TABLE heard (
        walk INTEGER NOT NULL, cell INTEGER NOT NULL, square INTEGER NOT NULL,
        n_scans INTEGER NOT NULL, best_dbm REAL NOT NULL, sum_level INTEGER NOT NULL,
        sum_squares INTEGER NOT NULL, PRIMARY KEY (walk, cell, square)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX heard_where ON heard (cell, square)",
    """CREATE TABLE visit (
        walk INTEGER NOT NULL, square INTEGER NOT NULL, rat TEXT NOT NULL,
        PRIMARY KEY (walk, square, rat)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX visit_where ON visit (square, rat)",
    """CREATE TABLE heard_channel (
        walk INTEGER NOT NULL, cell INTEGER NOT NULL, channel INTEGER NOT NULL,
        code INTEGER NOT NULL,
        PRIMARY KEY (walk, cell, channel, code)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX heard_channel_where ON heard_channel (cell, channel, code)",
    """CREATE TABLE square_cell (
        square INTEGER NOT NULL, cell INTEGER NOT NULL, n_walks INTEGER NOT NULL,
        n_scans INTEGER NOT NULL, best_dbm REAL NOT NULL, least_best_dbm REAL NOT NULL,
        sum_level INTEGER NOT NULL, sum_squares INTEGER NOT NULL,
        PRIMARY KEY (square, cell)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX square_of_cell ON square_cell (cell, best_dbm)",
    """CREATE TABLE square_rat (
        square INTEGER NOT NULL, rat TEXT NOT NULL, n_walks INTEGER NOT NULL,
        PRIMARY KEY (square, rat)) STRICT, WITHOUT ROWID""",
    """CREATE TABLE cell_channel (
        cell INTEGER NOT NULL, channel INTEGER NOT NULL, code INTEGER NOT NULL,
        PRIMARY KEY (cell, channel, code)) STRICT, WITHOUT ROWID""",
    "CREATE TABLE trust (cell TEXT PRIMARY KEY, note TEXT NOT NULL) STRICT, WITHOUT ROWID",
    f"PRAGMA application_id = {APPLICATION_ID}",
    f"PRAGMA user_version = {VERSION}",
)

ADD = (
    """INSERT INTO square_cell
        SELECT square, cell, 1, n_scans, best_dbm, best_dbm, sum_level, sum_squares
        FROM heard WHERE walk = :walk
        ON CONFLICT DO UPDATE SET
            n_walks = n_walks + 1,
            n_scans = n_scans + excluded.n_scans,
            best_dbm = max(best_dbm, excluded.best_dbm),
            least_best_dbm = min(least_best_dbm, excluded.best_dbm),
            sum_level = sum_level + excluded.sum_level,
            sum_squares = sum_squares + excluded.sum_squares""",
    """INSERT INTO square_rat SELECT square, rat, 1 FROM visit WHERE walk = :walk
        ON CONFLICT DO UPDATE SET n_walks = n_walks + 1""",
    """INSERT OR IGNORE INTO cell_channel
        SELECT cell, channel, code FROM heard_channel WHERE walk = :walk""",
    """UPDATE cell SET n_walks = n_walks + 1, n_scans = n_scans + new.n
        FROM (SELECT cell, sum(n_scans) AS n FROM heard WHERE walk = :walk GROUP BY cell) AS new
        WHERE id = new.cell""",
)
"""Add the rows of a new walk to the sums."""

SEAL = "ALTER TABLE walk ADD COLUMN seal TEXT"
"""The digest that a run was sealed with, empty of one that was cut.

NULL of walks that an earlier version has added, whose `digest` is always that of the content.
"""

REMOVE = (
    """CREATE TEMP TABLE gone_heard AS
        SELECT DISTINCT cell, square FROM heard WHERE walk = :walk""",
    """CREATE TEMP TABLE gone_visit AS
        SELECT DISTINCT square, rat FROM visit WHERE walk = :walk""",
    """CREATE TEMP TABLE gone_channel AS
        SELECT DISTINCT cell, channel, code FROM heard_channel WHERE walk = :walk""",
    "DELETE FROM heard WHERE walk = :walk",
    "DELETE FROM visit WHERE walk = :walk",
    "DELETE FROM heard_channel WHERE walk = :walk",
    "DELETE FROM walk WHERE id = :walk",
    """DELETE FROM square_cell
        WHERE (square, cell) IN (SELECT square, cell FROM gone_heard)""",
    """INSERT INTO square_cell
        SELECT h.square, h.cell, count(*), sum(n_scans), max(best_dbm), min(best_dbm),
            sum(sum_level), sum(sum_squares)
        FROM gone_heard g JOIN heard h ON (h.cell, h.square) = (g.cell, g.square)
        GROUP BY h.square, h.cell""",
    """DELETE FROM square_rat WHERE (square, rat) IN (SELECT square, rat FROM gone_visit)""",
    """INSERT INTO square_rat
        SELECT v.square, v.rat, count(*)
        FROM gone_visit g JOIN visit v ON (v.square, v.rat) = (g.square, g.rat)
        GROUP BY v.square, v.rat""",
    """DELETE FROM cell_channel AS c WHERE
        (cell, channel, code) IN (SELECT cell, channel, code FROM gone_channel)
        AND NOT EXISTS (SELECT 1 FROM heard_channel AS h
            WHERE (h.cell, h.channel, h.code) = (c.cell, c.channel, c.code))""",
    """UPDATE cell SET
        n_walks = (SELECT count(DISTINCT walk) FROM heard WHERE cell = id),
        n_scans = (SELECT coalesce(sum(n_scans), 0) FROM square_cell WHERE cell = id)
        WHERE id IN (SELECT cell FROM gone_heard)""",
    "DELETE FROM cell WHERE n_walks = 0",
    "DROP TABLE gone_heard",
    "DROP TABLE gone_visit",
    "DROP TABLE gone_channel",
)
"""Take the rows of a walk away and compute the sums of what it touched anew."""


_PATIENCE_S = 10.0
"""For another program that changes the same baseline; one change takes some milliseconds."""
_SHORTEST_DIGEST = 6
"""Characters of a digest that name a walk; 16 million walks differ in as many."""
_LONGEST_NOTE = 200


@dataclass(frozen=True, slots=True)
class StoredWalk:
    """A walk of the baseline; `began_utc_ns` is None if no fix had a time."""

    id: int
    digest: str
    name: str
    began_utc_ns: int | None
    n_readings: int
    n_squares: int
    n_cells: int


class BaselineStore:
    """A baseline open for changes; `create` makes the file if there is none.

    Raises `RunFileError` for a file that is none or cannot be written.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self.path = path
        if not create and not path.is_file():
            raise RunFileError(f"{path}: no such file; `postproc baseline add` makes a baseline")
        with self._errors():
            mode = "rwc" if create else "rw"
            self._db = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={mode}",
                _PATIENCE_S,
                uri=True,
                isolation_level=None,
            )
        try:
            with self._errors():
                self._prepare()
        except BaseException:
            self._db.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the file."""
        self._db.close()

    def add(
        self, walk: WalkSummary, continues: Callable[[str], bool] = lambda _: False
    ) -> int | None:
        """Add a walk and return its number; None if it is in the baseline already.

        A part of it gives way: a walk that it continues, as `continues` says of a digest, or a
        damaged copy of it. Raises `RunFileError` if it may itself be a part of one that is there:
        both would count.
        """
        with self._change():
            if "seal" not in [row[1] for row in self._rows("PRAGMA table_info(walk)")]:
                self._db.execute(SEAL)
            known = "SELECT 1 FROM walk WHERE digest = ? OR (seal IS NULL AND digest = ?)"
            if self._rows(known, walk.digest, walk.content):
                return None
            same = "SELECT id, digest, seal FROM walk WHERE run_id = ?"
            for number, digest, seal in self._rows(same, walk.run_id):
                is_damaged_copy = walk.is_complete and bool(seal) and seal == walk.seal
                if is_damaged_copy or (seal is not None and continues(digest)):
                    self._remove(number)
                elif seal is None or not walk.is_complete:
                    raise RunFileError(
                        f"{walk.name} is another state of walk {number}; "
                        f"`postproc baseline remove {number}` it first"
                    )
            return self._insert(walk)

    def contradictions(self, walk: int) -> list[int]:
        """Numbers of other walks of the same run, of which only one can be as it was recorded."""
        with self._errors():
            same = "SELECT id FROM walk WHERE id != ? AND run_id = "
            same += "(SELECT run_id FROM walk WHERE id = ?) ORDER BY id"
            return [number for (number,) in self._rows(same, walk, walk)]

    def walks(self) -> list[StoredWalk]:
        """All walks in the order in which they were added."""
        with self._errors():
            columns = "id, digest, name, began_utc_ns, n_readings, n_squares, n_cells"
            rows = self._rows(f"SELECT {columns} FROM walk ORDER BY id")  # noqa: S608
            return [StoredWalk(*row) for row in rows]

    def walk_of(self, name: str) -> StoredWalk:
        """The walk with this number or beginning of a digest; raises `ConfigError`."""
        walks = self.walks()
        by_number = [walk for walk in walks if name == str(walk.id)]
        long_enough = len(name) >= _SHORTEST_DIGEST
        chosen = by_number or [
            walk for walk in walks if long_enough and walk.digest.startswith(name.lower())
        ]
        if len(chosen) != 1:
            raise ConfigError(
                f"{self.path} has {len(chosen) or 'no'} walk{'s' * (len(chosen) > 1)} {name!r}; "
                "`postproc baseline list` shows their numbers and digests"
            )
        return chosen[0]

    def remove(self, walks: Sequence[int]) -> None:
        """Remove walks by number; what is trusted stays."""
        with self._change():
            for walk in walks:
                self._remove(walk)

    def trust(self, cell: str, note: str) -> None:
        """Trust a cell, whether a walk has heard it or not, and store why.

        Raises `ConfigError` for a note that is empty or too long.
        """
        note = note.strip()
        if not 0 < len(note) <= _LONGEST_NOTE or not note.isprintable():
            raise ConfigError(f"a note is one line of 1 to {_LONGEST_NOTE} characters")
        with self._change():
            self._db.execute("INSERT OR REPLACE INTO trust VALUES (?, ?)", (cell, note))

    def distrust(self, cell: str) -> bool:
        """Trust a cell no longer; False if it was not trusted."""
        with self._change():
            return self._db.execute("DELETE FROM trust WHERE cell = ?", (cell,)).rowcount > 0

    def trusted_cells(self) -> dict[str, str]:
        """Notes of the trusted cells by name."""
        with self._errors():
            return dict(self._rows("SELECT cell, note FROM trust ORDER BY cell"))

    def n_cells(self) -> int:
        """Number of cells that any walk heard."""
        with self._errors():
            return int(self._rows("SELECT count(*) FROM cell")[0][0])

    def _prepare(self) -> None:
        self._db.execute("PRAGMA trusted_schema = OFF")
        self._db.execute("PRAGMA synchronous = FULL")
        if self._rows("SELECT count(*) FROM sqlite_schema")[0][0] == 0:
            with self._change():
                for statement in TABLES:
                    self._db.execute(statement)
        check_head(self.path, self._db)

    def _remove(self, walk: int) -> None:
        for statement in REMOVE:
            self._db.execute(statement, {"walk": walk} if ":walk" in statement else {})

    def _insert(self, walk: WalkSummary) -> int:
        row = (walk.digest, walk.run_id, walk.name, walk.began_utc_ns, walk.n_readings)
        number = self._db.execute(
            "INSERT INTO walk VALUES (NULL, ?, ?, ?, ?, ?, ?, ?, ?)",
            (*row, walk.n_squares, len(walk.cells), walk.seal),
        ).lastrowid
        if number is None:
            raise RunFileError(f"{self.path}: no number for the walk")
        cell = self._cell_numbers(walk)
        self._db.executemany(
            "INSERT INTO heard VALUES (?, ?, ?, ?, ?, ?, ?)",
            [(number, cell[row.cell], row.square, *row[2:]) for row in walk.heard],
        )
        self._db.executemany(
            "INSERT INTO visit VALUES (?, ?, ?)", [(number, *visit) for visit in walk.visits]
        )
        self._db.executemany(
            "INSERT INTO heard_channel VALUES (?, ?, ?, ?)",
            [(number, cell[name], channel, code) for name, channel, code in walk.channels],
        )
        for statement in ADD:
            self._db.execute(statement, {"walk": number})
        return number

    def _cell_numbers(self, walk: WalkSummary) -> dict[str, int]:
        self._db.executemany(
            "INSERT OR IGNORE INTO cell (name, rat, mcc, mnc, area, cid) VALUES (?, ?, ?, ?, ?, ?)",
            [(name, rat, *parts_of(name)) for name, rat in walk.cells.items()],
        )
        numbers: dict[str, int] = {}
        for name in walk.cells:
            ((numbers[name],),) = self._rows("SELECT id FROM cell WHERE name = ?", name)
        return numbers

    @contextmanager
    def _change(self) -> Iterator[None]:
        """One change, completely or not at all."""
        with self._errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise

    def _rows(self, statement: str, *values: object) -> list[Any]:
        return self._db.execute(statement, values).fetchall()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Errors of SQLite as `RunFileError`."""
        try:
            yield
        except sqlite3.Error as error:
            if "locked" in str(error):
                raise RunFileError(
                    f"{self.path} is being changed by another program; try again when it has ended"
                ) from error
            raise RunFileError(f"{self.path}: {error}") from error
        except UnicodeDecodeError as error:
            raise RunFileError(f"{self.path} is damaged: {error}") from error


CONTRADICTION = (
    "{} says that it is the same run and differs: one of them was changed and sealed anew. Both "
    "count; the digest that was noted at the stop shows which is genuine"
)


@dataclass(frozen=True, slots=True)
class Added:
    """What became of a file: added as a walk, in the baseline already, or unusable.

    `walk` is the number of the walk that was added, `problem` why none was; `remark` says of one
    that was added what contradicts it.
    """

    path: Path
    walk: int | None = None
    digest: str = ""
    n_readings: int = 0
    n_squares: int = 0
    n_cells: int = 0
    is_known: bool = False
    problem: str = ""
    remark: str = ""


def add_walk(store: BaselineStore, path: Path, outcome: WalkSummary | FieldLoggerError) -> Added:
    """Add the walk of a run, or say why there is none; durable on return."""
    try:
        if isinstance(outcome, FieldLoggerError):
            raise outcome
        number = store.add(outcome, lambda earlier: sealing_of(path, earlier).continues)
        others = [] if number is None else store.contradictions(number)
    except FieldLoggerError as error:
        return Added(path, problem=str(error))
    counts = outcome.n_readings, outcome.n_squares, len(outcome.cells)
    remark = CONTRADICTION.format(f"walk {others[0]}") if others else ""
    return Added(path, number, outcome.digest, *counts, is_known=number is None, remark=remark)
