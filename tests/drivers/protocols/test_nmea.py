import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.core.types import Fix
from logger.drivers.protocols.line_noise import Garbage
from logger.drivers.protocols.nmea import MAX_SENTENCE, FixAssembler, NmeaFramer, Sentence
from tests.kit.framers import check_framer, feed_all, split_at
from tests.kit.nmea_sentences import BOTH, fixes, gga, gsa, gst, nmea, rmc

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
    check(
        GGA.encode() + b"\r\n" + noise + b"\r\n" + RMC.encode(),
        [Sentence(GGA), Garbage(noise), Sentence(RMC)],
    )


@pytest.mark.parametrize("keep", range(1, len(GGA)))
def test_interrupted_sentence_does_not_take_the_next_one_with_it(keep):
    check(
        GGA[:keep].encode() + RMC.encode() + b"\r\n", [Garbage(GGA[:keep].encode()), Sentence(RMC)]
    )


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


@pytest.mark.parametrize(
    "body", ["PUBX", "PASHR", "PASHR,", "GPGGA", "GPGGA,", "CCGPQ,GGA", "GPRMC,,,", "PGRME"]
)
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
    [
        GGA.encode(),
        RMC.encode(),
        TXT.encode(),
        b"$GPG",
        b"\r\n",
        b"\r",
        b"$",
        b"*",
        b"*4",
        b"x" * 700,
        b"\xb5b",
    ]
)

STREAMS = st.lists(PIECES | st.binary(max_size=4), max_size=12).map(b"".join)


@given(STREAMS, st.lists(st.integers(0, 80), max_size=12))
def test_chunks_make_no_difference(data, sizes):
    assert feed_all(NmeaFramer(), split_at(data, sizes)) == feed_all(NmeaFramer(), [data])


@given(
    st.lists(
        st.tuples(
            st.binary(max_size=30).filter(lambda b: b"$" not in b), st.sampled_from([GGA, RMC, TXT])
        )
    )
)
def test_noise_between_sentences_loses_none(parts):
    data = b"".join(noise + text.encode() for noise, text in parts)
    assert [e.text for e in NmeaFramer().feed(data) if isinstance(e, Sentence)] == [
        text for _, text in parts
    ]


# --- fixes


def test_gga_and_rmc_of_one_epoch_are_one_fix_in_either_order():
    assert fixes(TXT, gga(), TXT, rmc()) == [(1, BOTH)]
    assert fixes(TXT, rmc(), TXT, gga()) == [(1, BOTH)]
    assert fixes(gga("120000"), rmc()) == [(0, BOTH)]


def when_reported(*texts):
    """For each sentence, how many fixes it completed."""
    assembler = FixAssembler()
    return [
        len(list(assembler.feed(s, 0))) for text in texts for s in NmeaFramer().feed(text.encode())
    ]


TIMES = [f"1200{i // 5:02d}.{i % 5 * 2}0" for i in range(20)]

UBLOX = [rmc, gga, lambda _: gsa(3), lambda _: gsa(3, "2"), gst]

MTK = [gga, lambda _: gsa(3), rmc]

GST_FIRST = [gst, gga, rmc]

ALONE = [gga]


@pytest.mark.parametrize("order", [UBLOX, MTK, GST_FIRST, ALONE])
def test_an_epoch_is_reported_with_its_last_sentence_once_the_order_is_known(order):
    texts = [make(t) for t in TIMES for make in order]
    reported = when_reported(*texts)
    n = len(order)
    assert sum(reported[: 2 * n]) == 2
    assert reported[2 * n :] == [*[0] * (n - 1), 1] * (len(TIMES) - 2)
    assert {fix.acc_m is not None for _, fix in fixes(*texts)} == {gst in order}


@pytest.mark.parametrize("order", [UBLOX, MTK, GST_FIRST])
@pytest.mark.parametrize("lost", range(5))
def test_a_lost_sentence_costs_its_own_values_and_no_fix(order, lost):
    texts = [make(t) for t in TIMES for make in order]
    del texts[9 * len(order) + lost % len(order)]
    found = fixes(*texts)
    assert len(found) == len(TIMES)
    assert all(fix.valid for _, fix in found)
    assert len({fix.utc_ns for _, fix in found} - {None}) >= len(TIMES) - 1


def test_a_sentence_that_comes_after_the_silence_makes_no_second_fix():
    assembler = FixAssembler()
    sentences = [
        s for text in (rmc(), gga(), rmc("120001.00")) for s in NmeaFramer().feed(text.encode())
    ]
    assert not list(assembler.feed(sentences[0], 0))
    assert len(list(assembler.flush())) == 1
    assert not list(assembler.feed(sentences[1], 1))
    assert not list(assembler.flush())
    assert [list(assembler.feed(sentences[2], 2)), len(list(assembler.flush()))] == [[], 1]


def test_two_talkers_of_one_receiver_are_one_epoch():
    first, second = gga(), gga().replace("GPGGA", "GNGGA")
    second = nmea(second[1:-3])
    assert len(fixes(first, second, rmc())) == 1


@pytest.mark.parametrize(("lat", "is_valid"), [("0000.0000", False), ("0000.0100", True)])
def test_zero_degrees_both_ways_are_no_position(lat, is_valid):
    """With these some receivers start, though they call them valid."""
    text = nmea(f"GPGGA,120000.00,{lat},N,00000.0000,E,1,08,0.9,50.0,M,47.0,M,,")
    [(_, fix)] = fixes(text)
    assert fix.valid is is_valid


def test_standing_clock_hides_no_epoch():
    assert len(fixes(*[gga("000000", quality="0"), rmc("000000", status="V")] * 5)) == 5


@pytest.mark.parametrize(
    ("lat_m", "lon_m", "acc_m"),
    [
        ("2.0", "2.0", 3.019184),
        ("3.0", "4.0", 5.337214),
        ("0.0", "0.0", None),
        ("", "2.0", None),
        ("x", "2", None),
    ],
)
def test_gst_gives_the_radius_of_68_percent(lat_m, lon_m, acc_m):
    [(_, fix)] = fixes(gga(), rmc(), gst(lat_m=lat_m, lon_m=lon_m))
    assert fix.acc_m == (acc_m if acc_m is None else pytest.approx(acc_m, rel=1e-6))
