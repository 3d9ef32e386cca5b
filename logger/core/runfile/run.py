"""A run opened for reading, whether it is finished HDF5 or a journal that was cut."""

import stat
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.rows import (
    DTYPES,
    ROWS_AT_ONCE,
    Rows,
    channels_of,
    to_current_columns,
    values_of,
)
from logger.core.runfile.hdf5_layout import RAW_BYTES
from logger.core.runfile.hdf5_reading import Content, read_hdf5, read_hdf5_together
from logger.core.runfile.journal_reader import JournalParts
from logger.core.runfile.meta import Damage, RunEnd, RunMeta
from logger.core.runfile.run_names import is_hdf5
from logger.core.runfile.sanitising import sanitise
from logger.core.runfile.verify import Sealing, sealing_of
from logger.core.types import (
    Broadcast,
    CellReading,
    Fix,
    LiveEstimate,
    Note,
    RawBytes,
    Record,
    Scan,
    Value,
)


@dataclass(frozen=True, slots=True)
class Run:
    """Tables of a run as structured arrays (columns in `schema`).

    `end` is None if the run was cut.

    `digest` is that of the hash chain: what the run was sealed with, or, when it was cut, of what
    there is. `raw_bytes` is empty where a port gave more than memory should hold; there are
    `n_raw_bytes` in the file.
    """

    path: Path
    form: str
    meta: RunMeta
    end: RunEnd | None
    damage: Damage
    tables: dict[str, Rows]
    raw_bytes: npt.NDArray[np.uint8]
    digest: str = ""
    n_raw_bytes: int = 0

    @property
    def is_complete(self) -> bool:
        """Whether it was stopped, and no frame of it is missing."""
        return self.end is not None and not self.damage.missing_frames

    def records(self, *tables: str) -> Iterator[tuple[int, Record]]:
        """Records in recorded order with their numbers; all, or those of the tables named."""
        wanted = [
            t for t in (tables or ("fixes", "scans", "notes", "live", "raw")) if len(self.tables[t])
        ]
        if not wanted:
            return
        streams = {t: self._values(t) for t in wanted}
        seqs = np.concatenate([self.tables[t]["seq"] for t in wanted])
        which = np.repeat(np.arange(len(wanted)), [len(self.tables[t]) for t in wanted])
        for i in which[np.argsort(seqs, kind="stable")].tolist():
            yield next(streams[wanted[i]])

    def broadcasts(self) -> dict[tuple[int, int], Broadcast]:
        """What cells broadcast, by the number of the scan and the position of the reading in it."""
        rows = values_of("broadcasts", self.tables["broadcasts"])
        return {(row["seq"], row["reading"]): _broadcast(row) for row in rows}

    def _values(self, table: str) -> Iterator[tuple[int, Record]]:
        readings = _ReadingsBySeq(self) if table == "scans" else None
        raw = self.raw_bytes.tobytes() if table == "raw" else b""
        for row in values_of(table, self.tables[table]):
            value: Value
            match table:
                case "scans":
                    assert readings is not None
                    value = Scan(
                        row["t_start_ns"],
                        readings.of(row["seq"]),
                        row["fix_start_seq"],
                        row["fix_seq"],
                    )
                case "raw":
                    value = RawBytes(
                        raw[row["offset"] : row["offset"] + row["length"]], bool(row["sent"])
                    )
                case _:
                    value = _VALUES[table](row)
            yield row["seq"], Record(row["t_ns"], row["source"] or "", value)


def read_run(path: Path | str) -> Run:
    """Open a run, HDF5 or journal; raises `RunFileError` saying what is wrong with it."""
    path = Path(path)
    try:
        check_file(path)
        return _read_hdf5(path) if is_hdf5(path) else _read_journal(path)
    except MemoryError:
        raise RunFileError(f"{path} takes more memory than there is") from None
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror or error}") from error


def read_sound_run(path: Path | str) -> Run:
    """Read a run; values that no recorder writes become unknown and are counted."""
    return _sanitised_run(read_run(path))


def read_unaltered_run(path: Path) -> Run:
    """As `read_sound_run`, of a run that will be kept: raises `RunFileError` if it was altered.

    Nothing is missed in a run that was cut or damaged; nobody can tell it from an altered one.
    """
    if is_hdf5(path):
        return read_small_runs([path])[0]
    run = read_sound_run(path)
    _check_unaltered(path, sealing_of(path))
    return run


def read_small_runs(paths: Sequence[Path]) -> list[Run]:
    """As `read_unaltered_run` of several small HDF5 files at once, which is ten times faster.

    Raises `RunFileError` if any of them cannot be read; reading each alone shows which.
    """
    try:
        for path in paths:
            check_file(path)
        read = read_hdf5_together(paths)
    except MemoryError:
        raise RunFileError(f"{paths[0]} takes more memory than there is") from None
    except OSError as error:
        raise RunFileError(f"{paths[0]} cannot be read: {error.strerror or error}") from error
    runs = []
    for path, (content, sealing) in zip(paths, read, strict=True):
        _check_unaltered(path, sealing)
        runs.append(_sanitised_run(_hdf5_run(path, content)))
    return runs


def _check_unaltered(path: Path, sealing: Sealing) -> None:
    if sealing.alterations:
        raise RunFileError(
            f"{path} was altered: {sealing.alterations[0]}; `postproc info --verify` shows all"
        )


def _sanitised_run(run: Run) -> Run:
    tables, n_bad = sanitise(run.tables, run.n_raw_bytes)
    return replace(
        run, tables=tables, damage=msgspec.structs.replace(run.damage, meaningless_values=n_bad)
    )


def check_file(path: Path) -> None:
    """Raise `RunFileError` for anything but a file with content.

    Raises OSError if the system does not report its state.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise RunFileError(f"{path}: no such file") from None
    except ValueError as error:
        raise RunFileError(f"{str(path)!r} is no path: {error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise RunFileError(f"{path} cannot be read: it is no file")
    if not status.st_size:
        raise RunFileError(f"{path} is empty")


def _read_hdf5(path: Path) -> Run:
    return _hdf5_run(path, read_hdf5(path))


def _hdf5_run(path: Path, content: Content) -> Run:
    meta, end, damage, digest, arrays, n_raw = content
    raw_bytes = arrays.pop(RAW_BYTES)
    tables = {table: np.empty(0, dtype) for table, dtype in DTYPES.items()}
    tables |= {table: to_current_columns(table, rows) for table, rows in arrays.items()}
    return Run(
        path, "hdf5", meta, end, damage, tables, raw_bytes, end.digest if end else digest, n_raw
    )


def _read_journal(path: Path) -> Run:
    parts = JournalParts(path)
    rows: dict[str, list[Rows]] = {table: [] for table in DTYPES}
    raw, n_raw, n_bytes = bytearray(), 0, 0
    for part in parts:
        found = part.rows
        if part.table == "raw":
            found = found.copy()
            found["offset"] += n_raw
            n_raw += len(part.data)
            if n_raw <= parts.most_memory_bytes:
                raw += part.data
        n_bytes += found.nbytes
        if n_bytes > parts.most_memory_bytes:
            raise RunFileError(f"{path} unpacks to more than a run of this size can hold")
        if part.table:
            rows[part.table].append(found)
    tables = {
        t: to_current_columns(t, np.concatenate(found)) if found else np.empty(0, DTYPES[t])
        for t, found in rows.items()
    }
    raw_bytes = np.frombuffer(raw if len(raw) == n_raw else b"", np.uint8)
    return Run(
        parts.path,
        "journal",
        parts.meta,
        parts.end,
        parts.damage,
        tables,
        raw_bytes,
        parts.digest,
        n_raw,
    )


class _ReadingsBySeq:
    """Readings grouped by the number of their scan; quick where scans are asked for in order."""

    def __init__(self, run: Run) -> None:
        self._rows = run.tables["readings"]
        self._seq = np.ascontiguousarray(self._rows["seq"])  # of a strided one searches copy
        self._broadcasts = run.broadcasts()
        self._first, self._decoded = 0, list[dict[str, Any]]()

    def of(self, seq: int) -> tuple[CellReading, ...]:
        first, last = np.searchsorted(self._seq, (seq, seq + 1)).tolist()
        if not self._first <= first <= last <= self._first + len(self._decoded):
            ahead = self._rows[first : max(last, first + ROWS_AT_ONCE)]
            self._first, self._decoded = first, list(values_of("readings", ahead))
        rows = self._decoded[first - self._first : last - self._first]
        return tuple(_reading(row, self._broadcasts.get((seq, i))) for i, row in enumerate(rows))


def _broadcast(row: dict[str, Any]) -> Broadcast:
    named = {name: row[name] for name in _BROADCAST_FIELDS}
    named["broadcast_unsure"] = bool(row["broadcast_unsure"])
    named["neighbour_arfcns"] = channels_of(row["neighbour_arfcns"])
    return Broadcast(**named)


def _reading(row: dict[str, Any], broadcast: Broadcast | None) -> CellReading:
    named = {name: row[name] for name in _READING_FIELDS}
    named["broadcast"] = broadcast
    named["identity_unsure"] = bool(row["identity_unsure"])
    reading = CellReading(**named)
    # a cell named by its identity needs no label
    return reading if reading.cell == row["cell"] else CellReading(**named, label=row["cell"])


def _fix(row: dict[str, Any]) -> Fix:
    return Fix(**{name: row[name] for name in _FIX_FIELDS} | {"valid": bool(row["valid"])})


def _note(row: dict[str, Any]) -> Note:
    return Note(row["level"], row["code"] or "", row["text"] or "")


def _live(row: dict[str, Any]) -> LiveEstimate:
    # a filter that has diverged stores NaN, which is a value here and not an unknown
    named: dict[str, Any] = {
        f.name: np.nan if row[f.name] is None else row[f.name] for f in fields(LiveEstimate)
    }
    return LiveEstimate(**named)


_READING_FIELDS = [
    f.name for f in fields(CellReading) if f.name not in {"broadcast", "label", "more"}
]
_BROADCAST_FIELDS = [f.name for f in fields(Broadcast)]
_FIX_FIELDS = [f.name for f in fields(Fix)]
_VALUES: dict[str, Callable[[dict[str, Any]], Value]] = {
    "fixes": _fix,
    "notes": _note,
    "live": _live,
}
