from datetime import UTC, datetime

import pytest

from logger.core.types import Fix
from logger.drivers import gnss
from logger.drivers.rows import as_json
from tests.kit.corpus import check_entry, entries, lines_of

CGNSINF = "+CGNSINF: 1,1,20150327014838.000,31.221783,121.354528,114.600,0.28,40.5,1,,1.9,2.2,1.0,,8,4,,,42,,"
CGPSINFO = "+CGPSINFO: 4429.967842,N,01124.141582,W,250325,160319.5,57.7,10.0,"
QGPSLOC = "+QGPSLOC: 142748.0,2259.0881S,04321.5515W,2.0,-83.0,2,0.00,36.0,19.4,140119,10"


def utc_ns(*when, ns=0):
    return int(datetime(*when, tzinfo=UTC).timestamp()) * 10**9 + ns


def test_cgnsinf():
    (fix,) = gnss.read_cgnsinf([CGNSINF])
    assert fix == Fix(
        valid=True,
        utc_ns=utc_ns(2015, 3, 27, 1, 48, 38),
        lat_deg=31.221783,
        lon_deg=121.354528,
        alt_m=114.6,
        hdop=1.9,
        sats_used=4,
        speed_mps=pytest.approx(0.28 / 3.6),
        course_deg=40.5,
    )


def test_cgpsinfo():
    (fix,) = gnss.read_cgpsinfo([CGPSINFO])
    assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(44.49946403), pytest.approx(-11.40235970))
    assert (fix.utc_ns, fix.alt_m) == (utc_ns(2025, 3, 25, 16, 3, 19, ns=500_000_000), 57.7)
    assert (fix.speed_mps, fix.course_deg, fix.hdop, fix.sats_used) == (pytest.approx(5.1444444), None, None, None)


def test_qgpsloc():
    (fix,) = gnss.read_qgpsloc([QGPSLOC])
    assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(-22.98480167), pytest.approx(-43.35919167))
    assert (fix.utc_ns, fix.alt_m, fix.hdop, fix.sats_used) == (utc_ns(2019, 1, 14, 14, 27, 48), -83.0, 2.0, 10)
    assert (fix.speed_mps, fix.course_deg) == (pytest.approx(10.0), None)


@pytest.mark.parametrize("place", ["-22.9848017,-43.3591917", "2259.0881,S,04321.5515,W", "2259.0881 S,04321.5515 W"])
def test_qgpsloc_in_its_other_formats(place):
    (fix,) = gnss.read_qgpsloc([QGPSLOC.replace("2259.0881S,04321.5515W", place)])
    assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(-22.9848017), pytest.approx(-43.3591917))
    assert (fix.hdop, fix.sats_used) == (2.0, 10)


@pytest.mark.parametrize(
    ("read", "line"),
    [
        (gnss.read_cgnsinf, "+CGNSINF: 0,,,,,,,,,,,,,,,,,,,,"),
        (gnss.read_cgnsinf, "+CGNSINF: 1,0,19800105235948.000,,,,0.00,0.0,0,,,,,,0,0,,,,,"),
        (gnss.read_cgpsinfo, "+CGPSINFO: ,,,,,,,,"),
        (gnss.read_cgpsinfo, "+CGPSINFO:,,,,,,,,"),
        (gnss.read_cgpsinfo, "+CGPSINFO: ,,,,060180,000012.0,,,"),
    ],
)
def test_no_fix_and_no_time(read, line):
    (fix,) = read([line])
    assert (fix.valid, fix.lat_deg, fix.lon_deg, fix.utc_ns, fix.speed_mps) == (False, None, None, None, None)


def test_no_fix_but_a_time():
    (fix,) = gnss.read_cgnsinf(["+CGNSINF: 1,0,20220723071332.000,,,,0.24,0.0,0,,,,,,8,0,,,42,,"])
    assert fix == Fix(valid=False, utc_ns=utc_ns(2022, 7, 23, 7, 13, 32), sats_used=0)


def test_second_field_decides_about_the_fix():
    (fix,) = gnss.read_cgnsinf([CGNSINF.replace(": 1,1,", ": 1,0,")])
    assert not fix.valid
    (fix,) = gnss.read_qgpsloc([QGPSLOC.replace(",2,0.00", ",0,0.00")])
    assert not fix.valid


def test_error_516_in_answer_to_the_question_is_no_fix():
    assert gnss.read_qgpsloc(["at+qgpsloc?", "+CME ERROR: 516"]) == (Fix(valid=False),)
    assert gnss.read_qgpsloc(["AT+QGPSLOC=2", "AT+QIOPEN=1", "+CME ERROR: 516"]) == ()
    assert gnss.read_qgpsloc(["AT+QGPSLOC=2", "+CME ERROR: 505"]) == ()


@pytest.mark.parametrize(
    ("whole", "other"),
    [
        ("2259.0881S", "2260.0881S"),
        ("2259.0881S", "9059.0881S"),
        ("2259.0881S", "2259.0881E"),
        ("2259.0881S", "2259.0881"),
        ("2259.0881S", "2259"),
        ("2259.0881S", ""),
        ("04321.5515W", "18021.5515W"),
        ("04321.5515W", "0432x.5515W"),
    ],
)
def test_impossible_place_is_none(whole, other):
    (fix,) = gnss.read_qgpsloc([QGPSLOC.replace(whole, other)])
    assert (fix.valid, fix.lat_deg, fix.lon_deg) == (False, None, None)
    assert fix.utc_ns == utc_ns(2019, 1, 14, 14, 27, 48)


@pytest.mark.parametrize(
    ("whole", "other"),
    [
        ("140119", "310219"),
        ("140119", "140199"),
        ("140119", "14011"),
        ("140119", ""),
        ("142748.0", "242748.0"),
        ("142748.0", "142760.0"),
        ("142748.0", "1427"),
    ],
)
def test_impossible_time_is_none(whole, other):
    (fix,) = gnss.read_qgpsloc([QGPSLOC.replace(whole, other)])
    assert (fix.valid, fix.utc_ns) == (True, None)


@pytest.mark.parametrize(
    "line",
    ["OK" + CGNSINF, "12:00:01 -> " + CGNSINF, CGNSINF + "\\r\\nOK", "AT+CGNSINF\r" + CGNSINF, CGNSINF + "\r"],
)
def test_writing_of_a_row(line):
    assert gnss.read_cgnsinf([line]) == gnss.read_cgnsinf([CGNSINF])


@pytest.mark.parametrize(
    ("read", "row"),
    [(gnss.read_cgnsinf, CGNSINF), (gnss.read_cgpsinfo, CGPSINFO), (gnss.read_qgpsloc, QGPSLOC)],
)
def test_cut_row_has_the_whole_place_and_time_or_none(read, row):
    (whole,) = read([row])
    for end in range(len(row)):
        for fix in read([row[:end]]):
            assert (fix.lat_deg, fix.lon_deg) in {(whole.lat_deg, whole.lon_deg), (None, None)}, row[:end]
            assert fix.utc_ns in {whole.utc_ns, None}, row[:end]


@pytest.mark.parametrize(
    ("dialect", "read"),
    [
        ("simcom_cgnsinf", gnss.read_cgnsinf),
        ("simcom_cgpsinfo", gnss.read_cgpsinfo),
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
        check_entry(wanted, [as_json(fix) for fix in gnss.read_qgpsloc(lines_of(corpus, entry))])
