"""Frames of Qualcomm's diagnostic stream, and the log records in them.

A frame is a packet and its CRC-16/X.25, little-endian; 7E and 7D become 7D and the byte ^ 20, and
7E ends it. Packet 10 is a log record; packet 98 names the receiver of the packet within. Checked
with captures of MobileInsight, QCSuper and Rayhunter.
"""

from binascii import crc_hqx
from collections import Counter
from collections.abc import Iterator
from struct import Struct
from typing import NamedTuple

_END = b"\x7e"
_ESCAPE = b"\x7d"
REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
"""CRC-16/X.25 takes the lowest bit of a byte first, the fast `crc_hqx` the highest."""
_RIGHT = 0x1D0F
"""What `crc_hqx` leaves of a packet with its CRC, bits reversed."""

_LOG = 0x10
_RADIO = 0x98
_HEADER = Struct("<BxHHHQ")
_RADIO_HEADER = Struct("<BBxxI")
_CRC_BYTES = 2
_BEFORE_LENGTH = 4
"""Bytes of a log packet that its two lengths do not count."""
_HEAD_BYTES = 2 * (_RADIO_HEADER.size + 8)
"""A frame names its code within them, even if each byte is escaped."""
_MOST_BYTES = 2 * (_RADIO_HEADER.size + _BEFORE_LENGTH + 0xFFFF + _CRC_BYTES)

_GPS_EPOCH_NS = 315_964_800 * 10**9
"""1980-01-06 in Unix time; the modem counts no leap seconds since."""
_TICK_NS = 1_250_000
_TICK_PARTS = 49_152
_LAST_NS = 1 << 62


class LogRecord(NamedTuple):
    """A log record that passed CRC and lengths.

    `time_ns` is the modem's clock as Unix time, of 1980 until a network sets it. `radio_id` tells
    the receivers of one modem apart, 0 if unnamed.
    """

    code: int
    radio_id: int
    time_ns: int
    body: bytes


class FrameReader:
    """Log records of allowed codes in a stream of bytes, cut anywhere.

    A frame of another code is neither copied nor checked. Counts: `n_records` returned; `damaged`
    frames by reason; `skipped` by code; `n_other` packets that are no log records.
    """

    def __init__(self, codes: frozenset[int]) -> None:
        self._codes = codes
        self._rest = b""
        self._overlong = False
        self.n_records = self.n_other = 0
        self.damaged: Counter[str] = Counter()
        self.skipped: Counter[int] = Counter()

    def feed(self, data: bytes) -> list[LogRecord]:
        """Records of the frames that end in `data`."""
        data = self._rest + data if self._rest else data
        records: list[LogRecord] = []
        start = 0
        while (end := data.find(_END, start)) >= 0:
            if self._overlong:
                self._overlong = False
            elif end > start:
                records += self._records_of(data, start, end)
            start = end + 1
        self._rest = data[start:]
        if len(self._rest) > _MOST_BYTES:
            if not self._overlong:
                self.damaged["longer than any frame"] += 1
            self._overlong, self._rest = True, b""
        self.n_records += len(records)
        return records

    def end(self) -> None:
        """Count what the stream's end cut."""
        if self._rest:
            self.damaged["cut"] += 1
        self._rest = b""

    def _records_of(self, data: bytes, start: int, end: int) -> Iterator[LogRecord]:
        """Two records if the 7E between two frames was damaged."""
        head = unescape(data[start : min(end, start + _HEAD_BYTES)])
        at = _RADIO_HEADER.size if head[:1] == bytes([_RADIO]) else 0
        if head[at : at + 1] != bytes([_LOG]):
            self.n_other += 1
            return
        code = int.from_bytes(head[at + 6 : at + 8], "little")
        if code not in self._codes:
            self.skipped[code] += 1
            return
        raw = data[start:end]
        packet = unescape(raw)
        if _is_right(packet) and raw.count(_ESCAPE) == len(raw) - len(packet):
            if (record := _record(packet, at)) is None:
                self.damaged["lengths"] += 1
            else:
                yield record
            return
        self.damaged["CRC"] += 1
        size = _size(packet, at)
        if size is None or len(packet) <= size or not _is_right(packet[:size]):
            return
        if (record := _record(packet[:size], at)) is not None:
            yield record
        after = start + len(escape(packet[:size])) + 1
        if after < end:
            yield from self._records_of(data, after, end)


def is_stream(head: bytes) -> bool:
    """Whether bytes from a file's begin hold a frame with a log record."""
    frames = (unescape(raw) for raw in head.split(_END))
    return any(
        packet[at : at + 1] == bytes([_LOG]) and _size(packet, at) == len(packet)
        for packet in frames
        if _is_right(packet)
        for at in (0, _RADIO_HEADER.size)
    )


def unescape(raw: bytes) -> bytes:
    if _ESCAPE not in raw:
        return raw
    return raw.replace(b"\x7d\x5e", b"\x7e").replace(b"\x7d\x5d", b"\x7d")


def escape(packet: bytes) -> bytes:
    return packet.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e")


def _is_right(packet: bytes) -> bool:
    return crc_hqx(packet.translate(REVERSED), 0xFFFF) == _RIGHT


def _size(packet: bytes, at: int) -> int | None:
    if len(packet) < at + _HEADER.size + _CRC_BYTES:
        return None
    _, outer, inner, _, _ = _HEADER.unpack_from(packet, at)
    return at + outer + _BEFORE_LENGTH + _CRC_BYTES if outer == inner else None


def _record(packet: bytes, at: int) -> LogRecord | None:
    if _size(packet, at) != len(packet):
        return None
    _, _, _, code, time = _HEADER.unpack_from(packet, at)
    ticks, parts = divmod(time, 1 << 16)
    time_ns = _GPS_EPOCH_NS + ticks * _TICK_NS + parts * _TICK_NS // _TICK_PARTS
    if time_ns > _LAST_NS:
        return None
    radio_id = _RADIO_HEADER.unpack_from(packet)[2] if at else 0
    return LogRecord(code, radio_id, time_ns, packet[at + _HEADER.size : -_CRC_BYTES])
