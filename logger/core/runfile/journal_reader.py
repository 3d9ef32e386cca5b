"""A journal read back, part by part, so that a day's walk needs no day's memory."""

import mmap
import os
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from logger.core.errors import RunFileError
from logger.core.isolation import most_memory_bytes, most_unpacked_bytes
from logger.core.live_settings import restore_settings
from logger.core.rows import Rows, dtypes_of, parse_dtypes
from logger.core.runfile.frames import (
    MAX_PAYLOAD,
    Buffer,
    Chain,
    ForgedFramesError,
    Frame,
    Kind,
    payload_of,
    scan,
)
from logger.core.runfile.journal import RAW_COUNT
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, check_end, check_meta
from logger.core.runfile.run_names import first_part, parts_of
from logger.core.schema import MOST_NS, OLDEST_DESCRIBED, SCHEMA_VERSION, columns_of

NO_ROWS: Rows = np.empty(0, np.dtype([]))

_INDEX = np.dtype([(name, "u8" if name == "start" else "u4") for name in Frame._fields])
SECTOR = 4096
_READ_AT_ONCE = 1 << 20
_UNREADABLE = b"\xff"
"""Zeros would pass for the reserve at the end of a journal."""
_BLOCK = 4096
_ZLIB_MOST = 1032
"""A byte unpacks to at most so many (zlib.net/zlib_tech.html)."""


@dataclass(frozen=True, slots=True)
class Part:
    """Content of one frame: rows of a table, `raw` with their bytes, or none (META, END)."""

    number: int
    kind: int
    payload: bytes
    table: str = ""
    rows: Rows = field(default_factory=lambda: NO_ROWS)
    data: bytes = b""


class JournalParts:
    """Iterate once over the parts in their order; everything else is complete afterwards.

    The frames of all files of the journal are found first, so that one that stands in two files, or
    was moved, counts once and in its order. Raises `RunFileError` for a file without a frame.
    """

    def __init__(self, path: Path) -> None:
        self.path = first_part(path)
        self.meta_text = b""
        self.end_text = b"null"
        self.end: RunEnd | None = None
        self.chain = Chain()
        self._meta: RunMeta | None = None
        self._schema = SCHEMA_VERSION
        self._missing = 0
        self._skipped = 0
        self._first_ns: int | None = None
        self.most_memory_bytes = self._unpackable = 0

    @property
    def damage(self) -> Damage:
        lost = self._meta is None
        return Damage(
            missing_frames=self._missing, skipped_bytes=self._skipped, description_lost=lost
        )

    @property
    def digest(self) -> str:
        """What the run was sealed with, or, when cut, the digest of what there is."""
        return self.end.digest if self.end else self.chain.digest

    @property
    def meta(self) -> RunMeta:
        """Description of the run; if it is lost, a substitute that states this."""
        if self._meta is not None:
            return self._meta
        return RunMeta(
            run_id="",
            boot_id="",
            started_ns=self._first_ns if self._first_ns and abs(self._first_ns) < MOST_NS else 0,
            origin="lost with the description",
            program="",
            schema=self._schema,
            columns=columns_of(self._schema),
        )

    def __iter__(self) -> Iterator[Part]:
        try:
            files = parts_of(self.path)
            if not files:
                raise RunFileError(f"{self.path}: no such file")
            with _open_all(files) as buffers:
                yield from self._parts(buffers)
        except OSError as error:
            raise RunFileError(
                f"{error.filename or self.path}: {error.strerror or error}"
            ) from error

    def _parts(self, buffers: list[Buffer]) -> Iterator[Part]:
        size = sum(map(len, buffers))
        self.most_memory_bytes, self._unpackable = (
            most_memory_bytes(size),
            most_unpacked_bytes(size),
        )
        try:
            index = self._index(buffers)
        except ForgedFramesError as error:
            raise RunFileError(f"{self.path} is no cellwalk run: {error}") from None
        dtypes = self._describe(buffers, index)
        stop: Part | None = None  # counts only with the END that repeats it
        for frame in _frames(index):
            payload = self._unpack(buffers, frame)
            part = None if payload is None else _part(frame, payload, dtypes)
            if payload is None or part is None:
                self._missing += 1
                self._skipped += frame.length
                continue
            if part.kind == Kind.STOP:
                stop = part
                continue
            if part.kind == Kind.END:
                self.end, self.end_text = msgspec.json.decode(payload, type=RunEnd), payload
                if stop is not None:
                    self.chain.add(stop.number, stop.kind, stop.payload)
                    yield stop
            self.chain.add(part.number, part.kind, payload)
            if len(part.rows) and self._first_ns is None:
                self._first_ns = int(part.rows["t_ns"].min())
            yield part

    def _unpack(self, buffers: list[Buffer], frame: Frame) -> bytes | None:
        """None if the payload is invalid.

        Raises `RunFileError` if all payloads together exceed the limit.
        """
        packed = buffers[frame.file][frame.start : frame.start + frame.length]
        payload = payload_of(packed, frame.version)
        self._unpackable -= (
            min(MAX_PAYLOAD, _ZLIB_MOST * frame.length) if payload is None else len(payload)
        )
        if self._unpackable < 0:
            raise RunFileError(f"{self.path} unpacks to more than a run of this size can hold")
        return payload

    def _index(self, buffers: list[Buffer]) -> Rows:
        """Frames are in the order of their numbers."""
        if not any(len(buffer) for buffer in buffers):
            raise RunFileError(f"{self.path} is empty")
        found = np.fromiter(self._scan_frames(buffers), _INDEX)
        if not len(found):
            raise RunFileError(
                f"{self.path} is no cellwalk run; `postproc import` makes one of a log"
            )
        ((run, _),) = Counter(found["run"].tolist()).most_common(1)
        stale = found["run"] != run
        self._skipped += int(found["length"][stale].sum())
        found = found[~stale]
        numbers, first = np.unique(found["number"], return_index=True)
        self._missing += int(numbers[-1]) + 1 - len(numbers)
        index: Rows = found[first]
        return index

    def _scan_frames(self, buffers: list[Buffer]) -> Iterator[Frame]:
        for i, buffer in enumerate(buffers):
            for event in scan(buffer):
                if isinstance(event, int):
                    self._skipped += event
                else:
                    yield event._replace(file=i)

    def _describe(self, buffers: list[Buffer], index: Rows) -> Mapping[str, np.dtype[np.void]]:
        """Definition of the tables, from any description or the version that every frame names."""
        for frame in _frames(index[index["kind"] == Kind.META]):
            text = self._unpack(buffers, frame)
            if text is not None:
                self._meta, self.meta_text = decode_meta(text, self.path), text
                return parse_dtypes(self._meta.columns)
        versions = np.unique(index["schema"])
        if len(versions) != 1 or not OLDEST_DESCRIBED <= versions[0] <= SCHEMA_VERSION:
            raise RunFileError(f"{self.path} has lost its table definitions")
        self._schema = int(versions[0])
        self.meta_text = msgspec.json.encode(self.meta)
        return dtypes_of(self._schema)


def decode_meta(text: bytes, path: Path) -> RunMeta:
    """Decode the metadata of a run.

    Raises `RunFileError` if a newer cellwalk wrote it, or if it is invalid.
    """
    try:
        found = msgspec.json.decode(text)
        schema = found.get("schema")
        if schema <= SCHEMA_VERSION:
            meta = msgspec.convert(
                found | {"live": restore_settings(found.get("live") or {})}, RunMeta
            )
            check_meta(meta)
            parse_dtypes(meta.columns)
            return meta
    except (msgspec.MsgspecError, ValueError, AttributeError, TypeError, RecursionError) as error:
        raise RunFileError(
            f"{path}: this cellwalk cannot read its description ({error})"
        ) from error
    raise RunFileError(
        f"{path} has schema {schema}; this cellwalk reads up to {SCHEMA_VERSION}: please update"
    )


def decode_end(text: bytes | str, path: Path) -> RunEnd | None:
    """How a run stopped; raises `RunFileError` for what is no such thing."""
    try:
        end: RunEnd | None = msgspec.json.decode(text, type=RunEnd | None)
        if end is not None:
            check_end(end)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise RunFileError(f"{path} is damaged: how it ended cannot be read ({error})") from error
    return end


def decode_damage(text: bytes | str, path: Path) -> Damage:
    """What a run lacks; raises `RunFileError` for what is no such thing."""
    try:
        return msgspec.json.decode(text, type=Damage)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise RunFileError(f"{path} is damaged: what it lacks cannot be read ({error})") from error


@contextmanager
def _open_all(paths: list[Path]) -> Iterator[list[Buffer]]:
    with ExitStack() as stack:
        yield [_buffer_of(stack, path) for path in paths]


def _buffer_of(stack: ExitStack, path: Path) -> Buffer:
    """The bytes of a file on a card that may fail, with unreadable ones replaced.

    A file without them is a memory map, which `stack` closes; a map of an unreadable sector would
    end the program (SIGBUS).
    """
    file = stack.enter_context(path.open("rb", buffering=0))
    fd = file.fileno()
    size = os.fstat(fd).st_size
    if not size:
        return b""
    if all(_bytes_at(fd, at, _READ_AT_ONCE) is not None for at in range(0, size, _READ_AT_ONCE)):
        return stack.enter_context(mmap.mmap(fd, 0, access=mmap.ACCESS_READ))
    return b"".join(_pieces(fd, size))


def _pieces(fd: int, size: int) -> Iterator[bytes]:
    for at in range(0, size, SECTOR):
        length = min(SECTOR, size - at)
        piece = _bytes_at(fd, at, length)
        yield _UNREADABLE * length if piece is None else piece


def _bytes_at(fd: int, at: int, length: int) -> bytes | None:
    try:
        return os.pread(fd, length, at)
    except OSError:
        return None


def _frames(index: Rows) -> Iterator[Frame]:
    """Rows by blocks: as Python's integers they take ten times the room."""
    for at in range(0, len(index), _BLOCK):
        yield from map(Frame._make, index[at : at + _BLOCK].tolist())


def _part(frame: Frame, payload: bytes, dtypes: Mapping[str, np.dtype[np.void]]) -> Part | None:
    """None if the payload does not match the frame's kind."""
    number, kind = frame.number, frame.kind
    try:
        match kind:
            case Kind.ROWS:
                table, body = payload[1 : 1 + payload[0]].decode(), payload[1 + payload[0] :]
                return Part(number, kind, payload, table, np.frombuffer(body, dtypes[table]))
            case Kind.RAW:
                (count,) = RAW_COUNT.unpack_from(payload)
                rows = np.frombuffer(payload, dtypes["raw"], count, RAW_COUNT.size)
                return Part(
                    number, kind, payload, "raw", rows, payload[RAW_COUNT.size + rows.nbytes :]
                )
            case Kind.END:
                check_end(msgspec.json.decode(payload, type=RunEnd))
            case Kind.STOP:
                msgspec.json.decode(payload, type=RunEnd)
    except (msgspec.MsgspecError, ValueError, KeyError, IndexError, RecursionError, struct.error):
        return None
    return Part(number, kind, payload)
