from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.core.types import Fix
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer, radius68_m
from tests.kit.nmea_sentences import BOTH, NOON_NS, fixes, gga, gsa, gst, nmea, rmc
from tests.kit.scaling import check_growth

GGA = nmea("GPGGA,120000.00,5230.0000,N,01315.0000,E,1,08,1.1,45.5,M,40.0,M,,")

RMC = nmea("GPRMC,120000.00,A,5230.0000,N,01315.0000,E,2.0,84.4,230394,,,A,V")

TXT = nmea("GPTXT,01,01,02,hello")


@pytest.mark.parametrize("ratio", [1.0, 0.7, 0.5, 0.1])
def test_radius_holds_68_percent_of_normal_errors(ratio):
    errors_m = np.random.default_rng(3).normal(0.0, (1.0, ratio), (200_000, 2))
    inside = np.mean(np.hypot(*errors_m.T) <= radius68_m(1.0, ratio))
    assert 0.678 < inside < 0.72
    assert ratio < 1.0 or inside == pytest.approx(0.68, abs=0.003)


def test_gst_of_another_epoch_has_no_effect():
    found = fixes(gga(), rmc(), gst(), gga("120001.00"), rmc("120001.00"), gst("120000.00"))
    assert [fix.acc_m is None for _, fix in found] == [False, True]


def test_accuracy_of_no_position_is_unknown():
    assert fixes(gga(quality="0"), rmc(status="V"), gst()) == [
        (0, Fix(False, NOON_NS, hdop=1.1, sats_used=8, quality=0))
    ]


@pytest.mark.parametrize(
    ("modes", "alt_m"),
    [("3", 45.5), ("2", None), ("", 45.5), ("x", 45.5), ("1", 45.5), ("13", 45.5), ("12", None)],
)
def test_height_of_a_fix_in_two_dimensions_is_not_measured(modes, alt_m):
    [(_, fix)] = fixes(gga(), rmc(), *(gsa(mode, str(i)) for i, mode in enumerate(modes or [""])))
    assert (fix.valid, fix.alt_m) == (True, alt_m)


def test_gsa_has_the_hdop_where_no_gga_has():
    assert [fix.hdop for _, fix in fixes(rmc(), gsa("3"))] == [0.9]
    assert [fix.hdop for _, fix in fixes(rmc(), gga(), gsa("3"))] == [1.1]


def gns(modes, time="120000.00"):
    return nmea(f"GNGNS,{time},5230.0000,N,01315.0000,E,{modes},08,1.1,45.5,40.0,,")


@pytest.mark.parametrize(
    ("modes", "quality"),
    [
        ("AAN", 1),
        ("NNN", 0),
        ("DA", 2),
        ("ANR", 4),
        ("F", 5),
        ("P", 3),
        ("E", 6),
        ("M", 7),
        ("S", 8),
        ("", 0),
        ("?", 0),
    ],
)
def test_gns_stands_in_for_gga(modes, quality):
    [(_, fix)] = fixes(gns(modes), rmc())
    assert (fix.quality, fix.valid) == (quality, 1 <= quality <= 6)
    if fix.valid:
        assert replace(fix, quality=1) == BOTH


def test_vtg_has_the_motion_where_no_rmc_has():
    vtg = nmea("GPVTG,84.4,T,,M,2.0,N,3.7,K,A")
    zda = nmea("GPZDA,120000.00,21,09,2024,00,00")
    assert fixes(gga(), vtg, zda) == [(0, BOTH)]
    assert fixes(gga(), rmc(motion=","), vtg) == [(0, BOTH)]
    [(_, fix)] = fixes(gga(), nmea("GPVTG,84.4,2.0,3.7,"))
    assert (fix.speed_mps, fix.course_deg) == (None, None)


@pytest.mark.parametrize(
    "date", ["21,09,1999", "21,09,9999", ",,", "31,02,2024", "21,09", "0,0,0", "aa,09,2024"]
)
def test_zda_that_is_no_date(date):
    body = f"GPZDA,120000.00,{date},00,00"
    assert [fix.utc_ns for _, fix in fixes(gga(), nmea(body))] == [None]


def test_zda_with_a_time_of_its_own_splits_no_epoch():
    zda = nmea("GPZDA,120007.00,21,09,2024,00,00")
    assert fixes(rmc(), zda, gga()) == [(0, BOTH)]


def test_date_and_time_of_two_days_are_not_joined():
    last, first = rmc("235959.90", date="200924"), gga("000000.00")
    assert [fix.utc_ns for _, fix in fixes(last, first)] == [
        NOON_NS - 12 * 3600 * 10**9 - 10**8,
        None,
    ]


def test_date_without_a_time_is_no_time():
    assert [fix.utc_ns for _, fix in fixes(gga(), rmc(""))] == [None]


@pytest.mark.parametrize("sentence", [gga, rmc])
def test_receiver_with_one_sentence(sentence):
    found = fixes(sentence("120000.00"), sentence("120001.00"), sentence("120002.00"))
    assert [t for t, _ in found] == [0, 1, 2]
    assert all(fix.valid and fix.lat_deg == 52.5 for _, fix in found)


@pytest.mark.parametrize(
    ("mode", "quality", "valid"),
    [("E", 6, True), ("M", 7, False), ("S", 8, False), ("A", None, True)],
)
def test_an_rmc_alone_states_that_its_position_is_not_measured(mode, quality, valid):
    [(_, fix)] = fixes(rmc(mode=mode))
    assert (fix.quality, fix.valid) == (quality, valid)


@pytest.mark.parametrize("mode", ["E", "M", "S"])
def test_an_rmc_that_is_not_measured_outweighs_the_gga(mode):
    [(_, fix)] = fixes(gga(quality="1"), rmc(mode=mode))
    assert fix.quality == {"E": 6, "M": 7, "S": 8}[mode]


def test_lost_sentence_does_not_join_two_epochs():
    found = fixes(gga("120000.00"), rmc("120001.00"), gga("120001.00"), rmc("120002.00"))
    assert [(t, fix.quality) for t, fix in found] == [(0, 1), (1, 1), (3, None)]
    assert [fix.utc_ns is not None for _, fix in found] == [False, True, True]


def test_midnight_equals_midnight():
    assert len(fixes(gga("000000"), rmc("000000.000"))) == 1


def test_empty_epochs_are_no_fixes_one_by_one():
    empty = ["$GPGGA,,,,,,0,,,,M,,M,,*66", "$GPRMC,,V,,,,,,,,,,N*53"] * 3
    assert fixes(*empty, flush=False) == [(t, Fix(valid=False, quality=0)) for t in (0, 2, 4)]


@pytest.mark.parametrize(
    ("first", "second", "valid"),
    [(gga(quality=str(q)), rmc(), 1 <= q <= 6) for q in range(10)]
    + [
        (gga(quality=""), rmc(), False),
        (gga(quality="x"), rmc(), False),
        (gga(), rmc(status="V"), False),
    ]
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


@pytest.mark.parametrize(
    "date", ["", "060180", "220899", "311219", "000000", "310224", "abc", "2109240"]
)
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


TEXTS = st.text(
    st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$*"), max_size=8
)


@given(st.lists(TEXTS, max_size=15))
def test_any_fields_make_a_fix_or_none(fields):
    for kind in ("GPGGA", "GNRMC", "GNGNS"):
        for other in ("GNGST", "GNGSA", "GPVTG", "GPZDA"):
            for _, fix in fixes(nmea(",".join([kind, *fields])), nmea(",".join([other, *fields]))):
                assert fix.valid is (fix.lat_deg is not None)


def test_time_grows_with_the_bytes_and_no_faster():
    satellites = nmea("GPGSV,3,1,11,03,03,111,00,04,15,270,00,06,01,010,00,13,06,292,00")

    def read(epochs: int) -> None:
        data = "\r\n".join([GGA, RMC, TXT, satellites, ""] * epochs)
        framer, assembler = NmeaFramer(), FixAssembler()
        for i in range(0, len(data), 64):
            for event in framer.feed(data[i : i + 64].encode()):
                assembler.feed(event, i)

    check_growth(read, 50, 400)


def gll(second, status="A", tail=",A"):
    return nmea(f"GPGLL,5230.0000,N,01315.0000,E,1200{second:02d}.00,{status}{tail}")


def zda(second):
    return nmea(f"GPZDA,1200{second:02d}.00,21,09,2024,,")


LONE = Fix(valid=True, lat_deg=52.5, lon_deg=13.25)


def test_a_receiver_that_sends_only_gll_has_fixes_without_a_date():
    """As those of a GGA alone: the time of the run is the Pi's."""
    found = fixes(*(gll(second) for second in range(9)))
    assert found == [(t_ns, LONE) for t_ns in range(4, 9)]
    dated = fixes(*(text for i in range(9) for text in (gll(i), zda(i))))
    assert [fix.utc_ns for _, fix in dated] == [NOON_NS + i * 10**9 for i in range(4, 9)]


@pytest.mark.parametrize(("status", "tail"), [("V", ",N"), ("V", ""), ("A", ",N"), ("A", ",S")])
def test_a_gll_that_was_not_measured_is_no_position(status, tail):
    valid = {fix.valid for _, fix in fixes(*(gll(i, status, tail) for i in range(9)))}
    assert valid == {False}


def test_a_gll_of_dead_reckoning_is_one():
    assert {fix.quality for _, fix in fixes(*(gll(i, tail=",E") for i in range(9)))} == {6}


def test_gll_counts_for_nothing_beside_another_sentence():
    texts = [text for i in range(9) for text in (gll(i), rmc(f"1200{i:02d}.00"))]
    assert fixes(*texts) == fixes(*(text if "RMC" in text else "" for text in texts))
    assert fixes(gll(0), gga(), rmc(), gll(0)) == [(1, BOTH)]


def test_other_sentences_that_come_late_replace_gll():
    both = [text for i in range(9, 12) for text in (gga(f"1200{i:02d}.00"), gll(i))]
    found = fixes(*(gll(i) for i in range(9)), *both)
    assert [(t_ns, fix.hdop) for t_ns, fix in found[3:]] == [
        (7, None), (8, None), (9, 1.1), (11, 1.1), (13, 1.1),
    ]  # fmt: skip
