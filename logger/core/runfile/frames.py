"""Frames of a journal: self-delimiting, numbered, with CRCs, and under one hash chain.

    magic "CWJ1" | run u32 | kind u8 | version u8 | schema u16 | number u32 | length u32 |
    crc32(header) u32
    payload | crc32(payload) u32, all little-endian

`run` is a random number of the journal, so that a stale block of another journal is not taken for
this one's. `schema` is the version of the tables, so that rows can be read even where their
definition is lost. The header has its own CRC because a damaged length would swallow the good
frames behind it. The payload is packed with zlib since version 2: writing wears the card, and a
full card leaves it in memory.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from hashlib import sha256
from mmap import mmap
from typing import NamedTuple
from zlib import crc32

from logger.core.runfile.meta import Damage, RunEnd, stop_text

Buffer = bytes | mmap

MAGIC = b"CWJ1"
FRAME_VERSION = 2
MAX_PAYLOAD = 1 << 26
_PLAIN_VERSION = 1
_HEADER = struct.Struct("<4sIBBHII")
_CRC = struct.Struct("<I")
HEADER_SIZE = _HEADER.size + _CRC.size
_MOST_IN_VAIN = 1 << 20
"""Bytes of a short journal that may be checked in vain, beside twice its length."""
# a Pi packs a second of records in about a millisecond with level 1; level 6 saves 8 % more
_LEVEL = 1


class Kind(IntEnum):
    """What a payload holds."""

    META = 1
    ROWS = 2
    RAW = 3
    END = 4
    STOP = 5


class Frame(NamedTuple):
    """An undamaged frame: its header, and the place of its payload."""

    file: int
    run: int
    number: int
    kind: int
    version: int
    schema: int
    length: int
    start: int


class ForgedFramesError(ValueError):
    """Headers announce more than a recorder can have written."""


def encode(run: int, number: int, kind: Kind, payload: bytes, schema: int = 0) -> bytes:
    """One frame as bytes."""
    packed = zlib.compress(payload, _LEVEL)
    header = _HEADER.pack(MAGIC, run, kind, FRAME_VERSION, schema, number, len(packed))
    return b"".join((header, _CRC.pack(crc32(header)), packed, _CRC.pack(crc32(packed))))


def payload_of(packed: bytes, version: int) -> bytes | None:
    """Unpack the payload of a frame; None if it is invalid in spite of its CRC."""
    if version == _PLAIN_VERSION:
        return packed
    unpack = zlib.decompressobj()
    try:
        payload = unpack.decompress(packed, MAX_PAYLOAD)
    except zlib.error:
        return None
    return payload if unpack.eof else None


def scan(data: Buffer) -> Iterator[Frame | int]:
    """Find every undamaged frame in order, and how many bytes between and after them are none.

    Zeros at the end are reserved space, not damage. Raises `ForgedFramesError` where damaged frames
    together are longer than twice the file plus 1 MB: forged ones would take hours to check.
    """
    position = good_end = 0
    left = 2 * len(data) + _MOST_IN_VAIN
    while (at := data.find(MAGIC, position)) >= 0:
        frame = _header_at(data, at)
        if frame is None or not _is_intact(data, frame):
            left -= frame.length if frame else 0
            if left < 0:
                raise ForgedFramesError("its frames are longer than the file")
            position = at + 1
            continue
        if at > good_end:
            yield at - good_end
        yield frame
        position = good_end = frame.start + frame.length + _CRC.size
    tail = _length_without_zeros(data, good_end)
    if tail:
        yield tail


def _header_at(data: Buffer, at: int) -> Frame | None:
    """None without an undamaged header, or where the file is too short for the frame."""
    header = data[at : at + HEADER_SIZE]
    if len(header) < HEADER_SIZE:
        return None
    _, run, kind, version, schema, number, length = _HEADER.unpack_from(header)
    if crc32(header[: _HEADER.size]) != _CRC.unpack_from(header, _HEADER.size)[0]:
        return None
    if version not in {_PLAIN_VERSION, FRAME_VERSION} or length > MAX_PAYLOAD:
        return None
    if at + HEADER_SIZE + length + _CRC.size > len(data):
        return None
    return Frame(0, run, number, kind, version, schema, length, at + HEADER_SIZE)


def _is_intact(data: Buffer, frame: Frame) -> bool:
    end = frame.start + frame.length
    return data[end : end + _CRC.size] == _CRC.pack(crc32(data[frame.start : end]))


def _length_without_zeros(data: Buffer, start: int) -> int:
    """Bytes from `start` to the last one that is not zero."""
    step = 1 << 20
    end = len(data)
    while end > start:
        chunk = data[max(start, end - step) : end].rstrip(b"\0")
        if chunk:
            return max(start, end - step) + len(chunk) - start
        end = max(start, end - step)
    return 0


# --- the hash chain ---

#     digest 0 = 32 zero bytes
#     digest n+1 = SHA-256(digest n | number u32 | kind u8 | payload), little-endian
#
# The payload is taken before it is compressed, so that journal and HDF5 give the same digest.
# There is no key: the chain proves that a run is the one whose digest was noted elsewhere, not who
# recorded it. A third party needs nothing but the file in either form.

_LINK = struct.Struct("<IB")


class Chain:
    """A hash chain fed with frames in the order of their numbers.

    `broken_at` is the first missing number.
    """

    def __init__(self) -> None:
        self._digest = bytes(32)
        self._expected = 0
        self.broken_at: int | None = None

    @property
    def digest(self) -> str:
        """Digest of all frames so far, hexadecimal."""
        return self._digest.hex()

    def add(self, number: int, kind: int, payload: bytes) -> None:
        if number != self._expected and self.broken_at is None:
            self.broken_at = self._expected
        self._expected = number + 1
        self._digest = sha256(self._digest + _LINK.pack(number, kind) + payload).digest()


@dataclass(frozen=True, slots=True)
class Sealing:
    """Results of the hash chain of a run.

    `recomputed_digest` covers the frames before the END frame, or all frames without one. `surplus`
    names a table of the HDF5 file with rows that are in no frame, `differences` everything else
    that differs from the chained frames; `stop_is_sealed` is False for a run of an earlier version,
    whose chain leaves the stop out. `continues` is whether the run begins with all of the one that
    was asked for.
    """

    end: RunEnd | None
    damage: Damage
    recomputed_digest: str
    broken_at: int | None
    surplus: str = ""
    differences: tuple[str, ...] = ()
    stop_is_sealed: bool = True
    continues: bool = False

    @property
    def holds(self) -> bool:
        """True when the run was sealed and all frames are as they were then."""
        if self.end is None or self.broken_at is not None or self.surplus:
            return False
        return self.recomputed_digest == self.end.digest

    @property
    def chain_alteration(self) -> str:
        """What the chain shows to have been altered; a missing frame is damage only."""
        if self.broken_at is not None:
            return ""
        if self.surplus:
            return f"{self.surplus} has rows that were not recorded"
        if self.end is not None and self.recomputed_digest != self.end.digest:
            return f"sealed with {self.end.digest}, recomputed {self.recomputed_digest}"
        return ""

    @property
    def alterations(self) -> tuple[str, ...]:
        """Everything that is not as it was recorded."""
        return (*filter(None, [self.chain_alteration]), *self.differences)


@dataclass(slots=True)
class Sealed:
    """A chain that keeps the STOP frame and the digest before the END frame, the last one.

    `continues` is whether it has been at the digest `earlier`.
    """

    earlier: str = ""
    continues: bool = False
    chain: Chain = field(default_factory=Chain)
    before_end: str | None = None
    stop: bytes | None = None
    n_after_end: int = 0

    def add(self, number: int, kind: int, payload: bytes) -> None:
        if self.before_end is not None:
            self.n_after_end += 1
        elif kind == Kind.END:
            self.before_end = self.chain.digest
        elif kind == Kind.STOP:
            self.stop = payload
        self.chain.add(number, kind, payload)
        if self.earlier:
            self.continues |= self.chain.digest == self.earlier

    @property
    def recomputed_digest(self) -> str:
        return self.before_end or self.chain.digest

    def differences(self, end: RunEnd | None) -> list[str]:
        """What contradicts the stated end of the run."""
        found = []
        if self.n_after_end:
            found.append(f"frames: {self.n_after_end} stand after the seal")
        if (end is None) != (self.before_end is None):
            found.append("end: it differs from the last frame")
        elif end is not None and self.stop is not None and self.stop != stop_text(end):
            found.append("end: it is not the stop that was sealed")
        return found
