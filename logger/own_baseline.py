"""The baseline that a device keeps by itself, of the runs in its folder.

It follows from the runs that are there, so that it ends with them; only what is trusted, and which
cells were ever conspicuous, stays. A change is made in a copy, which then replaces the file:
whatever ends the program leaves the one before or the one after, and a recorder goes on with the
file that it has opened.
"""

import fcntl
import os
import re
import shutil
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from logger.baseline_file import OWN_FILE
from logger.baseline_store import BaselineStore, WalkSummary, add_walk, summarise_walk
from logger.core.baseline import baseline_of
from logger.core.errors import ConfigError, FieldLoggerError, RunFileError, error_text
from logger.core.live_settings import BEHIND, FAILED
from logger.core.runfile import FLOOR_BYTES, Run, free_bytes, read_unaltered_run
from logger.core.runfile.journal import sync_folder
from logger.core.runfile.run_names import NUMBERED, by_number
from logger.core.suspicion.rules import RULES_CODE
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.suspicion.words import conspicuous_in
from logger.core.types import Note

MOST_BYTES = 50_000_000  # of the file; the oldest runs give way
WALK = "walk"  # origin of the runs that count: simulated and imported ones are of no device

_COPY, _TRYING = f"{OWN_FILE}.new", f"{OWN_FILE}.trying"
_PIECE_BYTES = 1 << 20  # made durable at once: the recorder's own write waits for no more
_AT_ONCE = 10  # runs for each copy of the file
_MOST_TRIES = 5  # a run that ended the program as often, for want of memory, is left out
_DAY_NS = 86_400 * 10**9
_RUN = re.compile(rf"({NUMBERED})(?:\.h5|\.journal)?", re.ASCII)

_TABLES = (
    """CREATE TABLE IF NOT EXISTS seen (
        run TEXT PRIMARY KEY, size INTEGER NOT NULL, mtime_ns INTEGER NOT NULL,
        walk INTEGER, why TEXT NOT NULL) STRICT""",
    "CREATE TABLE IF NOT EXISTS doubted (cell TEXT PRIMARY KEY) STRICT",
)


_Stamp = tuple[int, int]  # size and time of the last change: by these a file is known unread


def learn(folder: Path, *, adds: bool = True) -> Iterator[tuple[str, str]]:
    """Make the baseline follow the runs of a folder; yields each with what became of it.

    Without `adds` none is added. Raises `RunFileError`, OSError.
    """
    with _alone(folder):
        while True:
            stamps = _sealed_runs(folder)
            known = _known_runs(folder)
            gone = [name for name, stamp in known.items() if stamps.get(name) != stamp]
            new = sorted(stamps.keys() - (known.keys() - set(gone)), key=by_number) if adds else []
            new = [name for name in new if name == _last_try(folder)[0]] or new[:_AT_ONCE]
            if not gone and not new:
                return
            if not _has_room(folder):
                raise RunFileError(f"{folder}: the card is too full for a baseline")
            with _change(folder) as store:
                changes = [(name, "removed, as the run is") for name in gone if name not in stamps]
                store.remove_runs(gone)
                changes += [_take(store, folder / f"{name}.h5", stamps[name]) for name in new]
                store.fit()
            (folder / _TRYING).unlink(missing_ok=True)
            yield from changes


def give_way() -> None:
    """Let this process compute and write only while no other one wants to."""
    with suppress(OSError):  # the unit has done it, and allows neither
        os.nice(19)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))  # the card follows it


def forget(folder: Path, name: str) -> int:
    """Remove what a run, or "all", has taught, for good; returns the number of runs.

    With "all" also what is trusted. Raises `ConfigError`.
    """
    match = _RUN.fullmatch(Path(name).name)
    if name != "all" and match is None:
        raise ConfigError(f"{name!r} is no run: run-000017 is wanted, or all")
    with _alone(folder):
        stamps = _sealed_runs(folder)
        if match is not None and match[1] not in stamps.keys() | _known_runs(folder).keys():
            raise ConfigError(f"{folder} has no finished run {match[1]}")
        names = list(stamps) if match is None else [match[1]]
        if match is None:
            (folder / OWN_FILE).unlink(missing_ok=True)
        with _change(folder) as store:
            store.remove_runs(names)
            for run in names:
                store.note(run, stamps.get(run, (0, 0)), None, "forgotten")
        return len(names)


def trust(folder: Path, cell: str, note: str) -> None:
    with _alone(folder), _change(folder) as store:
        store.trust(cell, note)


class _Store(BaselineStore):
    """A baseline that also knows what became of each run, and whom it doubts."""

    def _prepare(self) -> None:
        super()._prepare()
        self._db.execute("PRAGMA secure_delete = ON")  # what is forgotten is not left in the file
        for statement in _TABLES:
            self._db.execute(statement)

    def known_runs(self) -> dict[str, _Stamp]:
        rows = self._rows("SELECT run, size, mtime_ns FROM seen")
        return {run: (size, mtime_ns) for run, size, mtime_ns in rows}

    def note(self, run: str, stamp: _Stamp, walk: int | None, why: str) -> None:
        with self._change():
            self._db.execute(
                "INSERT OR REPLACE INTO seen VALUES (?, ?, ?, ?, ?)", (run, *stamp, walk, why)
            )

    def doubt(self, cells: Sequence[str]) -> set[str]:
        """Keep that cells were conspicuous; returns all that were and are not trusted."""
        with self._change():
            rows = [(cell,) for cell in cells]
            self._db.executemany("INSERT OR IGNORE INTO doubted VALUES (?)", rows)
            return {
                cell
                for (cell,) in self._rows(
                    "SELECT cell FROM doubted WHERE cell NOT IN (SELECT cell FROM trust)"
                )
            }

    def remove_runs(self, runs: Sequence[str]) -> None:
        """Others of the same days, which counted with them, are taken anew."""
        with self._change():
            for run in runs:
                same_day = self._rows(
                    "SELECT o.run, o.walk FROM seen s JOIN walk w ON w.id = s.walk "
                    "JOIN walk x ON (x.began_utc_ns / ?) IS (w.began_utc_ns / ?) "
                    "JOIN seen o ON o.walk = x.id WHERE s.run = ?",
                    _DAY_NS,
                    _DAY_NS,
                    run,
                )
                for other, walk in same_day:
                    self._remove(walk)
                    self._db.execute("DELETE FROM seen WHERE run = ?", (other,))
                self._db.execute("DELETE FROM seen WHERE run = ?", (run,))

    def once_a_day(self, walk: WalkSummary) -> WalkSummary:
        """Without what others of its day have already heard in the same squares."""
        day = None if walk.began_utc_ns is None else walk.began_utc_ns // _DAY_NS
        visits = set(
            self._rows(
                "SELECT square, rat FROM visit JOIN walk ON walk.id = visit.walk "
                "WHERE (began_utc_ns / ?) IS ?",
                _DAY_NS,
                day,
            )
        )
        heard = set(
            self._rows(
                "SELECT square, cell.name FROM heard JOIN cell ON cell.id = heard.cell "
                "JOIN walk ON walk.id = heard.walk WHERE (began_utc_ns / ?) IS ?",
                _DAY_NS,
                day,
            )
        )
        return replace(
            walk,
            visits=[visit for visit in walk.visits if visit not in visits],
            heard=[row for row in walk.heard if (row.square, row.cell) not in heard],
        )

    def fit(self) -> None:
        while self._n_bytes() > MOST_BYTES and (walks := self.walks()):
            with self._change():
                for walk in walks[: max(len(walks) // 20, 1)]:
                    self._remove(walk.id)
                    self._db.execute(
                        "UPDATE seen SET walk = NULL, why = 'no room' WHERE walk = ?", (walk.id,)
                    )
        ((n_free,),) = self._rows("PRAGMA freelist_count")
        if n_free:
            with self._errors():
                self._db.execute("VACUUM")

    def _n_bytes(self) -> int:
        counts = ("page_count", "freelist_count", "page_size")
        n_pages, n_free, page = (self._rows(f"PRAGMA {name}")[0][0] for name in counts)
        return int((n_pages - n_free) * page)


def _take(store: _Store, path: Path, stamp: _Stamp) -> tuple[str, str]:
    run, why, walk = path.stem, "", None
    if _n_tries(path) > _MOST_TRIES:
        why = "reading it has ended the program"
    else:
        try:
            added = add_walk(store, path, _walk_of(store, path))
            walk, why = added.walk, added.problem
            if added.is_known:
                why = "it is there already"
        except FieldLoggerError as error:
            why = str(error)
        except Exception as error:  # noqa: BLE001 (one run must not keep the others)
            why = error_text(error)
    store.note(run, stamp, walk, why)
    return run, f"not learnt: {why}" if why else "learnt"


def _walk_of(store: _Store, path: Path) -> WalkSummary:
    """Without cells that were ever conspicuous; each square counts once a day."""
    run = read_unaltered_run(path)
    if run.meta.origin != WALK:
        raise RunFileError(f"it is no walk of this device ({run.meta.origin})")
    doubted = store.doubt(sorted(conspicuous_cells(run)))
    walk = summarise_walk(run)
    walk = replace(
        walk,
        cells={cell: rat for cell, rat in walk.cells.items() if cell not in doubted},
        heard=[row for row in walk.heard if row.cell not in doubted],
        channels=[row for row in walk.channels if row[0] not in doubted],
    )
    return store.once_a_day(walk)


def conspicuous_cells(run: Run) -> set[str]:
    """Cells that were unusual or suspicious at any time of a run."""
    notes = [record.value for _, record in run.records("notes") if isinstance(record.value, Note)]
    cells = conspicuous_in(notes)
    codes = {note.code for note in notes}
    if RULES_CODE in codes and not codes & {BEHIND, FAILED}:
        return cells
    tracker = SuspicionTracker(run.meta.live.max_fix_age_s, baseline_of(run))
    for _, record in run.records("fixes", "scans"):
        for finding in tracker.feed(record):
            if tracker.assessment(finding.cell).is_conspicuous:
                cells.add(finding.cell)
    return cells


def _last_try(folder: Path) -> tuple[str, int]:
    """The run whose reading ended the program, and how often."""
    file = folder / _TRYING
    name, _, count = (file.read_text(errors="replace") if file.exists() else "").partition(" ")
    return name, int(count) if count.isdecimal() else 0


def _n_tries(path: Path) -> int:
    name, n = _last_try(path.parent)
    n = n + 1 if name == path.stem else 1
    path.with_name(_TRYING).write_text(f"{path.stem} {n}")
    return n


def _sealed_runs(folder: Path) -> dict[str, _Stamp]:
    runs = {}
    for path in folder.glob("run-*.h5"):
        if _RUN.fullmatch(path.name) and path.is_file():
            status = path.stat()
            runs[path.stem] = (status.st_size, status.st_mtime_ns)
    return runs


def _known_runs(folder: Path) -> dict[str, _Stamp]:
    """None without a baseline that can be read."""
    path = folder / OWN_FILE
    if not path.is_file():
        return {}
    try:
        with _Store(path) as store:
            return store.known_runs()
    except (RunFileError, sqlite3.Error):
        return {}


def _has_room(folder: Path) -> bool:
    path = folder / OWN_FILE
    size = path.stat().st_size if path.exists() else 0
    return free_bytes(folder) > FLOOR_BYTES + 3 * size


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


@contextmanager
def _change(folder: Path) -> Iterator[_Store]:
    """A copy that replaces the baseline at the end.

    A damaged file is put aside.
    """
    path, copy = folder / OWN_FILE, folder / _COPY
    for left in (copy, copy.with_name(f"{_COPY}-journal")):
        left.unlink(missing_ok=True)
    if path.is_file():
        _copy(path, copy)
    try:
        store = _Store(copy, create=True)
    except RunFileError:
        path.replace(path.with_name(f"{OWN_FILE}.damaged"))
        copy.unlink()
        store = _Store(copy, create=True)
    try:
        with store:
            yield store
    except BaseException:
        with suppress(OSError):
            copy.unlink()
        raise
    copy.replace(path)  # each of its changes is durable
    sync_folder(folder)


def _copy(path: Path, copy: Path) -> None:
    with path.open("rb") as source, copy.open("wb") as target:
        while piece := source.read(_PIECE_BYTES):
            target.write(piece)
            target.flush()
            os.fdatasync(target.fileno())
    shutil.copymode(path, copy)
