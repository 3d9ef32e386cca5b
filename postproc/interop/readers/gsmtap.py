"""Packet captures (pcapng, pcap) of GSMTAP: levels of its version 3, places of Rayhunter.

Sources: the pcapng specification (IETF draft), the writer of SCAT 2.1 for the tags of version 3,
pcap.rs of EFForg/rayhunter for the place in the comment of a packet. Of a packet only channel, code
and level are read: keys have tags too. Version 2 has no level, and of LTE neither whole channel
nor code.
"""

import json
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import IO, NamedTuple

from logger.core.cell_names import HIGHEST
from logger.core.errors import GeoError, RunFileError
from logger.core.foreign import open_regular
from logger.core.types import Fix, Rat
from logger.drivers.diag.levels import Observation
from postproc.foreign_file import MOST_READINGS
from postproc.interop.contents import PACKETS, Format
from postproc.interop.readers import diag
from postproc.interop.sighting import NoCell, Row, fix_of, number
from postproc.progress import with_count

_PORT = 4729
_SECTION, _INTERFACE, _PACKET = 0x0A0D0D0A, 1, 6
_MOST_BYTES = 1 << 20
"""Of a block; a packet has 64 kB."""
_COMMENT, _RESOLUTION = 1, 9
_IP_AT: Mapping[int, int] = MappingProxyType({0: 4, 1: 14, 101: 0, 113: 16, 228: 0, 276: 20})
"""Where IPv4 begins in a packet, by link type."""
_UDP = 17
_CHANNEL, _CODE, _END = 2, 5, 0xFFFE
_RATS: Mapping[int, tuple[Rat, tuple[int, ...]]] = MappingProxyType(
    {
        2: ("GSM", (0x0100, 0x0101)),
        3: ("WCDMA", (0x0104,)),
        4: ("LTE", (0x0106,)),
    }
)
"""Technology by the upper byte of a packet's type, and the tags of the level of its cells."""
_LEVELS_DBM = (-160.0, -20.0)


class Packet(NamedTuple):
    """A packet of the capture: Unix time, link type, bytes, comment."""

    time_ns: int
    link: int
    data: bytes
    comment: bytes


_NO_LEVEL, _NO_GSMTAP = "packets without a level", "packets that are no GSMTAP"
_CUT = "damaged packets, cut"
_WITH_LEVELS = 3
"""Of the versions of GSMTAP."""


def read(source: Path) -> Iterator[Row]:
    """A row for each second and cell; raises `RunFileError` for a capture without levels."""
    left: Counter[str] = Counter()
    versions: Counter[int] = Counter()
    yield from diag.rows_of(_observations(source, versions, left))
    if _WITH_LEVELS not in versions and versions:
        raise RunFileError(
            f"{source} has GSMTAP version {max(versions)}, which has no levels: import the "
            "recording itself (.qmdl); its places count with --track"
        )
    for version, n in versions.items():
        if version != _WITH_LEVELS:
            yield NoCell(0, f"GSMTAP version {version}", n)
    yield from (NoCell(0, why, left[why]) for why in (_NO_LEVEL, _NO_GSMTAP, _CUT) if left[why])


def positions(source: Path) -> list[Fix]:
    """Places in comments of packets, each once, by the clock of the modem."""
    by_time: dict[int, Fix] = {}
    for packet in _packets(source, Counter()):
        if not packet.comment:
            continue
        with suppress(ValueError, GeoError, RecursionError):
            place = json.loads(packet.comment)
            utc_ns = int(number(place, "unix_ts", (0.0, 4e9))) * 10**9
            # a place that has the time of an earlier one came later: its packet was old
            by_time.setdefault(utc_ns, fix_of(place, "lat", "lon", utc_ns))
        if len(by_time) > MOST_READINGS:
            raise RunFileError(f"{source} has more than {MOST_READINGS:,} positions")
    return list(by_time.values())


def _observations(
    source: Path, versions: Counter[int], left: Counter[str]
) -> Iterator[Observation]:
    for packet in _packets(source, left):
        gsmtap = _gsmtap(packet)
        if not gsmtap:
            left[_NO_GSMTAP] += 1
            continue
        versions[gsmtap[0]] += 1
        if gsmtap[0] == _WITH_LEVELS:
            observation = _observation(packet.time_ns, gsmtap)
            if observation is None:
                left[_NO_LEVEL] += 1
            else:
                yield observation


def _observation(time_ns: int, gsmtap: bytes) -> Observation | None:
    if len(gsmtap) < 8 or gsmtap[4] not in _RATS:
        return None
    rat, levels = _RATS[gsmtap[4]]
    found = _tags(gsmtap, {_CHANNEL, _CODE, *levels})
    if not {_CHANNEL, _CODE} <= found.keys():
        return None
    channel, code = (int.from_bytes(found[tag], "big") for tag in (_CHANNEL, _CODE))
    level = next((found[tag] for tag in levels if len(found.get(tag, b"")) == 4), None)
    if level is None or channel > HIGHEST[rat][0] or code > HIGHEST[rat][1]:
        return None
    (level_dbm,) = struct.unpack(">f", level)
    if not _LEVELS_DBM[0] <= level_dbm <= _LEVELS_DBM[1]:
        return None
    return Observation(time_ns, 0, rat, channel, code, "neighbour", level_dbm)


def _tags(gsmtap: bytes, wanted: set[int]) -> dict[int, bytes]:
    found: dict[int, bytes] = {}
    at = 8
    while at + 4 <= len(gsmtap):
        tag, length = struct.unpack_from(">HH", gsmtap, at)
        if tag == _END or at + 4 + length > len(gsmtap):
            break
        if tag in wanted and length <= 4:
            found[tag] = gsmtap[at + 4 : at + 4 + length]
        at += 4 + length
    return found


def _gsmtap(packet: Packet) -> bytes:
    """The payload of a packet to or from the port of GSMTAP, empty for another."""
    at, data = _IP_AT.get(packet.link, -1), packet.data
    if at < 0 or len(data) < at + 28 or data[at] >> 4 != 4 or data[at + 9] != _UDP:
        return b""
    udp = at + 4 * (data[at] & 15)
    ports = data[udp : udp + 4]
    if _PORT not in (int.from_bytes(ports[:2], "big"), int.from_bytes(ports[2:], "big")):
        return b""
    return data[udp + 8 :]


def _packets(source: Path, left: Counter[str]) -> Iterator[Packet]:
    try:
        with open_regular(source) as file:
            begin = file.read(4)
            read = _of_pcapng if begin == PACKETS[0] else _of_pcap
            packets = read(file, begin, left)
            yield from with_count(packets, f"{source.name}: packets")
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror or error}") from error


def _of_pcap(file: IO[bytes], begin: bytes, left: Counter[str]) -> Iterator[Packet]:
    order = ">" if begin == PACKETS[2] else "<"
    unit_ns = 1 if begin == PACKETS[3] else 1000
    header = file.read(20)
    if len(header) < 20:
        left[_CUT] = 1
        return
    link = struct.unpack_from(f"{order}I", header, 16)[0] & 0xFFFF
    while head := file.read(16):
        size = 0
        if len(head) == 16:
            seconds, parts, size, _ = struct.unpack(f"{order}IIII", head)
        data = file.read(size) if 0 < size <= _MOST_BYTES else b""
        if not data or len(data) < size:
            left[_CUT] = 1
            return
        yield Packet(seconds * 10**9 + parts * unit_ns, link, data, b"")


def _of_pcapng(file: IO[bytes], begin: bytes, left: Counter[str]) -> Iterator[Packet]:
    order, links = "<", list[tuple[int, int]]()
    head = begin + file.read(4)
    while head:
        if head[:4] == PACKETS[0]:
            magic = file.read(4)
            order, links = ("<" if magic == b"\x4d\x3c\x2b\x1a" else ">"), []
            head += magic
        kind, size = struct.unpack_from(f"{order}II", head) if len(head) >= 8 else (0, 0)
        body = head[8:] + file.read(max(0, min(size, _MOST_BYTES) - len(head)))
        if not 12 <= size <= _MOST_BYTES or size % 4 or len(body) != size - 8:
            left[_CUT] = 1
            return
        if kind == _INTERFACE and len(body) >= 12 and len(links) < 1000:
            link = int(struct.unpack_from(f"{order}H", body)[0])
            links.append((link, _per_second(_option(order, body[8:-4], _RESOLUTION))))
        elif kind == _PACKET and len(body) >= 24:
            interface, high, low, length, _ = struct.unpack_from(f"{order}5I", body)
            padded = length + -length % 4
            if interface < len(links) and 20 + padded <= len(body) - 4:
                link, per_second = links[interface]
                time_ns = ((high << 32) + low) * 10**9 // per_second
                comment = _option(order, body[20 + padded : -4], _COMMENT)
                if time_ns < 1 << 62:
                    yield Packet(time_ns, link, body[20 : 20 + length], comment)
        head = file.read(8)


def _per_second(resolution: bytes) -> int:
    """Units of a second: a power of ten, or of two with the highest bit set."""
    exponent = resolution[0] if resolution else 6
    return int(2 ** min(exponent & 127, 63)) if exponent & 128 else int(10 ** min(exponent, 18))


def _option(order: str, options: bytes, wanted: int) -> bytes:
    at = 0
    while at + 4 <= len(options):
        kind, length = struct.unpack_from(f"{order}HH", options, at)
        if kind == wanted:
            return options[at + 4 : at + 4 + length]
        if kind == 0:
            break
        at += 4 + length + -length % 4
    return b""


IMPORTS = (
    Format(
        "GSMTAP packets",
        read,
        "time of the packets",
        lambda seen: seen.kind == "packets",
        has_scans=True,
        unrepeated=True,
        capture=True,
    ),
)
