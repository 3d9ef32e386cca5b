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

from logger.baseline_file import BaselineFile, check_head, parts_of
from logger.core.errors import ConfigError, RunFileError
from postproc.baseline import schema
from postproc.baseline.walk_summary import WalkSummary

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
                self._db.execute(schema.SEAL)
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
                for statement in schema.TABLES:
                    self._db.execute(statement)
        check_head(self.path, self._db)

    def _remove(self, walk: int) -> None:
        for statement in schema.REMOVE:
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
        for statement in schema.ADD:
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


def baseline_without(path: Path, digests: Sequence[str]) -> BaselineFile:
    """A baseline for reading as if the walks with these digests were not in it.

    A walk that is compared with earlier ones must not be among them. The file is not changed: the
    walks are removed from a copy in memory, which is made only if one of them is there. Raises
    `RunFileError`.
    """
    baseline = BaselineFile(path)
    own = baseline.numbers_of(digests)
    if not own:
        return baseline
    memory = sqlite3.connect(":memory:", isolation_level=None)
    try:
        baseline.copy_to(memory)
        for walk in own:
            for statement in schema.REMOVE:
                memory.execute(statement, {"walk": walk} if ":walk" in statement else {})
        return BaselineFile(path, memory)
    except sqlite3.Error as error:
        memory.close()
        raise RunFileError(f"{path} cannot be read as a baseline: {error}") from error
    finally:
        baseline.close()
