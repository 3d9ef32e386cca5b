import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.core.types import Fix
from logger.drivers.protocols.gpsd import (
    MAX_LINE,
    Device,
    Devices,
    Error,
    GpsdFixes,
    GpsdFramer,
    Gst,
    Sky,
    Tpv,
    Version,
    watch,
)
from logger.drivers.protocols.line_noise import Garbage
from tests.kit.framers import check_framer, feed_all, split_at
from tests.kit.scaling import check_growth

NOON = "2024-09-21T12:00:00.000Z"
NOON_NS = 1_726_920_000 * 10**9


def line(name, **fields):
    return json.dumps({"class": name, **fields}).encode() + b"\r\n"


TPV = line(
    "TPV",
    device="/dev/a",
    mode=3,
    time=NOON,
    lat=52.5,
    lon=13.25,
    altMSL=45.5,
    alt=1.0,
    eph=17.1,
    speed=1.0,
)
SKY = line("SKY", device="/dev/a", hdop=0.9, uSat=9, satellites=[{"PRN": 1, "used": True}])
GST = line("GST", device="/dev/a", time=NOON, lat=3.0, lon=4.0)


def fixes(*lines, step_ns=0):
    assembler = GpsdFixes()
    found = []
    for i, text in enumerate(lines):
        for report in GpsdFramer().feed(text):
            found += assembler.feed(report, i * step_ns)
    return found + list(assembler.flush())


def test_reports_by_class():
    data = (
        line("VERSION", release="3.22", rev="3.22", proto_major=3, proto_minor=14)
        + line("DEVICES", devices=[{"class": "DEVICE", "path": "/dev/a", "activated": NOON}])
        + line("WATCH", enable=True, json=True)
        + line("DEVICE", path="/dev/a", driver="u-blox", activated=0)
        + line("TPV", mode=1)
        + SKY
        + GST
        + line("ERROR", message="Unrecognized request")
        + line("PPS", device="/dev/a")
    )
    expected = [
        Version("3.22", 3, 14),
        Devices((Device("/dev/a", activated=NOON),)),
        Device("/dev/a", "u-blox"),
        Tpv(1),
        Sky("/dev/a", 0.9, 9),
        Gst("/dev/a", NOON, 3.0, 4.0),
        Error("Unrecognized request"),
    ]
    check_framer(GpsdFramer, data, expected, trailing=TPV[:50])


@pytest.mark.parametrize(
    "bad",
    [
        b"hello",
        b"{}",
        b"[]",
        b'"TPV"',
        b'{"class":5}',
        b'{"class":"TPV"}',
        b'{"class":"TPV","mode":"3"}',
        b'{"class":"TPV","mode":3,"lat":91.0}',
        b'{"class":"TPV","mode":3,"lon":1e999}',
        b'{"class":"TPV","mode":3,"lat":NaN}',
        b'{"class":"TPV","device":"\xff","mode":3}',
        b'{"class":"TPV","a":' + b"[" * 5000,
        TPV[:80],
        b"\x00\xb5b\x01",
    ],
)
def test_what_is_no_report_is_garbage(bad):
    check_framer(
        GpsdFramer, bad + b"\r\n" + SKY, [Garbage(bad), Sky("/dev/a", 0.9, 9)], trailing=b'{"class'
    )


def test_endless_line_is_garbage_and_memory_is_bounded():
    framer, data = GpsdFramer(), b"x" * 1000
    events = []
    for _ in range(100):
        events += framer.feed(data)
        assert len(framer._tail) <= MAX_LINE
    assert sum(len(event.data) for event in events) + len(framer._tail) == 100_000


@given(
    st.lists(
        st.sampled_from([TPV, SKY, GST, b"\n", b"{", b"\r\n", b'"class"']) | st.binary(max_size=4),
        max_size=12,
    )
)
def test_any_bytes_in_any_chunks(pieces):
    data = b"".join(pieces)
    whole = feed_all(GpsdFramer(), [data])
    assert feed_all(GpsdFramer(), split_at(data, [3] * (len(data) // 3))) == whole
    assembler = GpsdFixes()
    for event in whole:
        if not isinstance(event, Garbage):
            list(assembler.feed(event, 0))


@given(st.integers(0, len(TPV) - 1), st.integers(0, 255))
def test_damaged_report_raises_nothing(at, value):
    data = bytearray(TPV)
    data[at] = value
    for _, fix in fixes(bytes(data), SKY):
        assert fix.valid is (fix.lat_deg is not None)


def test_what_is_asked():
    assert watch() == b'?VERSION;\n?WATCH={"enable":true,"json":true};\n'
    assert watch("/dev/a") == b'?VERSION;\n?WATCH={"enable":true,"json":true,"device":"/dev/a"};\n'


# --- fixes

WHOLE = Fix(True, NOON_NS, 52.5, 13.25, alt_m=45.5, hdop=0.9, sats_used=9, speed_mps=1.0)


def tpv(**changes):
    return line(
        "TPV",
        **{k: v for k, v in (json.loads(TPV) | changes).items() if k != "class" and v is not None},
    )


@pytest.mark.parametrize("lines", [(SKY, TPV), (TPV, SKY), (tpv(mode=2), TPV, TPV, SKY)])
def test_reports_of_one_epoch_are_one_fix_in_any_order(lines):
    assert fixes(*lines) == [(0, WHOLE)]


def test_next_epoch_ends_the_one_before_and_a_late_report_makes_no_second_fix():
    assembler = GpsdFixes()
    later = tpv(time="2024-09-21T12:00:00.100Z")
    first, again, second = (next(GpsdFramer().feed(text)) for text in (TPV, TPV, later))
    assert not list(assembler.feed(first, 5))
    assert [t for t, _ in assembler.feed(second, 6)] == [5]
    assert [(t, fix.utc_ns) for t, fix in assembler.flush()] == [(6, NOON_NS + 10**8)]
    assert not list(assembler.feed(second, 7))
    assert not list(assembler.flush())
    assert [*assembler.feed(again, 8), *assembler.flush()][0][0] == 8


def test_no_fix_is_reported_once_a_second():
    found = fixes(*[line("TPV", device="/dev/a", mode=1)] * 30, step_ns=333_333_333)
    assert found == [(i * 3 * 333_333_333, Fix(False)) for i in range(10)]


@pytest.mark.parametrize(
    ("changes", "valid", "alt_m"),
    [
        ({"mode": 2}, True, None),
        ({"altMSL": None}, True, 1.0),
        ({"mode": 1}, False, None),
        ({"mode": 0}, False, None),
        ({"lat": None}, False, None),
        ({"status": 1}, True, 45.5),
        ({"status": 7}, False, None),
        ({"status": 8}, False, None),
    ],
)
def test_validity(changes, valid, alt_m):
    [(_, fix)] = fixes(tpv(**changes))
    assert (fix.valid, fix.lat_deg is not None, fix.alt_m) == (valid, valid, alt_m)


@pytest.mark.parametrize(
    ("status", "quality"),
    [(1, 1), (2, 2), (3, 4), (4, 5), (5, 6), (6, 1), (9, 3), (0, None), (77, None)],
)
def test_status_becomes_gga_quality(status, quality):
    assert [fix.quality for _, fix in fixes(tpv(status=status))] == [quality]


@pytest.mark.parametrize(
    ("text", "utc_ns"),
    [
        (NOON, NOON_NS),
        ("2024-09-21T12:00:00Z", NOON_NS),
        ("2024-09-21T12:00:00.25Z", NOON_NS + 25 * 10**7),
        ("2016-12-31T23:59:60.000Z", None),
        ("1999-08-22T00:00:00.000Z", None),
        ("2500-01-01T00:00:00.000Z", None),
        ("9999-12-31T23:59:59.999Z", None),
        ("2024-09-21T12:00:00", None),
        ("noon", None),
    ],
)
def test_utc(text, utc_ns):
    assert [(fix.valid, fix.utc_ns) for _, fix in fixes(tpv(time=text))] == [(True, utc_ns)]
    assert [fix.utc_ns for _, fix in fixes(tpv(time=text, mode=1))] == [None]


def test_accuracy_is_the_receivers_own_or_unknown():
    def accuracy(*lines):
        [(_, fix)] = fixes(*lines)
        return fix.acc_m

    ublox = line("DEVICES", devices=[{"path": "/dev/a", "driver": "u-blox", "activated": NOON}])
    nmea = line("DEVICE", path="/dev/a", driver="NMEA0183", activated=NOON)
    assert accuracy(TPV) is None
    assert accuracy(nmea, TPV) is None
    assert accuracy(ublox, TPV) == 17.1
    assert accuracy(ublox, TPV, GST) == accuracy(nmea, TPV, GST) == pytest.approx(5.337214)
    assert accuracy(GST, TPV) == pytest.approx(5.337214)
    assert (
        accuracy(
            TPV, line("GST", device="/dev/a", time="2024-09-21T11:59:59.000Z", lat=3.0, lon=4.0)
        )
        is None
    )
    assert accuracy(TPV, line("GST", device="/dev/b", time=NOON, lat=3.0, lon=4.0)) is None


def test_satellites_of_another_receiver_or_of_before_the_loss_are_not_reported():
    [(_, fix)] = fixes(TPV, line("SKY", device="/dev/b", hdop=0.9, uSat=9))
    assert (fix.hdop, fix.sats_used) == (None, None)
    found = fixes(SKY, line("TPV", device="/dev/a", mode=1), TPV)
    assert [fix.hdop for _, fix in found] == [0.9, None]


def test_dops_and_satellites_in_two_reports():
    first, second = line("SKY", device="/dev/a", hdop=0.9), line("SKY", device="/dev/a", uSat=9)
    assert fixes(first, second, TPV) == [(0, WHOLE)]


def test_time_grows_with_the_bytes_and_no_faster():
    def read(epochs: int) -> None:
        data = (TPV + SKY + GST) * epochs
        framer, assembler = GpsdFramer(), GpsdFixes()
        for i in range(0, len(data), 512):
            for report in framer.feed(data[i : i + 512]):
                list(assembler.feed(report, i))

    check_growth(read, 100, 800)
