"""A run opened for reading, finished HDF5 or a cut journal; impossible values become unknown."""

import os
import stat
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, get_args

import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.isolation import Outcome, run_isolated
from logger.core.rows import (
    DTYPES,
    ROWS_AT_ONCE,
    Rows,
    channels_of,
    numbered_texts,
    to_current_columns,
    values_of,
)
from logger.core.runfile.frames import Sealed, Sealing
from logger.core.runfile.journal_reader import (
    JournalParts,
    Part,
    decode_damage,
    decode_end,
    decode_meta,
)
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, has_times
from logger.core.runfile.run_names import is_hdf5, run_name
from logger.core.schema import MOST_NS, TABLES
from logger.core.types import (
    UNKNOWN_ID,
    UNKNOWN_TIME,
    Broadcast,
    CellReading,
    Fix,
    Level,
    LiveEstimate,
    Note,
    Rat,
    RawBytes,
    Record,
    Role,
    Scan,
    Value,
)

# Readers of runs may then rely on it: sums of times fit into 64 bits, positions are on the Earth,
# levels are in the range of a modem, text is UTF-8. A run by our recorder is returned unchanged.

_LAST_SEQ = 2**53
"""More records than any card holds; larger numbers are inexact as floats."""
_RANGES = {
    "lat_deg": (-90.0, 90.0),
    "lon_deg": (-180.0, 180.0),
    "alt_m": (-1e12, 1e12),  # as far as the importers go
    "acc_m": (0.0, 1e7),  # receivers without a position report some thousand kilometres
    "hdop": (0.0, 1e6),
    "speed_mps": (-1e12, 1e12),
    "course_deg": (-1e12, 1e12),
    "rssi_dbm": (-200.0, 50.0),
    "rscp_dbm": (-200.0, 50.0),
    "rsrp_dbm": (-200.0, 50.0),
    "ecio_db": (-1e12, 1e12),
    "rsrq_db": (-1e12, 1e12),
    "sinr_db": (-1e12, 1e12),
}
_LARGEST = {
    "ta": 1282,  # LTE (3GPP TS 36.213, 4.2.3); GSM has 63
    "rxlev_raw": 255,
    "cro_db": 126,  # 63 steps of 2 dB (3GPP TS 45.008, 6.4)
    "penalty_time": 31,
}
"""Of whole numbers that are unknown or not negative."""
_WORDS: dict[str, tuple[tuple[str, ...], bytes]] = {
    "role": (get_args(Role), b"scan"),
    "rat": (("", *get_args(Rat)), b""),
    "level": (get_args(Level), b"info"),
}
"""Columns with a fixed set of texts, and the replacement of any other text."""

Truths = npt.NDArray[np.bool_]


def sanitise(tables: dict[str, Rows], n_raw_bytes: int) -> tuple[dict[str, Rows], int]:
    """Valid tables with the current columns, and how many rows and values were invalid."""
    found, n = {}, 0
    for table, rows in tables.items():
        found[table], n_bad = _Sanitiser(table, rows, n_raw_bytes).result()
        n += n_bad
    return found, n


class _Sanitiser:
    """One table, copied when something must be changed."""

    def __init__(self, table: str, rows: Rows, n_raw_bytes: int) -> None:
        self._table = table
        self._n_raw_bytes = n_raw_bytes
        usable = (
            (rows["seq"] >= 0)
            & (rows["seq"] < _LAST_SEQ)
            & (rows["t_ns"] >= -MOST_NS)
            & (rows["t_ns"] <= MOST_NS)
        )
        self._n_bad = int(len(rows) - np.count_nonzero(usable))
        self._rows = rows[usable] if self._n_bad else rows
        self._copied = bool(self._n_bad)

    def result(self) -> tuple[Rows, int]:
        if len(self._rows):
            for column in TABLES[self._table]:
                if column.dtype.startswith("S"):
                    self._text(column.name)
            of_table: dict[str, Callable[[], None]] = {
                "fixes": self._fixes,
                "scans": self._times,
                "readings": self._readings,
                "broadcasts": self._broadcasts,
                "live": self._live,
                "raw": self._raw,
            }
            of_table.get(self._table, lambda: None)()
        return self._rows, self._n_bad

    def _replace(self, name: str, bad: Truths, value: object) -> None:
        if not (n := int(np.count_nonzero(bad))):
            return
        if not self._copied:
            self._rows, self._copied = self._rows.copy(), True
        self._rows[name][bad] = value
        self._n_bad += n

    def _text(self, name: str) -> None:
        column = self._rows[name]
        letters = np.ascontiguousarray(column).view(np.uint8).reshape(len(column), -1)
        is_odd = letters >= 0x80
        is_odd[:, 1:] |= (letters[:, 1:] != 0) & (letters[:, :-1] == 0)  # NUL within the text
        for i in np.flatnonzero(is_odd.any(axis=1)).tolist() if is_odd.any() else ():
            text = bytes(column[i])
            if (clean := _utf8(text, column.dtype.itemsize)) != text:
                self._replace(name, np.arange(len(column)) == i, clean)
        if name in _WORDS:
            words, instead = _WORDS[name]
            texts, which = numbered_texts(self._rows[name])
            self._replace(name, ~np.isin(texts, [word.encode() for word in words])[which], instead)

    def _numbers(self) -> None:
        for name, (least, most) in _RANGES.items():
            if name in (self._rows.dtype.names or ()):
                values = self._rows[name]
                self._replace(
                    name, ~np.isnan(values) & ~((values >= least) & (values <= most)), np.nan
                )

    def _fixes(self) -> None:
        self._numbers()
        rows = self._rows
        self._replace("valid", rows["valid"] > 1, 1)
        placeless = np.isnan(rows["lat_deg"]) | np.isnan(rows["lon_deg"])
        self._replace("valid", (self._rows["valid"] == 1) & placeless, 0)
        utc_ns = self._rows["utc_ns"]
        self._replace(
            "utc_ns",
            (utc_ns != UNKNOWN_TIME) & ((utc_ns < -MOST_NS) | (utc_ns > MOST_NS)),
            UNKNOWN_TIME,
        )

    def _times(self) -> None:
        start_ns = self._rows["t_start_ns"]
        bad = (start_ns != UNKNOWN_TIME) & ((start_ns < -MOST_NS) | (start_ns > MOST_NS))
        if self._table == "scans":
            bad |= start_ns == UNKNOWN_TIME
        self._replace("t_start_ns", bad, self._rows["t_ns"][bad])

    def _readings(self) -> None:
        self._numbers()
        self._times()
        self._counts("ta", "rxlev_raw")

    def _counts(self, *names: str) -> None:
        for name in names:
            values = self._rows[name]
            bad = (values != UNKNOWN_ID) & ((values < 0) | (values > _LARGEST[name]))
            self._replace(name, bad, UNKNOWN_ID)

    def _broadcasts(self) -> None:
        self._counts("cro_db", "penalty_time")
        texts = self._rows["neighbour_arfcns"]
        bad = [bool(text) and channels_of(text.decode()) is None for text in texts.tolist()]
        self._replace("neighbour_arfcns", np.array(bad), b"")

    def _live(self) -> None:
        zone = np.abs(self._rows["utm_zone"].astype(np.int64))
        self._replace("utm_zone", (zone < 1) | (zone > 60), 1)

    def _raw(self) -> None:
        offset, length = self._rows["offset"], self._rows["length"].astype(np.int64)
        bad = (
            (offset < 0)
            | (length < 0)
            | (offset > self._n_raw_bytes)
            | (length > self._n_raw_bytes - offset)
        )
        self._replace("length", bad, 0)
        self._replace("offset", bad, 0)


def _utf8(text: bytes, size: int) -> bytes:
    """Invalid UTF-8 and NUL are replaced, and the text is shortened to `size` bytes."""
    clean = text.replace(b"\0", b"?").decode("utf-8", "replace").encode()[:size]
    return clean.decode("utf-8", "ignore").encode()


# --- the run ---

HDF5_READER = "logger.core.runfile.hdf5"
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

    def bytes_of(self, rows: Rows) -> bytes:
        """Those of some rows of the table `raw`, one after the other; none without `raw_bytes`."""
        spans = zip(rows["offset"].tolist(), rows["length"].tolist(), strict=True)
        return b"".join(self.raw_bytes[start : start + n].tobytes() for start, n in spans)

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


def read_latest(path: Path, seconds: float) -> Run:
    """A journal's notes, and its other rows of about the last seconds; raises `RunFileError`."""
    # all of a day's walk takes a small Pi its memory
    _check_file(path)
    return _journal_run(path, round(seconds * 1e9))


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
        raise RunFileError(f"{path}: no such file{_meant(path)}") from None
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise RunFileError(f"{str(path)!r} is no path: {error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise RunFileError(f"{path} cannot be read: it is no file")
    if not status.st_size:
        raise RunFileError(f"{path} is empty")


def _meant(path: Path) -> str:
    # by its number, or without the end of its name
    stem = run_name(int(path.name)) if path.name.isdecimal() else path.name
    for name in (f"{path.name}.h5", f"{stem}.h5"):
        if os.path.isfile(path.with_name(name)):  # noqa: PTH113 (no error for a name too long)
            return f"; did you mean {path.with_name(name)}?"
    return ""


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


def _journal_run(path: Path, last_ns: int | None = None) -> Run:
    parts = JournalParts(path)
    rows: dict[str, list[Rows]] = {table: [] for table in DTYPES}
    raw, n_raw, n_bytes = bytearray(), 0, 0
    for part in parts if last_ns is None else _latest_parts(parts, last_ns):
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


def _latest_parts(parts: Iterable[Part], last_ns: int) -> Iterator[Part]:
    kept: dict[str, deque[Part]] = {}
    newest_ns = -MOST_NS
    for part in parts:
        if not len(part.rows):
            continue
        some = kept.setdefault(part.table, deque())
        some.append(part)
        newest_ns = max(newest_ns, int(part.rows["t_ns"].max()))
        is_whole = part.table == "notes"
        while some and not is_whole and some[0].rows["t_ns"].max() < newest_ns - last_ns:
            some.popleft()
    for some in kept.values():
        yield from some


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
        return tuple(reading_of(row, self._broadcasts.get((seq, i))) for i, row in enumerate(rows))


def _broadcast(row: dict[str, Any]) -> Broadcast:
    named = {name: row[name] for name in _BROADCAST_FIELDS}
    named["broadcast_unsure"] = bool(row["broadcast_unsure"])
    named["neighbour_arfcns"] = channels_of(row["neighbour_arfcns"])
    return Broadcast(**named)


def reading_of(row: Mapping[str, Any], broadcast: Broadcast | None) -> CellReading:
    """The reading of a row of `rows.values_of`, with what its cell broadcasts."""
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
