"""Log records: levels, identities and timing advance. SCAT (GPL) is an oracle, only here."""

import random
import re
import struct
from collections import Counter
from pathlib import Path
from statistics import median
from types import SimpleNamespace

import pytest

from logger.core.cell_names import Identity
from logger.drivers.diag.frames import FrameReader, LogRecord
from logger.drivers.diag.levels import ALLOWED_CODES, Decoder
from tests.kit import diag_capture as diag

CAPTURES = Path("../shared/captures")
T_NS = 1_700_000_000 * 10**9
SECOND_NS = 10**9
needs_captures = pytest.mark.skipif(not CAPTURES.is_dir(), reason="captures stay outside")


def decode(code, body, decoder=None, t_ns=T_NS, radio_id=0):
    return (decoder or Decoder()).feed(LogRecord(code, radio_id, t_ns, body))


def raw(level_dbm):
    return round((level_dbm + 180.0) * 16.0)


def subpacket(number, version, content, head=1):
    return struct.pack("<BBHBBH", head, 1, 0, number, version, len(content) + 4) + content


def receivers(version, rx0_dbm, rx1_dbm):
    """Cell of B193 from the code on: the level is that of the better receiver."""
    level = raw(max(rx0_dbm, rx1_dbm))
    words = [raw(rx0_dbm) << 10, raw(rx1_dbm) << 12, 0, 0]
    at, level = {19: (2, level), 22: (3, level), 36: (3, level - 640)}[version]
    words[at] |= level << 12
    size = {19: 88, 22: 120, 36: 128}[version]
    return b"".join(struct.pack("<I", word) for word in words).ljust(size - 16, b"\0")


def b193(version, cells, earfcn=1825):
    room = receivers(version, -100.0, -100.0)
    content = struct.pack("<IHH", earfcn, len(cells), 3)
    for pci, carrier, is_serving, level_dbm in cells:
        code = pci | carrier << 9 | is_serving << 12
        content += struct.pack("<H14x", code) + receivers(version, level_dbm, level_dbm - 5.0)
    return subpacket(25, version, content.ljust(8 + 4 * (16 + len(room)), b"\0"))


def b195(cells, earfcn=5780, number=31):
    content = struct.pack("<IHH", earfcn, len(cells) | 8 << 6, 0)
    for pci, level_dbm in cells:
        content += struct.pack("<I8xI", pci, raw(level_dbm)).ljust(52, b"\0")
    return subpacket(number, 4, content)


def b179(serving, neighbours, carrier=0):
    earfcn, pci, level_dbm = serving
    body = struct.pack("<IIIHHIHH", 4, carrier, earfcn, pci, 0, raw(level_dbm), 333, 333)
    body += struct.pack("<BBH", len(neighbours), 0, 0)
    for code, level in neighbours:
        body += struct.pack("<6H", code, raw(level), raw(level), 300, 300, 0)
    return body


def b062(ta_16ts, version=3, result=0, messages=7):
    at = {2: 13, 3: 15, 49: 15, 50: 18}[version]
    head = struct.pack("<BBBB", 1, result, 1, messages)
    head = head if version == 2 else b"\1\0" + head
    content = head.ljust(at, b"\0") + struct.pack("<H", ta_16ts)
    return subpacket(6, version, content.ljust(52, b"\0"))


def cells_of(observations):
    return [(o.channel, o.code, o.role, o.level_dbm) for o in observations]


@pytest.mark.parametrize("version", [19, 22, 36])
def test_serving_cells_and_others_of_one_record(version):
    cells = [(73, 0, 1, -98.5625), (220, 0, 0, -111.125), (185, 1, 1, -107.0)]
    assert cells_of(decode(0xB193, b193(version, cells))) == [
        (1825, 73, "serving", -98.5625),
        (1825, 220, "neighbour", -111.125),
        (1825, 185, "neighbour", -107.0),  # of another carrier that is aggregated
    ]


def test_neighbours_and_the_serving_cell_while_connected():
    neighbours = [(210, -119.3125), (68, -123.5)]
    assert cells_of(decode(0xB195, b195(neighbours))) == [
        (5780, 210, "neighbour", -119.3125),
        (5780, 68, "neighbour", -123.5),
    ]
    assert cells_of(decode(0xB192, b195(neighbours, number=27))) == cells_of(
        decode(0xB195, b195(neighbours))
    )
    body = b179((5780, 185, -109.375), neighbours)
    assert cells_of(decode(0xB179, body))[0] == (5780, 185, "serving", -109.375)
    assert cells_of(decode(0xB179, body))[1:] == cells_of(decode(0xB195, b195(neighbours)))
    other = b179((700, 185, -107.0), [], carrier=1)
    assert cells_of(decode(0xB179, other)) == [(700, 185, "neighbour", -107.0)]


@pytest.mark.parametrize(
    ("code", "body"),
    [
        (0xB17F, diag.serving_cell(300_000, 17, -80.0)),  # no such channel
        (0xB17F, diag.serving_cell(1300, 17, -20.0)),
        (0xB17F, diag.serving_cell(1300, 505, -80.0)),
        (0xB17F, diag.serving_cell(1300, 17, -80.0)[:35]),
        (0xB180, diag.neighbour_cells(1300, [(17, -90.0)])[:-1]),
        (0xB193, b193(36, [(73, 0, 1, -98.0)] * 5)),
        (0xB193, b193(36, [(73, 0, 1, -98.0)])[:-1]),
        (
            0xB193,
            b193(19, [(73, 0, 1, -98.0)]).replace(struct.pack("<I", raw(-98.0) << 10), b"\0" * 4),
        ),
        (0xB179, b179((5780, 185, -109.0), [(210, -119.0)])[:-1]),
        (0xB0C2, diag.serving_identity(1300, 17, ("000", "01", 1, 2))),
        (0x5134, bytes.fromhex("10800801187662f220014100ff")),
    ],
)
def test_what_cannot_be_is_refused_and_counted(code, body):
    decoder = Decoder()
    assert decode(code, body, decoder) == []
    assert decoder.refused == {code: 1}
    assert decoder.n_read == 0


def test_an_unknown_version_is_counted_and_not_guessed():
    decoder = Decoder()
    body = b193(36, [(73, 0, 1, -98.0)])
    for _ in range(3):
        assert decode(0xB193, body[:5] + bytes([47]) + body[6:], decoder) == []
    assert decode(0xB17F, b"\7" + diag.serving_cell(1300, 17, -80.0)[1:], decoder) == []
    assert decode(0xB193, b"\2" + body[1:], decoder) == []
    assert decoder.unknown == {(0xB193, 47): 3, (0xB17F, 7): 1, (0xB193, 2): 1}
    assert decode(0x11EB, body, decoder) == []  # IP packets: no code that is read


def test_a_record_for_one_of_two_sims():
    decoder = Decoder()
    cell = bytes.fromhex("10800401187662f220014100ff")
    (one,) = decode(0x5B34, b"\1" + cell, decoder)
    assert (one.radio_id, one.channel, one.code) == (1, 16, 12)
    assert one.identity == Identity("262", "02", 321, 30232)
    (level,) = decode(0x5A7A, b"\1\x34\xfb\0", decoder)
    assert (level.radio_id, level.channel, level.code, level.level_dbm) == (1, 16, 12, -76.75)
    assert decode(0x5A7A, b"\0\x34\xfb\0", decoder) == []  # the other SIM has named no cell


def test_timing_advance_belongs_to_a_cell_that_stays():
    """A random access leads to the serving cell, or in a handover to another one."""
    for other, expected in ((17, [5]), (18, [])):
        decoder = Decoder()
        decode(0xB17F, diag.serving_cell(1300, 17, -80.0), decoder)
        assert decode(0xB062, b062(5), decoder, T_NS + SECOND_NS) == []
        soon = decode(0xB17F, diag.serving_cell(1300, 17, -80.0), decoder, T_NS + SECOND_NS + 9)
        later = diag.serving_cell(1300, other, -80.0)
        seen = soon + decode(0xB17F, later, decoder, T_NS + 3 * SECOND_NS)
        assert [(o.ta_16ts, o.code) for o in seen if o.ta_16ts is not None] == [
            (ta, 17) for ta in expected
        ]


@pytest.mark.parametrize("version", [2, 3, 49, 50])
def test_timing_advance_of_each_version(version):
    for body, ta_16ts in (
        (b062(199, version), 199),
        (b062(0xFFFF, version), None),
        (b062(199, version, result=1), None),
        (b062(199, version, messages=5), None),
    ):
        decoder = Decoder()
        decode(0xB17F, diag.serving_cell(1300, 17, -80.0), decoder)
        decode(0xB062, body, decoder)
        seen = decode(0xB17F, diag.serving_cell(1300, 17, -80.0), decoder, T_NS + 2 * SECOND_NS)
        assert [o.ta_16ts for o in seen if o.ta_16ts] == ([] if ta_16ts is None else [ta_16ts])
    assert decode(0xB062, b062(1283, version), decoder) == []
    assert decoder.refused[0xB062] == 1


def test_a_gsm_neighbour_list_between_two_names_of_its_cell():
    def message(kind, content):
        layer3 = bytes([0x49, 6, kind]) + content
        return bytes([0x81, kind, len(layer3)]) + layer3

    own = message(0x1B, bytes.fromhex("761862f2200141").ljust(15, b"\x2b"))
    listed = message(0x1A, (1 << 3 | 1 << 41).to_bytes(16, "big"))
    decoder = Decoder()
    decode(0x5134, bytes.fromhex("10800401187662f220014100ff"), decoder)
    seen = [
        one
        for body in (own, listed, own, own)
        for one in decode(0x512F, body, decoder, T_NS + SECOND_NS)
    ]
    assert [one.neighbours for one in seen] == [None, (4, 42), None]
    assert {(one.channel, one.identity.cid) for one in seen} == {(16, 30232)}
    sms = message(0x15, b"262017654321098")
    assert decode(0x512F, sms, decoder) == []


def test_levels_of_wcdma_cells():
    cell = struct.pack(
        "<IIIHBBH3B3BII", 9713, 10663, 137200961, 7, 0, 0, 397 << 4, 2, 6, 2, 2, 0, 15, 40093, 1
    )
    decoder = Decoder()
    (one,) = decode(0x4127, cell, decoder)
    assert one.identity == Identity("262", "20", 40093, 137200961)
    ranked = struct.pack("<BB5x", 0x82, 0)
    for psc, rscp in ((397, -95), (49, -98)):
        ranked += struct.pack("<HHbhbhbhhb", 10663, psc, rscp + 21, 0, -15, 0, 0, 0, 0, 0)
    assert cells_of(decode(0x4005, ranked, decoder)) == [
        (10663, 397, "serving", -95.0),
        (10663, 49, "neighbour", -98.0),
    ]


def bodies(rng):
    """Bodies of every code: right ones, damaged ones, and any bytes."""
    right = [
        (0xB17F, diag.serving_cell(1300, 17, -80.0)),
        (0xB180, diag.neighbour_cells(1300, [(17, -90.0), (18, -91.0)])),
        (0xB0C2, diag.serving_identity(1300, 17, ("262", "01", 4711, 26_214_401))),
        *((0xB193, b193(version, [(73, 0, 1, -98.0)])) for version in (19, 22, 36)),
        (0xB195, b195([(210, -119.0)])),
        (0xB179, b179((5780, 185, -109.0), [(210, -119.0)])),
        *((0xB062, b062(5, version)) for version in (2, 3, 49, 50)),
        (0x5134, bytes.fromhex("10800401187662f220014100ff")),
    ]
    codes = sorted(ALLOWED_CODES)
    while True:
        if rng.random() < 0.3:
            yield rng.choice(codes), rng.randbytes(rng.randrange(120))
            continue
        code, body = rng.choice(right)
        damaged = bytearray(body)
        for _ in range(rng.randrange(1, 4)):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        yield code, bytes(damaged[: rng.choice([len(damaged), rng.randrange(len(damaged) + 1)])])


def check_any_bodies(n, seed):
    """No exception, and each observation is possible."""
    some, decoder = bodies(random.Random(seed)), Decoder()
    for i in range(n):
        code, body = next(some)
        for one in decode(code, body, decoder, T_NS + i * 10**7, i % 3):
            assert one.level_dbm is None or -156.0 <= one.level_dbm <= -20.0
            assert one.channel is None or 0 <= one.channel <= 262_143
            assert one.code is None or 0 <= one.code <= 511
    assert decoder.refused
    assert decoder.unknown


def test_no_body_is_too_strange():
    check_any_bodies(5000, 1)


@pytest.mark.slow
def test_no_body_of_a_million_is_too_strange():
    check_any_bodies(1_000_000, 2)


def records(name, codes=ALLOWED_CODES):
    return FrameReader(codes).feed((CAPTURES / name).read_bytes())


@needs_captures
@pytest.mark.parametrize(
    ("name", "n"),
    [
        ("att.mi2log", 1540),
        ("attach_sample.mi2log", 771),
        ("bler_sample.mi2log", 2792),
        ("mobility_sample.mi2log", 911),
        ("overlink_500KB3.mi2log", 174),
    ],
)
def test_every_record_of_a_capture_is_read(name, n):
    decoder = Decoder()
    for record in records(name):
        decoder.feed(record)
    assert (decoder.n_read, decoder.refused, decoder.unknown) == (n, {}, {})


@needs_captures
def test_two_codes_agree_on_the_levels_of_neighbours():
    decoder, latest, apart_db = Decoder(), {}, []
    for record in records("att.mi2log"):
        for one in decoder.feed(record):
            if one.role != "neighbour":
                continue
            pair = one.channel, one.code
            if record.code == 0xB195:
                latest[pair] = one
            elif record.code == 0xB179 and pair in latest:
                other = latest[pair]
                if abs(other.time_ns - one.time_ns) < SECOND_NS // 2:
                    apart_db.append(one.level_dbm - other.level_dbm)
    assert len(apart_db) > 100
    assert abs(median(apart_db)) <= 0.3


PRINTED = {
    0xB17F: r"EARFCN: (?P<channel>\d+), PCI: +(?P<code>\d+), Measured RSRP: (?P<level>[-.\d]+)",
    0xB180: r"PCI: +(?P<code>\d+), RSRP: (?P<level>[-.\d]+)",
    0xB0C1: r"MIB Info: EARFCN: (?P<channel>\d+)",
    0xB0C2: r"EARFCN: (?P<channel>\d+)/.*PCI: (?P<code>\d+), MCC: (?P<mcc>\d+), MNC: (?P<mnc>\d+), "
    r"xTAC/xCID: (?P<area>\w+)/(?P<cid>\w+)",
    0x5071: r"Cell \d+: ARFCN: (?P<channel>\d+)/BC: \d+/BSIC: (?P<code>[\w/]+), "
    r"RxPwr: (?P<level>[-.\d]+)",
    0x507B: r"ARFCN: (?P<channel>\d+)/BC: \d+, RxPwr: (?P<level>[-.\d]+)",
    0x507A: r"RxPwr: (?P<level>[-.\d]+)",
    0x506C: r"ARFCN: (?P<channel>\d+)/BC: \d+, RSSI: \d+, RxPwr: (?P<level>[-.\d]+)",
    0x5134: r"ARFCN: (?P<channel>\d+)/Band: \d+, BCC: (?P<bcc>\d), NCC: (?P<ncc>\d), "
    r"MCC/MNC: (?P<mcc>\d+)/(?P<mnc>\d+), xLAC/xCID: (?P<area>\w+)/(?P<cid>\w+)",
    0x4127: r"UARFCN: (?P<channel>\d+)/\d+, PSC: (?P<code>\d+), "
    r"MCC/MNC: (?P<mcc>\d+)/(?P<mnc>\d+), xLAC/xRAC/xCID: (?P<area>\w+)/\w+/(?P<cid>\w+)",
    0x4005: r"UARFCN: (?P<channel>\d+), PSC: +(?P<code>\d+), RSCP: (?P<level>[-\d]+)",
}  # fmt: skip


def by_scat(records_):
    """What SCAT prints of records, as numbers."""
    pytest.importorskip("scat", reason="SCAT (GPL), the oracle, is not installed")
    from scat.parsers.qualcomm.qualcommparser import QualcommParser

    parser = QualcommParser()
    for record in records_:
        head = SimpleNamespace(log_id=record.code, timestamp=0)
        said = parser.process[record.code](head, record.body, {"radio_id": 0})
        for match in re.finditer(PRINTED[record.code], said["stdout"]):
            yield {k: v for k, v in match.groupdict().items() if v is not None}


def as_printed(code, one):
    """An observation in the words of SCAT."""
    said = {"channel": str(one.channel), "code": str(one.code)}
    if one.level_dbm is not None:
        said["level"] = f"{one.level_dbm:.0f}" if code == 0x4005 else f"{one.level_dbm:.2f}"
    if one.identity is not None:
        mcc, mnc, area, cell_id = one.identity
        said |= {"mcc": mcc, "mnc": mnc, "area": f"{area:x}", "cid": f"{cell_id:x}"}
    return said


def assert_as_scat(records_):
    decoder = Decoder()
    ours = [(r.code, one) for r in records_ for one in decoder.feed(r)]
    theirs = list(by_scat(records_))
    assert len(ours) == len(theirs) > 0
    for (code, one), said in zip(ours, theirs, strict=True):
        if "ncc" in said:
            said["code"] = str(8 * int(said.pop("ncc")) + int(said.pop("bcc")))
        if said.get("code") == "N/A":
            said["code"] = "None"
        assert said.items() <= as_printed(code, one).items()


@needs_captures
@pytest.mark.filterwarnings("ignore")
def test_identities_are_those_that_scat_reads():
    for name in ("attach_sample.mi2log", "mobility_sample.mi2log"):
        assert_as_scat([r for r in records(name) if r.code in {0xB0C1, 0xB0C2}])


def gsm_cells(rng, n):
    return [(rng.randrange(1024) | 8 << 12, rng.randrange(-115 * 16, -47 * 16)) for _ in range(n)]


def random_body(code, rng):
    """A body of a layout of which there is no capture."""
    level_dbm = rng.randrange(-140 * 16, -44 * 16) / 16
    if code == 0xB17F:
        version_4 = struct.pack("<BBHHHII", 4, 1, 0, 6300, 214, raw(level_dbm), 0).ljust(36, b"\0")
        return rng.choice([diag.serving_cell(66_000, 333, level_dbm).ljust(40, b"\0"), version_4])
    if code == 0xB180:
        return diag.neighbour_cells(3350, [(rng.randrange(504), level_dbm), (9, -100.0)])
    if code == 0x5071:
        cells = [
            struct.pack("<HhBB6x", *c, rng.randrange(2), rng.randrange(64))
            for c in gsm_cells(rng, 5)
        ]
        return bytes([5]) + b"".join(cells)
    if code == 0x507B:
        return bytes([6]) + b"".join(struct.pack("<Hh", *c) for c in gsm_cells(rng, 6))
    if code == 0x4005:
        cell = struct.pack("<HHbhb", 10737, rng.randrange(512), rng.randrange(-90, -20), 0, -15)
        ends = {0: b"\0\0", 1: b"\0\0\0", 2: bytes(8)}
        version = rng.randrange(3)
        head = bytes([version << 6 | 2, 0]) + bytes(5 if version == 2 else 0)
        return head + 2 * (cell + ends[version])
    raise AssertionError(code)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("code", [0xB17F, 0xB180, 0x5071, 0x507B, 0x4005])
def test_levels_are_those_that_scat_reads(code):
    rng = random.Random(code)
    assert_as_scat([LogRecord(code, 0, T_NS, random_body(code, rng)) for _ in range(300)])


@pytest.mark.filterwarnings("ignore")
def test_serving_cells_of_gsm_and_wcdma_are_those_that_scat_reads():
    rng = random.Random(3)
    for _ in range(100):
        arfcn, level = gsm_cells(rng, 1)[0]
        lai = bytes.fromhex(rng.choice(["62f220", "130014", "62f230"])) + rng.randbytes(2)
        cell = struct.pack("<HBBH", arfcn, 3, 4, rng.randrange(1 << 16)) + lai + b"\0\xff"
        burst = struct.pack("<IHIh", 1, arfcn, 5, level).ljust(23, b"\0")
        wcdma = struct.pack("<IIIHBBH", 9713, 10663, rng.randrange(1 << 28), 7, 0, 0, 397 << 4)
        wcdma += bytes([2, 6, 2, 0, 3, 15]) + struct.pack("<II", rng.randrange(1 << 16), 1)
        parts = [(0x5134, cell), (0x507A, struct.pack("<hB", level, 0))]
        parts += [(0x506C, b"\3" + 2 * burst + bytes(46)), (0x4127, wcdma)]
        assert_as_scat([LogRecord(code, 0, T_NS, body) for code, body in parts])


PUBLISHED = [
    (0xB17F, "040100009c18d60aecc44e00e2244e00fffce30ffed80a0047ad56021d310100a2624100",
     [(6300, 214, -101.25)]),
    (0xB17F, "05010000160d0000d40e00004bb444005444450039e514133149070048adfe019f310100a23f0000",
     [(3350, 212, -111.3125)]),
    (0xB17F, "0501000000190000a90d0000d9944d00d9944d006081d5d55d2568bc48ad3e027f314fe0891900e0",
     [(6400, 425, -102.4375)]),
    (0xB180, "040100009c1847008348e44ddea44c00cab4cc32b6d8420300000000ff773301ff77330122020100",
     [(6300, 131, -102.125)]),
    (0xB180, ("05010000160d0000480000006cea413bb4433b00b4f3cc33cf3c130200000000ffefc00fffefc00f"
              "45081600"), [(3350, 108, -120.75)]),
    (0xB0C1, "010001140554000264", [(1300, 256, None)]),
    (0xB0C1, "02030121070000f800024b", [(1825, 259, None)]),
    (0xB0C2, "028f001405644b64640074bc01d60503000000060102010000",
     [(1300, 143, Identity("262", "01", 0x5D6, 0x1BC7400))]),
    (0xB0C2, "034d0021070000714d00004b4b33c8b009159b03000000cc01020b0000",
     [(1825, 77, Identity("460", "11", 0x9B15, 0x9B0C833))]),
    (0xB0C2, "030b00fa0900004a50000000000b0692000b9005000000c20102060000",
     [(2554, 11, Identity("450", "06", 0x900B, 0x92060B))]),
    (0xB0C2, "03eb0138180000885e0000323203c06600045614000000060102030000",
     [(6200, 491, Identity("262", "03", 0x5604, 0x66C003))]),
    (0x507B, "062a806cf9318058f92b805df92d805df92f805cf90c80dcf8",
     [(42, None, -105.25), (49, None, -106.5), (43, None, -106.1875), (45, None, -106.1875),
      (47, None, -106.25), (12, None, -114.25)]),
    (0x507B, "030a80fff80c8019f910800af9",
     [(10, None, -112.0625), (12, None, -110.4375), (16, None, -111.375)]),
    (0x5134, "10800401187662f220014100ff", [(16, 12, Identity("262", "02", 0x141, 0x7618))]),
    (0x5134, "df830304dff362f23056040088", [(991, 35, Identity("262", "03", 0x5604, 0xF3DF))]),
    (0x5134, "25800303177662f220014100ff", [(37, 27, Identity("262", "02", 0x141, 0x7617))]),
    (0x4127, "f1250000a729000041852d0800000700d01802060200030f9d9c000001000000",
     [(10663, 397, Identity("262", "03", 0x9C9D, 0x82D8541))]),
    (0x4005, "82000000000000f1293200b6a5fff1f5ff000000000000f1293100b39effdedeff040000008000",
     [(10737, 50, -95.0), (10737, 49, -98.0)]),
]  # fmt: skip
# of the tests of SCAT and Rayhunter (lib/src/diag): channel, code, and level or identity
AFTER_ACCESS = {
    "0101a06906022400010001071bff98ff000001231a0400181c010007000600465c80bd0648000000": 4,
    "0101a0690603280001000100010718ffa4ff000001c6610b00b4a2000012000120061f423f8d950758000000": 11,
    "0101739e063134000100010000033f0098ff0000013c6b070058ac010007000000468f47e2d446000000644b"
    "0000180001000000d5040000": 7,
    "01010000063134000100010001070aff98ff0000011c48070018e2000007000000523b7dfd69b6000000f554"
    "0000ff0001000000d6040000": 7,
    "01010000063238000100010000032900a4ffeb000000000195b603000000a0b412000420061f425dc9be41b8"
    "00885e00001700010000006505000073": 3,
    "010100000632380001000100010713ffa0ffeb0000000001ad5a0500000146b412000420061f425dc9be41b4"
    "00665300001800010000001a05000000": 5,
}  # fmt: skip
# as well, B062: the timing advance; the second lacks two bytes there of its stated length


@pytest.mark.parametrize(("code", "record", "read"), PUBLISHED)
def test_published_records_are_read_as_scat_and_rayhunter_read_them(code, record, read):
    said = [(o.channel, o.code, o.identity or o.level_dbm) for o in decode_hex(code, record)]
    assert said == read


def decode_hex(code, record, decoder=None):
    return decode(code, bytes.fromhex(record), decoder)


@pytest.mark.parametrize("code", sorted({code for code, _, _ in PUBLISHED}))
@pytest.mark.filterwarnings("ignore")
def test_published_records_are_what_scat_prints(code):
    assert_as_scat(
        [LogRecord(code, 0, T_NS, bytes.fromhex(text)) for one, text, _ in PUBLISHED if one == code]
    )


def test_a_published_serving_cell_of_b193():
    # sCAT prints its channel and code, and no level; what follows the first cell is left out
    record = (
        "0101ffff19240c024006000001000300a01100008f2200000acc030005e6811490ca1200b2a445005a04000000"
        "202300b2744a00fef8930449000000fef8e30e440a1500"
    )
    (one,) = decode(0xB193, bytes.fromhex(record).ljust(4 + 0x20C, b"\0"))
    assert (one.channel, one.code, one.role) == (1600, 416, "serving")
    assert one.level_dbm == -104.875


@pytest.mark.parametrize(("record", "ta_16ts"), AFTER_ACCESS.items())
def test_published_timing_advances(record, ta_16ts):
    decoder = Decoder()
    decode(0xB17F, diag.serving_cell(1300, 17, -80.0), decoder)
    decode_hex(0xB062, record, decoder)
    later = decode(0xB17F, diag.serving_cell(1300, 17, -80.0), decoder, T_NS + 2 * SECOND_NS)
    assert [one.ta_16ts for one in later if one.ta_16ts is not None] == [ta_16ts]


def test_published_levels_that_follow_the_serving_cell_of_gsm():
    decoder = Decoder()
    decode_hex(0x5134, "25800303177662f220014100ff", decoder)
    burst = (
        "03c30407002580985c3f0036fb2b0048fe040000008e6e00c4040700258066a8390031fbfe00e2fd0200000"
    )
    assert cells_of(decode_hex(0x507A, "34fb00", decoder)) == [(37, 27, "serving", -76.75)]
    assert cells_of(decode_hex(0x506C, f"{burst}0af4f".ljust(186, "0"), decoder)) == [
        (37, 27, "serving", -76.625),
        (37, 27, "serving", -76.9375),
    ]
    (one,) = decode_hex(0x512F, "811b1749061b761762f2200141c8010a156544b800004e072b2b", decoder)
    assert (one.channel, one.identity) == (37, Identity("262", "02", 0x141, 0x7617))


def test_where_we_know_better_than_scat():
    # it prints the level of a GSM neighbour without a code as 0, and any channel
    neighbours = "020480" + "20f90000000000000000" + "0a80" + "20f90000000000000000"
    assert [one.level_dbm for one in decode_hex(0x5071, neighbours)] == [-110.0] * 2
    decoder = Decoder()
    far = "05010000f424000a4d43434d4e434d41524b45527c307c3236327c317c34323330333233347c7c4d"
    assert decode_hex(0xB17F, far, decoder) == []
    assert decoder.refused == {0xB17F: 1}
    narrow = decode_hex(0xB0C1, "110b00fa090000b9030e000202000202d002", decoder)
    assert (narrow, decoder.unknown) == ([], {(0xB0C1, 17): 1})


def test_nothing_on_the_pi_needs_a_library_for_messages():
    files = [*Path("logger").rglob("*.py")]
    assert files
    assert not [path for path in files if "pycrate" in path.read_text()]


def test_each_code_that_is_allowed_is_read():
    """Codes of messages between modem and network are not among them."""
    assert Counter(code >> 12 for code in ALLOWED_CODES) == {0xB: 9, 5: 12, 4: 2}
    assert not ALLOWED_CODES & {0xB0C0, 0xB0EC, 0xB0ED, 0x412F, 0x11EB}
