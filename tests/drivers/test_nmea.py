import time
from datetime import UTC, datetime
from functools import reduce
from operator import xor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.core.types import Fix
from logger.drivers.garbage import Garbage
from logger.drivers.nmea import MAX_SENTENCE, FixAssembler, NmeaFramer, Sentence
from tests.kit.framers import check_framer, cut, feed_all


def nmea(body):
    return f"${body}*{reduce(xor, body.encode()):02X}"


GGA = nmea("GPGGA,120000.00,5230.0000,N,01315.0000,E,1,08,1.1,45.5,M,40.0,M,,")
RMC = nmea("GPRMC,120000.00,A,5230.0000,N,01315.0000,E,2.0,84.4,230394,,,A,V")
TXT = nmea("GPTXT,01,01,02,hello")


def check(data, expected):
    check_framer(NmeaFramer, data, expected, trailing=b"$GPGGA,12")


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r", b"\r\r\n", b""])
def test_any_line_end_ends_a_sentence(end):
    check(GGA.encode() + end + RMC.encode() + end, [Sentence(GGA), Sentence(RMC)])


@pytest.mark.parametrize(
    "noise",
    [b"\x00\xff", b"abc", b"*00", b"$", b"$GPGGA,1200", b"\xb5b$\x01\x02", b"$GPGGA*", b"$GP*Z1"],
)
def test_sentence_is_found_behind_noise_and_before_it(noise):
    check(noise + GGA.encode() + b"\r\n", [Garbage(noise), Sentence(GGA)])
    check(GGA.encode() + b"\r\n" + noise + b"\r\n" + RMC.encode(), [Sentence(GGA), Garbage(noise), Sentence(RMC)])


@pytest.mark.parametrize("keep", range(1, len(GGA)))
def test_interrupted_sentence_does_not_take_the_next_one_with_it(keep):
    check(GGA[:keep].encode() + RMC.encode() + b"\r\n", [Garbage(GGA[:keep].encode()), Sentence(RMC)])


@pytest.mark.parametrize(
    "bad",
    [
        GGA[:-3],
        GGA[:-1],
        GGA[:-2] + "zz",
        GGA.replace("5230", "5231"),
        GGA.replace("$G", "$GG"),
        GGA.replace("08", "0\x01"),
        "!" + GGA[1:],
        "$*00",
        "$GP*17",
    ],
)
def test_damaged_sentence_is_garbage(bad):
    check(bad.encode() + b"\r\n" + RMC.encode(), [Garbage(bad.encode()), Sentence(RMC)])


def test_small_letters_in_the_checksum_and_unknown_types_are_sentences():
    odd = nmea("SNRSTAT,1,1,5,0")
    low = GGA[:-2] + GGA[-2:].lower()
    check(f"{low}\n{odd}\n".encode(), [Sentence(low), Sentence(odd)])
    assert [s.message for s in NmeaFramer().feed(odd.encode())] == [None]


@pytest.mark.parametrize("body", ["PUBX", "PASHR", "PASHR,", "GPGGA", "GPGGA,", "CCGPQ,GGA", "GPRMC,,,", "PGRME"])
def test_sentences_that_pynmea2_stumbles_over(body):
    events = list(NmeaFramer().feed(nmea(body).encode()))
    assert events == [Sentence(nmea(body))]
    assert fixes(nmea(body)) in ([], [(0, Fix(valid=False))])


def test_endless_sentence_is_garbage_and_memory_is_bounded():
    data = b"$GPTXT," + b"x" * 5000
    check(data + b"\r\n" + GGA.encode(), [Garbage(data), Sentence(GGA)])
    framer = NmeaFramer()
    for i in range(len(data)):
        framer.feed(data[i : i + 1])
        assert len(framer._tail) <= MAX_SENTENCE + 10


PIECES = st.sampled_from(
    [GGA.encode(), RMC.encode(), TXT.encode(), b"$GPG", b"\r\n", b"\r", b"$", b"*", b"*4", b"x" * 700, b"\xb5b"]
)
STREAMS = st.lists(PIECES | st.binary(max_size=4), max_size=12).map(b"".join)


@given(STREAMS, st.lists(st.integers(0, 80), max_size=12))
def test_chunks_make_no_difference(data, sizes):
    assert feed_all(NmeaFramer(), cut(data, sizes)) == feed_all(NmeaFramer(), [data])


@given(st.lists(st.tuples(st.binary(max_size=30).filter(lambda b: b"$" not in b), st.sampled_from([GGA, RMC, TXT]))))
def test_noise_between_sentences_loses_none(parts):
    data = b"".join(noise + text.encode() for noise, text in parts)
    assert [e.text for e in NmeaFramer().feed(data) if isinstance(e, Sentence)] == [text for _, text in parts]


# --- fixes


def fixes(*texts, flush=True):
    """Fixes of sentences stamped 0, 1, 2, ..."""
    assembler = FixAssembler()
    found = []
    for t_ns, text in enumerate(texts):
        for sentence in NmeaFramer().feed(text.encode()):
            found += assembler.feed(sentence, t_ns)
    return found + list(assembler.flush()) if flush else found


def gga(time="120000.00", place="5230.0000,N,01315.0000,E", quality="1", tail="08,1.1,45.5,M,40.0,M,,"):
    return nmea(f"GPGGA,{time},{place},{quality},{tail}")


def rmc(time="120000.00", status="A", place="5230.0000,N,01315.0000,E", date="210924", mode="A,V", motion="2.0,84.4"):
    return nmea(f"GPRMC,{time},{status},{place},{motion},{date},,,{mode}")


NOON_NS = int(datetime(2024, 9, 21, 12, tzinfo=UTC).timestamp()) * 10**9
BOTH = Fix(
    valid=True,
    utc_ns=NOON_NS,
    lat_deg=52.5,
    lon_deg=13.25,
    alt_m=45.5,
    hdop=1.1,
    sats_used=8,
    quality=1,
    speed_mps=2.0 * 1852 / 3600,
    course_deg=84.4,
)


def test_gga_and_rmc_of_one_epoch_are_one_fix_at_once_in_either_order():
    assert fixes(TXT, gga(), TXT, rmc(), flush=False) == [(1, BOTH)]
    assert fixes(TXT, rmc(), TXT, gga(), flush=False) == [(1, BOTH)]
    assert fixes(gga("120000"), rmc(), flush=False) == [(0, BOTH)]


@pytest.mark.parametrize("sentence", [gga, rmc])
def test_receiver_with_one_sentence_works_one_epoch_late(sentence):
    texts = [sentence("120000.00"), sentence("120001.00"), sentence("120002.00")]
    assert [t for t, _ in fixes(*texts, flush=False)] == [0, 1]
    found = fixes(*texts)
    assert [t for t, _ in found] == [0, 1, 2]
    assert all(fix.valid and fix.lat_deg == 52.5 for _, fix in found)


def test_lost_sentence_does_not_join_two_epochs():
    found = fixes(gga("120000.00"), rmc("120001.00"), gga("120001.00"), rmc("120002.00"))
    assert [(t, fix.quality) for t, fix in found] == [(0, 1), (1, 1), (3, None)]
    assert [fix.utc_ns is not None for _, fix in found] == [False, True, True]


def test_midnight_equals_midnight():
    assert len(fixes(gga("000000"), rmc("000000.000"), flush=False)) == 1


def test_empty_epochs_are_no_fixes_one_by_one():
    empty = ["$GPGGA,,,,,,0,,,,M,,M,,*66", "$GPRMC,,V,,,,,,,,,,N*53"] * 3
    assert fixes(*empty, flush=False) == [(t, Fix(valid=False, quality=0)) for t in (0, 2, 4)]


@pytest.mark.parametrize(
    ("first", "second", "valid"),
    [(gga(quality=str(q)), rmc(), 1 <= q <= 6) for q in range(10)]
    + [(gga(quality=""), rmc(), False), (gga(quality="x"), rmc(), False), (gga(), rmc(status="V"), False)]
    + [(gga(), rmc(mode=mode + ",V"), True) for mode in "ADEFPR"]
    + [(gga(), rmc(mode=mode), False) for mode in ("N,V", "M", "S")]
    + [(gga(), rmc(mode=""), True)],
)
def test_validity(first, second, valid):
    [(_, fix)] = fixes(first, second)
    assert fix.valid is valid
    assert (fix.lat_deg, fix.lon_deg) == ((52.5, 13.25) if valid else (None, None))


@pytest.mark.parametrize(
    "place",
    [
        ",,,",
        "5230.0000,,01315.0000,",
        "5230.0000,N,01315.0000,",
        "5230.0000,N,,E",
        "5299.0,N,01315.0,E",
        "9900.0,N,01315.0,E",
        "5230.0,N,19900.0,E",
        "5230.0,E,01315.0,N",
        "5230.0,n,01315.0,E",
        "x,N,y,E",
        "-5230.0,N,01315.0,E",
        "52,N,13,E",
    ],
)
def test_impossible_position_is_no_fix(place):
    assert [fix.valid for _, fix in fixes(gga(place=place), rmc(place=place))] == [False]


@pytest.mark.parametrize(
    ("place", "lat_deg", "lon_deg"),
    [
        ("3352.128,S,15112.558,E", -33.8688, 151.2093),
        ("4739.71754,N,12219.58177,W", 47.661959, -122.326363),
        ("5000,N,00000.00,W", 50.0, 0.0),
        ("9000.00,S,18000.0,W", -90.0, -180.0),
    ],
)
def test_hemispheres(place, lat_deg, lon_deg):
    [(_, fix)] = fixes(gga(place=place))
    assert (fix.lat_deg, fix.lon_deg) == pytest.approx((lat_deg, lon_deg), abs=1e-6)


@pytest.mark.parametrize(
    ("time", "fraction_ns"),
    [
        ("120000", 0),
        ("120000.1", 10**8),
        ("120000.57", 57 * 10**7),
        ("120000.001", 10**6),
        ("120000.123456789", 123456789),
    ],
)
def test_utc_is_exact(time, fraction_ns):
    [(_, fix)] = fixes(gga(time), rmc(time))
    assert fix.utc_ns == NOON_NS + fraction_ns


@pytest.mark.parametrize("date", ["", "060180", "220899", "311219", "000000", "310224", "abc", "2109240"])
def test_date_of_a_receiver_that_has_lost_count_is_no_date(date):
    assert [(fix.valid, fix.utc_ns) for _, fix in fixes(gga(), rmc(date=date))] == [(True, None)]


def test_first_day_that_is_believed():
    assert [fix.utc_ns for _, fix in fixes(rmc("000000", date="010120"))] == [1_577_836_800 * 10**9]


@pytest.mark.parametrize("time", ["", "235960.00", "240000.00", "2000", "126000", "x"])
def test_time_that_is_no_time(time):
    assert [(fix.valid, fix.utc_ns) for _, fix in fixes(gga(time), rmc(time))] == [(True, None)]


def test_values_that_are_no_numbers_are_unknown():
    found = fixes(gga(tail="x,nan,inf,M,,M,,"), rmc(motion="abc,-4"))
    assert found == [(0, Fix(valid=True, utc_ns=NOON_NS, lat_deg=52.5, lon_deg=13.25, quality=1))]


TEXTS = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$*"), max_size=8)


@given(st.lists(TEXTS, max_size=15))
def test_any_fields_make_a_fix_or_none(fields):
    for kind in ("GPGGA", "GNRMC"):
        for _, fix in fixes(nmea(",".join([kind, *fields]))):
            assert fix.valid is (fix.lat_deg is not None)


def test_speed():
    satellites = nmea("GPGSV,3,1,11,03,03,111,00,04,15,270,00,06,01,010,00,13,06,292,00")
    data = "\r\n".join([GGA, RMC, TXT, satellites, ""] * 500)
    framer, assembler = NmeaFramer(), FixAssembler()
    start = time.process_time()
    for i in range(0, len(data), 64):
        for event in framer.feed(data[i : i + 64].encode()):
            assembler.feed(event, i)
    assert 2000 / (time.process_time() - start) > 10_000
