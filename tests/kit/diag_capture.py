"""Records of Qualcomm's diagnostic stream as a modem writes them, and Rayhunter's zip of them.

Written from 3GPP's and SCAT's descriptions and not from the decoder: layouts stand here again.
"""

import json
import struct
import zipfile
from pathlib import Path

UNIX_OF_1980_NS = 315_964_800 * 10**9
T0_NS = 1_790_028_000 * 10**9
"""2026-09-21."""
EARFCN, PCI, OTHER_PCI = 1300, 17, 18
IDENTITY = ("262", "01", 4711, 26_214_401)
NAME = "262-01-4711-26214401"
LAT, LON = 47.07, 15.44
AHEAD_NS = 7 * 10**9
"""Of the clock of the hotspot before that of the modem."""


def crc16(data):
    """CRC-16/X.25, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc ^ 0xFFFF


def frame(packet):
    """A packet as it crosses a port."""
    escaped = bytearray()
    for byte in packet + struct.pack("<H", crc16(packet)):
        escaped += bytes([0x7D, byte ^ 0x20]) if byte in {0x7D, 0x7E} else bytes([byte])
    return bytes(escaped) + b"\x7e"


def modem_time(time_ns):
    ticks, rest_ns = divmod(time_ns - UNIX_OF_1980_NS, 1_250_000)
    return ticks << 16 | rest_ns * 49_152 // 1_250_000


def log_packet(code, time_ns, body, radio_id=None):
    length = len(body) + 12
    packet = struct.pack("<BBHHHQ", 0x10, 0, length, length, code, modem_time(time_ns)) + body
    return packet if radio_id is None else struct.pack("<BBHI", 0x98, 1, 0, radio_id) + packet


def log_frame(code, time_ns, body, radio_id=None):
    return frame(log_packet(code, time_ns, body, radio_id))


def serving_cell(earfcn, pci, rsrp_dbm):
    """Body of B17F version 5."""
    rsrp = round((rsrp_dbm + 180.0) * 16.0)
    rsrq = round((-10.0 + 30.0) * 16.0)
    body = struct.pack("<BBHIHHIII", 5, 0, 0, earfcn, pci, 0, rsrp, rsrp, rsrq)
    return body.ljust(36, b"\0")


def neighbour_cells(earfcn, cells):
    """Body of B180 version 5; `cells` are pairs of PCI and level."""
    body = struct.pack("<BBHII", 5, 0, 0, earfcn, len(cells) << 6)
    for pci, rsrp_dbm in cells:
        rsrp = round((rsrp_dbm + 180.0) * 16.0)
        body += struct.pack("<I", rsrp << 20 | pci).ljust(32, b"\0")
    return body


def serving_identity(earfcn, pci, identity):
    """Body of B0C2 version 3; `identity` is (mcc, mnc, tac, cell identity)."""
    mcc, mnc, tac, cid = identity
    numbers = struct.pack("<BHIIBBI", 3, pci, earfcn, earfcn + 18_000, 50, 50, cid)
    return numbers + struct.pack("<HIHBHB", tac, 3, int(mcc), len(mnc), int(mnc), 0)


def random_access(ta_16ts):
    """Body of B062, answered."""
    attempt = b"\1\0\1\0\1\7".ljust(15, b"\0") + struct.pack("<H", ta_16ts)
    return struct.pack("<BBHBBH", 1, 1, 0, 6, 3, 4 + 52) + attempt.ljust(52, b"\0")


def gps_line(packet_ns, system_ns, lat_deg, lon_deg):
    """A line of Rayhunter's N-gps.ndjson."""
    line = {
        "latest_packet_timestamp": None if packet_ns is None else packet_ns // 10**9,
        "system_time": system_ns // 10**9,
        "lat": lat_deg,
        "lon": lon_deg,
    }
    return json.dumps(line) + "\n"


def place(second):
    return LAT + second * 1.2e-5, LON


def gps_lines(seconds, packet_ns=lambda second: T0_NS + second * 10**9):
    """A walk to the north, as Rayhunter has it."""
    return [gps_line(packet_ns(s), T0_NS + s * 10**9 + AHEAD_NS, *place(s)) for s in seconds]


def stream(seconds, t0_ns=T0_NS, shift=lambda second: 0):
    """Two cells heard each second, the serving one with its identity every 20 s."""
    data = b""
    for second in seconds:
        t_ns = t0_ns + second * 10**9 + shift(second)
        if second % 20 == 0:
            data += log_frame(0xB0C2, t_ns, serving_identity(EARFCN, PCI, IDENTITY))
        for part in range(3):
            at_ns = t_ns + part * 300_000_000
            level_dbm = -80.0 - second % 30 + part / 16
            data += log_frame(0xB17F, at_ns, serving_cell(EARFCN, PCI, level_dbm))
            body = neighbour_cells(EARFCN, [(OTHER_PCI, level_dbm - 9.0)])
            data += log_frame(0xB180, at_ns, body)
    return data


def rayhunter_zip(path: Path, stream, gps_lines, number="1790028000", **more):
    """The zip that Rayhunter's web page gives; `more` are its other files by their suffix."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{number}.qmdl", stream)
        if gps_lines:
            archive.writestr(f"{number}-gps.ndjson", "".join(gps_lines))
        for suffix, data in more.items():
            archive.writestr(f"{number}.{suffix}", data)
    return path


def pcapng(packets, order=">"):
    """Packets (time in ns, link type, bytes, comment) as pcapng, as Rayhunter writes it."""

    def block(kind, body):
        body += b"\0" * (-len(body) % 4)
        size = struct.pack(f"{order}I", len(body) + 12)
        return struct.pack(f"{order}I", kind) + size + body + size

    data = block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1))
    links = sorted({link for _, link, _, _ in packets})
    for link in links:
        data += block(1, struct.pack(f"{order}HHI", link, 0, 0))
    for time_ns, link, packet, comment in packets:
        high, low = divmod(time_ns // 1000, 1 << 32)
        head = struct.pack(f"{order}5I", links.index(link), high, low, len(packet), len(packet))
        body = head + packet + b"\0" * (-len(packet) % 4)
        if comment:
            text = comment.encode()
            body += struct.pack(f"{order}HH", 1, len(text)) + text + b"\0" * (-len(text) % 4)
            body += struct.pack(f"{order}HH", 0, 0)
        data += block(6, body)
    return data


def udp_packet(payload, port=4729):
    """IPv4 and UDP around a payload."""
    length = len(payload) + 28
    ip = struct.pack(
        ">BBHHHBBH4s4s", 0x45, 0, length, 0, 0, 64, 17, 0, b"\x7f\0\0\1", b"\x7f\0\0\1"
    )
    return ip + struct.pack(">HHHH", 13_337, port, len(payload) + 8, 0) + payload


def gsmtap3(kind, tags):
    """A packet of GSMTAP version 3; `tags` are pairs of number and bytes."""
    body = b"".join(struct.pack(">HH", tag, len(value)) + value for tag, value in tags)
    return struct.pack(">BBHHH", 3, 0, 0, kind, 0) + body + b"\xff\xfe"
