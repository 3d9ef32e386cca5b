from datetime import UTC, datetime

import pytest

from logger.core.types import Fix
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.row_language import as_json
from tests.kit.corpus import check_entry, entries, lines_of

# A place and a time of our own in the layouts of firmware_notes/simcom.md.
CGNSINF = (
    "+CGNSINF: 1,1,20260921141320.000,52.516275,13.377704,"
    "41.300,5.40,273.5,1,,0.9,1.3,1.0,,11,8,3,,38,,"
)
CGPSINFO = "+CGPSINFO: 5230.976500,N,00722.662240,W,210926,141320.5,41.3,10.0,"
QGPSLOC = "+QGPSLOC: 141320.0,3324.6600S,07031.3800W,1.1,560.0,2,0.00,36.0,19.4,210926,9"


def utc_ns(*when, ns=0):
    return int(datetime(*when, tzinfo=UTC).timestamp()) * 10**9 + ns


def test_cgnsinf():
    (fix,) = modem_gnss.read_cgnsinf([CGNSINF])
    assert fix == Fix(
        valid=True,
        utc_ns=utc_ns(2026, 9, 21, 14, 13, 20),
        lat_deg=52.516275,
        lon_deg=13.377704,
        alt_m=41.3,
        hdop=0.9,
        sats_used=8,
        speed_mps=pytest.approx(1.5),
        course_deg=273.5,
    )


def test_cgpsinfo():
    (fix,) = modem_gnss.read_cgpsinfo([CGPSINFO])
    assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(52.516275), pytest.approx(-7.377704))
    assert (fix.utc_ns, fix.alt_m) == (utc_ns(2026, 9, 21, 14, 13, 20, ns=500_000_000), 41.3)
    assert (fix.speed_mps, fix.course_deg, fix.hdop, fix.sats_used) == (
        pytest.approx(5.1444444),
        None,
        None,
        None,
    )


@pytest.mark.parametrize("name", ["+QGPSLOC:", "$GPSACP:"])
def test_qgpsloc(name):
    (fix,) = modem_gnss.read_qgpsloc([QGPSLOC.replace("+QGPSLOC:", name)])
    assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(-33.411), pytest.approx(-70.523))
    assert (fix.utc_ns, fix.alt_m, fix.hdop, fix.sats_used) == (
        utc_ns(2026, 9, 21, 14, 13, 20),
        560.0,
        1.1,
        9,
    )
    assert (fix.speed_mps, fix.course_deg) == (pytest.approx(10.0), None)


@pytest.mark.parametrize(
    "place", ["-33.4110000,-70.5230000", "3324.6600,S,07031.3800,W", "3324.6600 S,07031.3800 W"]
)
def test_qgpsloc_in_its_other_formats(place):
    (fix,) = modem_gnss.read_qgpsloc([QGPSLOC.replace("3324.6600S,07031.3800W", place)])
    assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(-33.411), pytest.approx(-70.523))
    assert (fix.hdop, fix.sats_used) == (1.1, 9)


@pytest.mark.parametrize(
    ("read", "line"),
    [
        (modem_gnss.read_cgnsinf, "+CGNSINF: 0,,,,,,,,,,,,,,,,,,,,"),
        (modem_gnss.read_cgnsinf, "+CGNSINF: 1,0,19800106000013.000,,,,0.00,0.0,0,,,,,,0,0,,,,,"),
        (modem_gnss.read_cgpsinfo, "+CGPSINFO: ,,,,,,,,"),
        (modem_gnss.read_cgpsinfo, "+CGPSINFO:,,,,,,,,"),
        (modem_gnss.read_cgpsinfo, "+CGPSINFO: ,,,,060180,000107.0,,,"),
    ],
)
def test_no_fix_and_no_time(read, line):
    (fix,) = read([line])
    assert (fix.valid, fix.lat_deg, fix.lon_deg, fix.utc_ns, fix.speed_mps) == (
        False,
        None,
        None,
        None,
        None,
    )


def test_no_fix_but_a_time():
    (fix,) = modem_gnss.read_cgnsinf(
        ["+CGNSINF: 1,0,20220723071332.000,,,,0.24,0.0,0,,,,,,8,0,,,42,,"]
    )
    assert fix == Fix(valid=False, utc_ns=utc_ns(2022, 7, 23, 7, 13, 32), sats_used=0)


def test_second_field_decides_about_the_fix():
    (fix,) = modem_gnss.read_cgnsinf([CGNSINF.replace(": 1,1,", ": 1,0,")])
    assert not fix.valid
    (fix,) = modem_gnss.read_qgpsloc([QGPSLOC.replace(",2,0.00", ",0,0.00")])
    assert not fix.valid


def test_error_516_in_answer_to_the_question_is_no_fix():
    assert modem_gnss.read_qgpsloc(["at+qgpsloc?", "+CME ERROR: 516"]) == (Fix(valid=False),)
    assert modem_gnss.read_qgpsloc(["AT+QGPSLOC=2", "AT+QIOPEN=1", "+CME ERROR: 516"]) == ()
    assert modem_gnss.read_qgpsloc(["AT+QGPSLOC=2", "+CME ERROR: 505"]) == ()


@pytest.mark.parametrize(
    ("whole", "other"),
    [
        ("3324.6600S", "3360.6600S"),
        ("3324.6600S", "9024.6600S"),
        ("3324.6600S", "3324.6600E"),
        ("3324.6600S", "3324.6600"),
        ("3324.6600S", "3324"),
        ("3324.6600S", ""),
        ("07031.3800W", "18031.3800W"),
        ("07031.3800W", "0703x.3800W"),
    ],
)
def test_impossible_place_is_none(whole, other):
    (fix,) = modem_gnss.read_qgpsloc([QGPSLOC.replace(whole, other)])
    assert (fix.valid, fix.lat_deg, fix.lon_deg) == (False, None, None)
    assert fix.utc_ns == utc_ns(2026, 9, 21, 14, 13, 20)


@pytest.mark.parametrize(
    ("whole", "other"),
    [
        ("210926", "310226"),
        ("210926", "210980"),
        ("210926", "21092"),
        ("210926", ""),
        ("141320.0", "241320.0"),
        ("141320.0", "141360.0"),
        ("141320.0", "1413"),
    ],
)
def test_impossible_time_is_none(whole, other):
    (fix,) = modem_gnss.read_qgpsloc([QGPSLOC.replace(whole, other)])
    assert (fix.valid, fix.utc_ns) == (True, None)


@pytest.mark.parametrize(
    "line",
    [
        "OK" + CGNSINF,
        "12:00:01 -> " + CGNSINF,
        CGNSINF + "\\r\\nOK",
        "AT+CGNSINF\r" + CGNSINF,
        CGNSINF + "\r",
    ],
)
def test_writing_of_a_row(line):
    assert modem_gnss.read_cgnsinf([line]) == modem_gnss.read_cgnsinf([CGNSINF])


@pytest.mark.parametrize(
    ("read", "row"),
    [
        (modem_gnss.read_cgnsinf, CGNSINF),
        (modem_gnss.read_cgpsinfo, CGPSINFO),
        (modem_gnss.read_qgpsloc, QGPSLOC),
    ],
)
def test_cut_row_has_the_complete_place_and_time_or_none(read, row):
    (whole,) = read([row])
    for end in range(len(row)):
        for fix in read([row[:end]]):
            assert (fix.lat_deg, fix.lon_deg) in {(whole.lat_deg, whole.lon_deg), (None, None)}, (
                row[:end]
            )
            assert fix.utc_ns in {whole.utc_ns, None}, row[:end]


@pytest.mark.parametrize(
    ("dialect", "read"),
    [
        ("simcom_cgnsinf", modem_gnss.read_cgnsinf),
        ("simcom_cgpsinfo", modem_gnss.read_cgpsinfo),
    ],
)
def test_recorded_replies(corpus, dialect, read):
    found = entries(corpus, dialect)
    assert found
    for entry in found:
        check_entry(entry, [as_json(fix) for fix in read(lines_of(corpus, entry))])


def test_recorded_replies_of_quectel(corpus):
    for entry in entries(corpus, "quectel_qgpsloc"):
        wanted = {**entry, "expected": [row for row in entry["expected"] if row["role"] == "gnss"]}
        check_entry(
            wanted, [as_json(fix) for fix in modem_gnss.read_qgpsloc(lines_of(corpus, entry))]
        )
