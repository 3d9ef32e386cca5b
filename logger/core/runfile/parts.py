"""A journal read back, part by part, so that a day's walk needs no day's memory."""

import mmap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from logger.core.errors import RunFileError
from logger.core.runfile.frames import Buffer, Frame, Kind, Skipped, scan
from logger.core.runfile.meta import Damage, RunEnd, RunMeta
from logger.core.runfile.writer import RAW_COUNT
from logger.core.schema import DTYPES, SCHEMA_VERSION, Rows


@dataclass(frozen=True, slots=True)
class TableRows:
    """Rows of one table, as they were written together."""

    table: str
    rows: Rows


@dataclass(frozen=True, slots=True)
class RawChunk:
    """Rows of the table `raw`, their offsets counted in `data`."""

    rows: Rows
    data: bytes


@dataclass(slots=True)
class JournalParts:
    """Iterate once over the rows; `meta`, `end` and `damage` are complete afterwards.

    Raises `RunFileError` for a file that holds no frame of a journal.
    """

    path: Path
    meta: RunMeta | None = None
    end: RunEnd | None = None
    _missing: int = 0
    _skipped: int = 0
    _dtypes: Mapping[str, np.dtype[np.void]] = field(default_factory=lambda: DTYPES)

    @property
    def damage(self) -> Damage:
        return Damage(missing_frames=self._missing, skipped_bytes=self._skipped)

    def __iter__(self) -> Iterator[TableRows | RawChunk]:
        with self.path.open("rb") as file:
            try:
                view = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            except ValueError:
                raise RunFileError(f"{self.path} is empty") from None
            with view:
                yield from self._read(view)

    def _read(self, data: Buffer) -> Iterator[TableRows | RawChunk]:
        run: int | None = None
        expected = 0
        for found in scan(data):
            if isinstance(found, Skipped):
                self._skipped += found.n_bytes
                continue
            run = found.run if run is None else run
            if found.run != run or found.number < expected:
                # a stale block of another journal, or of this one
                self._skipped += len(found.payload)
                continue
            self._missing += found.number - expected
            expected = found.number + 1
            yield from self._part(found)
        if run is None:
            raise RunFileError(f"{self.path} is no cellwalk run: it holds no journal frame")

    def _part(self, frame: Frame) -> Iterator[TableRows | RawChunk]:
        payload = frame.payload
        match frame.kind:
            case Kind.META:
                self._take_meta(payload)
            case Kind.END:
                self.end = msgspec.json.decode(payload, type=RunEnd)
            case Kind.ROWS:
                name, body = payload[1 : 1 + payload[0]].decode(), payload[1 + payload[0] :]
                yield TableRows(name, np.frombuffer(body, self._dtypes[name]))
            case Kind.RAW:
                (count,) = RAW_COUNT.unpack_from(payload)
                dtype = self._dtypes["raw"]
                rows = np.frombuffer(payload, dtype, count, RAW_COUNT.size)
                yield RawChunk(rows, payload[RAW_COUNT.size + count * dtype.itemsize :])

    def _take_meta(self, payload: bytes) -> None:
        if self.meta is not None:
            return
        self.meta = decode_meta(payload, self.path)
        self._dtypes = {
            table: np.dtype([(name, kind) for name, kind in columns]) for table, columns in self.meta.columns.items()
        }


def decode_meta(text: bytes, path: Path) -> RunMeta:
    """Meta of a run; raises `RunFileError` when a newer cellwalk wrote it, or it is no meta at all."""
    try:
        schema = msgspec.json.decode(text).get("schema")
        if schema <= SCHEMA_VERSION:
            return msgspec.json.decode(text, type=RunMeta)
    except (ValueError, AttributeError, TypeError) as error:
        raise RunFileError(f"{path}: this cellwalk cannot read its description ({error})") from error
    raise RunFileError(f"{path} has schema {schema}; this cellwalk reads up to {SCHEMA_VERSION}: please update")
