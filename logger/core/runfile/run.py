"""A run opened for reading, whether it is finished HDF5 or a journal that was cut."""

import stat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.isolation import Outcome, run_isolated
from logger.core.provenance import has_times
from logger.core.rows import (
    DTYPES,
    ROWS_AT_ONCE,
    Rows,
    channels_of,
    to_current_columns,
    values_of,
)
from logger.core.runfile.journal_reader import (
    JournalParts,
    decode_damage,
    decode_end,
    decode_meta,
)
from logger.core.runfile.meta import Damage, RunEnd, RunMeta
from logger.core.runfile.run_names import is_hdf5
from logger.core.runfile.sanitising import sanitise
from logger.core.runfile.seal import Sealed, Sealing
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

HDF5_READER = "logger.core.runfile.hdf5_reader"
"""The module of the tasks that read HDF5, imported only by the other process (`isolation`)."""


@dataclass(frozen=True)  # without slots: `named_readings` is kept
class Run:
    """Tables of a run as structured arrays (columns in `schema`).

    `end` is None if the run was cut. `digest` is that of the hash chain: what the run was sealed
    with, or, when cut, of what there is. `raw_bytes` is empty where a port gave more than memory
    should hold; there are `n_raw_bytes` in the file.
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
    shown_as: str = ""

    @property
    def name(self) -> str:
        """In outputs."""
        return self.shown_as or self.path.name

    @property
    def is_complete(self) -> bool:
        """Whether it was stopped, and no frame of it is missing."""
        return self.end is not None and not self.damage.missing_frames

    def __repr__(self) -> str:
        counts = (f"{len(self.tables[name])} {name}" for name in ("fixes", "scans", "readings"))
        end = "" if self.end is not None else ", cut"
        return f"Run({self.name}: {', '.join(counts)}{end})"

    @cached_property
    def named_readings(self) -> Rows:
        """The table `readings` with names where a row has no identity: `joined_names`."""
        fixes, scans, readings = (self.tables[name] for name in ("fixes", "scans", "readings"))
        if np.all(readings["cell"] != b""):
            return readings
        from logger.core.joined_names import with_names  # noqa: PLC0415 (PROJ; most runs need none)

        return with_names(fixes, scans, readings, has_times=has_times(self.meta.origin))

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
        """What cells broadcast, by number of the scan and position of the reading in it."""
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
    _check_file(path)
    try:
        if is_hdf5(path):
            return _hdf5_run(path, run_isolated(f"{HDF5_READER}:read_run", path))
        return _journal_run(path)
    except MemoryError:
        raise RunFileError(f"{path} takes more memory than there is") from None


def read_sound_run(path: Path | str) -> Run:
    """Read a run; values that no recorder writes become unknown and are counted."""
    return _without_meaningless(read_run(path))


def read_sealed_run(path: Path) -> tuple[Run, Sealing]:
    """As `read_sound_run`, with what the hash chain says of it."""
    if not is_hdf5(path):
        return read_sound_run(path), sealing_of(path)
    outcome = run_isolated(f"{HDF5_READER}:read_sealed_run", path)
    run = _without_meaningless(_hdf5_run(path, outcome))
    return run, msgspec.convert(outcome[0]["sealing"], Sealing)


def read_unaltered_run(path: Path) -> Run:
    """As `read_sound_run`, of a run that will be kept: raises `RunFileError` if it was altered.

    A run that was cut or damaged passes: nobody can tell it from an altered one.
    """
    run, sealing = read_sealed_run(path)
    if sealing.alterations:
        raise RunFileError(
            f"{path} was altered: {sealing.alterations[0]}; `postproc info --verify` shows all"
        )
    return run


def sealing_of(path: Path, earlier: str = "") -> Sealing:
    """Compute the hash chain of a run again, from its journal or its HDF5.

    `earlier` is the digest of a run that may be a part of it. Raises `RunFileError`.
    """
    if is_hdf5(path):
        sealing, _ = run_isolated(f"{HDF5_READER}:read_sealing", path, earlier)
        return msgspec.convert(sealing, Sealing)
    sealed = Sealed(earlier)
    parts = JournalParts(path)
    for part in parts:
        sealed.add(part.number, part.kind, part.payload)
    differences = sealed.differences(parts.end)
    if parts.end is not None and parts.end_text != msgspec.json.encode(parts.end):
        differences.append("end: it has more fields than a stop")
    return Sealing(
        parts.end,
        parts.damage,
        sealed.recomputed_digest,
        sealed.chain.broken_at,
        differences=tuple(differences),
        stop_is_sealed=parts.end is None or sealed.stop is not None,
        continues=sealed.continues,
    )


class StoredResults(NamedTuple):
    """Results of the desktop program as they are stored (`postproc.results`)."""

    made_from: bytes
    selected: bytes
    digest: str
    values: bytes
    arrays: dict[str, npt.NDArray[Any]]


def read_results(path: Path, made_from: str) -> StoredResults:
    """Results of the desktop program; without values if they were made from something else.

    Raises `RunFileError`.
    """
    content, stored = run_isolated(f"{HDF5_READER}:read_results", path, made_from)
    arrays = _arrays(stored)
    values = arrays.pop("values", np.empty(0, np.uint8)).tobytes()
    return StoredResults(
        content["made_from"].encode(),
        content["selected"].encode(),
        content["digest"],
        values,
        {name: array.reshape(content["shapes"][name]) for name, array in arrays.items()},
    )


def _without_meaningless(run: Run) -> Run:
    tables, n_bad = sanitise(run.tables, run.n_raw_bytes)
    return replace(
        run, tables=tables, damage=msgspec.structs.replace(run.damage, meaningless_values=n_bad)
    )


def _check_file(path: Path) -> None:
    """Raises `RunFileError` for anything but a file with content."""
    try:
        status = path.stat()
    except FileNotFoundError:
        raise RunFileError(f"{path}: no such file") from None
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise RunFileError(f"{str(path)!r} is no path: {error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise RunFileError(f"{path} cannot be read: it is no file")
    if not status.st_size:
        raise RunFileError(f"{path} is empty")


def _arrays(tables: Mapping[str, tuple[Any, bytearray]]) -> dict[str, npt.NDArray[Any]]:
    return {
        name: np.frombuffer(
            data, kind if isinstance(kind, str) else [tuple(column) for column in kind]
        )
        for name, (kind, data) in tables.items()
    }


def _hdf5_run(path: Path, outcome: Outcome) -> Run:
    content, stored = outcome
    meta = decode_meta(content["meta"].encode(), path)
    end = decode_end(content["end"], path)
    damage = decode_damage(content["damage"], path)
    arrays = _arrays(stored)
    raw_bytes = arrays.pop("raw_bytes")
    tables = {table: np.empty(0, dtype) for table, dtype in DTYPES.items()}
    tables |= {table: to_current_columns(table, rows) for table, rows in arrays.items()}
    digest = end.digest if end else content["digest"]
    return Run(path, "hdf5", meta, end, damage, tables, raw_bytes, digest, content["n_raw"])


def _journal_run(path: Path) -> Run:
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
    """Quick where scans are asked for in their order."""

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
