"""A baseline that is changed: walks added and removed, cells trusted.

Each change is one SQLite transaction with its rollback journal: a killed program or a power cut
leaves the baseline before or after it. Without a write-ahead log one file is copied to the device.
"""

import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from shlex import quote
from typing import Any, NamedTuple, Self

import numpy as np

from logger.baseline_file import (
    APPLICATION_ID,
    NEAR,
    SCALE,
    UNKNOWN,
    VERSION,
    BaselineFile,
    check_head,
)
from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.baseline import SQUARE_M, squares_of
from logger.core.errors import ConfigError, FieldLoggerError, RunFileError, why_not_written
from logger.core.places import track_of
from logger.core.readings import places_of, times_ns
from logger.core.rows import Rows, levels_dbm
from logger.core.runfile import Run, sealing_of
from logger.core.runfile.meta import is_import, may_be_copy
from logger.core.timebase import fit_run
from logger.core.types import UNKNOWN_ID, UNKNOWN_TIME

FARTHEST_SIGMA_M = SQUARE_M / 2.0
"""A reading with a less sure position belongs to no square."""

# 2 kB: a copy of a twentieth of a walk still has a dozen
_MOST_MARKS, _FEWEST_COMMON = 256, 8
_SHARE_OF_COPY = 0.8  # all but those at the turn of a second, which the other clock may exchange


def _numbers_in(name: str) -> Sequence[str]:
    """MCC, MNC, area and CID of a written name; four empty ones for an imported label."""
    numbers = name.split("-")
    return numbers if len(numbers) == 4 else [""] * 4


class HeardRow(NamedTuple):
    """A cell in a square: scans, strongest level, and sums of the levels in 0.01 dB."""

    square: int
    cell: str
    n_scans: int
    best_dbm: float
    sum_level: int
    sum_squares: int


@dataclass(frozen=True, slots=True)
class WalkSummary:
    """A walk by square.

    `digest` says which walk it is, in whatever file (`walk_digest`); `content` is the digest of its
    content, `seal` what it was sealed with. `is_complete` is false of a run that was cut or lacks
    frames. `cells` has the technology of each cell, `visits` the squares in which cells of a
    technology were named. `channels` are (cell, channel number, code), `UNKNOWN` where not printed.
    `began_utc_ns` is None if no fix had a time. `marks` show a copy (`marks_of`).
    """

    digest: str
    run_id: str
    name: str
    began_utc_ns: int | None
    n_readings: int
    cells: dict[str, str]
    heard: list[HeardRow]
    visits: list[tuple[int, str]]
    channels: list[tuple[str, int, int]]
    content: str = ""
    seal: str = ""
    is_complete: bool = True
    marks: bytes = b""
    is_copy: bool = False

    @property
    def n_squares(self) -> int:
        """Number of squares in which a cell was heard."""
        return len({square for square, _ in self.visits})


def summarise_walk(run: Run) -> WalkSummary:
    """Cells and levels of a run by square.

    A reading counts if its cell is named without doubt and has a level and a position; of several
    in one scan the strongest counts. Raises as `track_of` for a run without a position.
    """
    fixes, readings = run.tables["fixes"], run.tables["readings"]
    squares, usable = _squares(fixes, run.tables["scans"], readings)
    rows, square = readings[usable], squares[usable]
    names, cell = np.unique(rows["cell"], return_inverse=True)
    first = np.unique(cell, return_index=True)[1]
    cells = [name.decode() for name in names]
    rats = [rat.decode() for rat in rows["rat"][first]]
    return WalkSummary(
        digest=walk_digest(run),
        run_id=run.meta.run_id,
        name=run.path.name,
        began_utc_ns=began_utc_ns(run),
        n_readings=len(rows),
        cells=dict(zip(cells, rats, strict=True)),
        heard=rows_by_square(square, cell, rows["seq"], levels_dbm(rows), cells),
        visits=sorted({(int(s), rats[c]) for s, c in set(zip(square.tolist(), cell, strict=True))}),
        channels=channels_heard(rows, cell, cells),
        content=content_digest(fixes, readings),
        seal=run.end.digest if run.end else "",
        is_complete=run.is_complete,
        marks=marks_of(run),
        is_copy=may_be_copy(run.meta.origin),
    )


def began_utc_ns(run: Run) -> int | None:
    """The first time of a run's fixes."""
    utc_ns = run.tables["fixes"]["utc_ns"]
    times = utc_ns[utc_ns != UNKNOWN_TIME]
    return int(times[0]) if len(times) else None


def marks_of(run: Run) -> bytes:
    """Smallest hashes of readings with their second of UTC; a copy has them too."""
    # of a copy to share the number, the digest and the zero of time are others, of exported levels
    # that were imported the positions too, and some formats have no channels
    fixes, readings = run.tables["fixes"], run.tables["readings"]
    base = fit_run(run.meta.origin, fixes)
    if base is None or not len(readings):
        return b""
    level_dbm = levels_dbm(readings)
    second = base.utc_ns_array(times_ns(run.tables["scans"], readings)) // 10**9
    state = np.zeros(len(readings), np.uint64)
    for values in (second, readings["cid"], level_dbm):
        is_real = values.dtype.kind == "f"
        bits = values.astype(np.float64 if is_real else np.int64).view(np.uint64)
        state = (state ^ bits) * np.uint64(0x9E3779B97F4A7C15)  # 2^64 by the golden ratio
        state ^= state >> np.uint64(32)
    return np.unique(state[np.isfinite(level_dbm)])[:_MOST_MARKS].astype("<u8").tobytes()


def is_same_walk(marks: bytes, others: bytes) -> bool:
    """Whether most readings of one of two walks are in the other."""
    one, other = (np.frombuffer(part, "<u8") for part in (marks, others))
    # of a walk with more readings nothing is known above its last mark
    last = min((part[-1] for part in (one, other) if len(part) == _MOST_MARKS), default=None)
    if last is not None:
        one, other = one[one <= last], other[other <= last]
    # modems that share a receiver have few levels in common, and logs that overlap are no copies
    n = len(np.intersect1d(one, other))
    return n >= _FEWEST_COMMON and n > _SHARE_OF_COPY * min(len(one), len(other))


def walk_digest(run: Run) -> str:
    """Which walk a run is: the digest of its hash chain, or of its content.

    Content identifies an import, whose chain is another each time, and a run that lacks frames.
    """
    is_part = run.end is not None and not run.is_complete
    if is_import(run.meta.origin) or is_part or not run.digest:
        return content_digest(run.tables["fixes"], run.tables["readings"])
    return run.digest


def content_digest(fixes: Rows, readings: Rows) -> str:
    """SHA-256 of the times, positions, names and levels of a walk."""
    state = sha256()
    for values in (fixes["t_ns"], fixes["lat_deg"], fixes["lon_deg"], readings["t_ns"]):
        state.update(len(values).to_bytes(8, "little"))
        state.update(np.ascontiguousarray(values).tobytes())
    for values in (readings["cell"], levels_dbm(readings)):
        state.update(np.ascontiguousarray(values).tobytes())
    return state.hexdigest()


def _squares(fixes: Rows, scans: Rows, readings: Rows) -> tuple[IntArray, BoolArray]:
    """Square of each reading, shape (n,), and which readings are usable."""
    track = track_of(fixes)
    places, is_known = places_of(track, scans, readings)
    is_sure = places.sigma_m <= FARTHEST_SIGMA_M
    is_named = (readings["cell"] != b"") & (readings["identity_unsure"] == 0)
    usable = is_known & is_sure & is_named & np.isfinite(levels_dbm(readings))
    squares = squares_of(places.lat_lon_deg)
    return squares, usable


def rows_by_square(
    square: IntArray, cell: IntArray, scan: IntArray, level_dbm: FloatArray, cells: list[str]
) -> list[HeardRow]:
    """Sums of each cell in each square; arrays (n,), `cell` the number in `cells`."""
    # the strongest reading of a cell in a scan comes first among its equals
    order = np.lexsort((-level_dbm, scan, cell, square))
    square, cell, scan, level_dbm = square[order], cell[order], scan[order], level_dbm[order]
    same_group = (np.diff(square) == 0) & (np.diff(cell) == 0)
    is_first = np.concatenate([[True], ~(same_group & (np.diff(scan) == 0))])[: len(square)]
    square, cell, level_dbm = square[is_first], cell[is_first], level_dbm[is_first]
    if not len(square):
        return []
    changes = (np.diff(square) != 0) | (np.diff(cell) != 0)
    begin = np.flatnonzero(np.concatenate([[True], changes]))
    scaled = np.round(SCALE * level_dbm).astype(np.int64)
    columns = (
        square[begin],
        cell[begin],
        np.diff(np.append(begin, len(square))),
        np.maximum.reduceat(level_dbm, begin),
        np.add.reduceat(scaled, begin),
        np.add.reduceat(scaled**2, begin),
    )
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [HeardRow(row[0], cells[row[1]], *row[2:]) for row in rows]


def channels_heard(rows: Rows, cell: IntArray, cells: Sequence[str]) -> list[tuple[str, int, int]]:
    """Channels and codes of some `readings`, each once, as in `WalkSummary`.

    `cell` (n,) is the number of the reading's cell among `cells`.
    """
    code = np.full(len(rows), UNKNOWN, np.int64)
    for name in ("pci", "psc", "bsic"):  # a technology has one of them
        code = np.where(rows[name] == UNKNOWN_ID, code, rows[name])
    channel = np.where(rows["arfcn"] == UNKNOWN_ID, UNKNOWN, rows["arfcn"])
    seen = set(zip(cell.tolist(), channel.tolist(), code.tolist(), strict=True))
    return sorted((cells[c], number, k) for c, number, k in seen if (number, k) != (UNKNOWN,) * 2)


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

NULL of walks of an earlier version, whose `digest` is that of the content.
"""

MARK = """CREATE TABLE IF NOT EXISTS mark (
    walk INTEGER PRIMARY KEY, marks BLOB NOT NULL, is_copy INTEGER NOT NULL) STRICT"""

REMOVE = (
    MARK,
    "DELETE FROM mark WHERE walk = :walk",
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
"""Remove the rows of a walk and recompute the sums that they touched."""


_PATIENCE_S = 10.0
"""For another program that changes the baseline; one change takes some milliseconds."""
_SHORTEST_DIGEST = 6  # characters, in which 16 million walks differ
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

    Raises `RunFileError` for a file that is no baseline or cannot be written.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self.path = path
        if not create and not path.is_file():
            raise RunFileError(f"{path}: no such file; `postproc baseline add` makes a baseline")
        if create:  # SQLite does not say why it cannot open a file
            try:
                os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o644))
            except OSError as error:
                raise RunFileError(f"cannot write {path}: {why_not_written(error)}") from error
        with self._errors():
            mode = "rwc" if create else "rw"
            self._db = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={mode}",
                timeout=_PATIENCE_S,
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

        A walk that it continues, as `continues` says of a digest, or a damaged or shorter copy of
        it gives way. Raises `RunFileError` if it may itself be a part of a walk that is there: both
        would count.
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
                        f"`postproc baseline remove {number} -b {quote(str(self.path))}` it first"
                    )
            for other, is_copy in self.copies_of(walk):
                if walk.is_copy and not (is_copy and other.n_readings < walk.n_readings):
                    return None
                self._remove(other.id)
            return self._insert(walk)

    def copies_of(self, walk: WalkSummary) -> list[tuple[StoredWalk, bool]]:
        """Its originals and shared copies."""
        with self._errors():
            if not self._rows("SELECT 1 FROM sqlite_schema WHERE name = 'mark'"):
                return []
            # without a copy one of two was changed and sealed anew, and nobody knows which
            same = {
                number: bool(is_copy)
                for number, _, marks, is_copy in self._rows(NEAR, walk.run_id, walk.began_utc_ns)
                if (walk.is_copy or is_copy) and is_same_walk(marks, walk.marks)
            }
            return [(one, same[one.id]) for one in self.walks() if one.id in same] if same else []

    def contradictions(self, walk: int) -> list[int]:
        """Numbers of other walks of the same run, of which only one can be unaltered."""
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

    def has_heard(self, cell: str) -> bool:
        """Whether any walk heard a cell of this name."""
        with self._errors():
            return bool(self._rows("SELECT 1 FROM cell WHERE name = ?", cell))

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
        self._db.execute(MARK)
        # an earlier version, which knows no marks, may have removed a walk with this number
        marks = (number, walk.marks, walk.is_copy)
        self._db.execute("INSERT OR REPLACE INTO mark VALUES (?, ?, ?)", marks)
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
            [(name, rat, *_numbers_in(name)) for name, rat in walk.cells.items()],
        )
        numbers: dict[str, int] = {}
        for name in walk.cells:
            ((numbers[name],),) = self._rows("SELECT id FROM cell WHERE name = ?", name)
        return numbers

    @contextmanager
    def _change(self) -> Iterator[None]:
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


def without_runs(path: Path, runs: Sequence[Run], folder: Path) -> Path:
    """The baseline, or where it has some of the runs a copy without them in a folder.

    A run compared with itself has nothing new.
    """
    tables = [(run.tables["fixes"], run.tables["readings"]) for run in runs]
    same = {*map(walk_digest, runs), *(content_digest(*pair) for pair in tables)}
    with closing(BaselineFile(path)) as file:
        for run in runs:
            marks = marks_of(run)
            near = file.marks_near(began_utc_ns(run))
            same |= {digest for digest, others in near.items() if is_same_walk(marks, others)}
        if same.isdisjoint(file.digests):
            return path
    copy = Path(shutil.copy(path, folder / "others.db"))
    with BaselineStore(copy) as store:
        store.remove([walk.id for walk in store.walks() if walk.digest in same])
    return copy


CONTRADICTION = (
    "{} says that it is the same run and differs: one of them was changed and sealed anew. Both "
    "count; the digest that was noted at the stop shows which is genuine"
)
COPY = "a copy of {}, which is there"
SHORTER_COPY = "{}, a shorter copy of it, gave way"


@dataclass(frozen=True, slots=True)
class Added:
    """What became of a file: `walk` is the number of an added one, `problem` why none was added."""

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
        copies = store.copies_of(outcome)
        number = store.add(outcome, lambda earlier: sealing_of(path, earlier).continues)
        others = [] if number is None else store.contradictions(number)
    except FieldLoggerError as error:
        return Added(path, problem=str(error))
    counts = outcome.n_readings, outcome.n_squares, len(outcome.cells)
    remark = CONTRADICTION.format(f"walk {others[0]}") if others else ""
    if copies:
        text = COPY if number is None else SHORTER_COPY
        remark = text.format(f"walk {copies[0][0].id}, {copies[0][0].name}")
    return Added(path, number, outcome.digest, *counts, is_known=number is None, remark=remark)
