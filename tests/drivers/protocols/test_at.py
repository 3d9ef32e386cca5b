import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.drivers.protocols.at import (
    INTERRUPTION,
    MAX_LINE,
    MAX_LINES,
    AtFramer,
    Reply,
    Unsolicited,
)
from logger.drivers.protocols.line_noise import Garbage
from tests.kit.at_framers import CENG_LINES, CENG_REPLY, check, framer_after, framer_after_expiry
from tests.kit.framers import feed_all, split_at
from tests.kit.nmea_sentences import gga
from tests.kit.scaling import check_growth


@pytest.mark.parametrize(
    "echo",
    [
        b"",
        b"AT+CENG?\r",
        b"AT+CENG?\r\n",
        b"AT+CENG?\r\r\n",
        b"at+ceng?\r\n",
        b"AT+CENG?\r\r\nAT+CENG?\r\r\n",
        b"AT+CENG? \n",
    ],
)
def test_echo_is_dropped_in_all_its_forms(echo):
    check(framer_after("AT+CENG?"), echo + CENG_REPLY, [Reply("AT+CENG?", CENG_LINES, "OK")])


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r", b"\r\r\n", b"\n\r"])
def test_any_line_end_ends_a_line(end):
    check(
        framer_after("AT+CSQ"),
        end.join([b"+CSQ: 20,0", b"OK", b""]),
        [Reply("AT+CSQ", ("+CSQ: 20,0",), "OK")],
    )


NETSCAN = b"MCC:310,MNC:260,Rxlev:53,Cellid:CF00,Arfcn:1275,Lac:3C4D"


@pytest.mark.parametrize("at", [3, 12, NETSCAN.index(b"275"), len(NETSCAN) - 1])
@pytest.mark.parametrize("lost", [0, 1])
def test_a_row_with_a_carriage_return_in_it_is_damaged(at, lost):
    """1275 is not channel 127, with the rest of the row on a line of its own."""
    row, damaged = NETSCAN, NETSCAN[:at] + b"\r" + NETSCAN[at + lost :] + b"x"
    data = b"\r\n".join([b"AT+CNETSCAN\r", row, damaged, row, b"", b"OK", b""])
    reply = Reply("AT+CNETSCAN", (row.decode(),) * 2, "OK")
    check(framer_after("AT+CNETSCAN"), data, [Garbage(damaged), reply])


@pytest.mark.parametrize("rest", [b"+CSQ: 20,0", b"OK"])
def test_a_line_feed_that_is_lost_takes_no_row(rest):
    data = b"\r\n+CSQ: 21,0\r" + rest + b"\r\nOK\r\n"
    (reply, *_) = feed_all(framer_after("AT+CSQ")(), [data])
    assert (reply.lines[0], reply.final) == ("+CSQ: 21,0", "OK")


def test_a_result_in_digits_ends_with_a_carriage_return_alone():
    """V.250 after ATV0, with echo; the reply is there before anything follows."""
    data = b"AT+CSQ\r+CSQ: 20,0\r\n0\r"
    check(framer_after("AT+CSQ"), data, [Reply("AT+CSQ", ("+CSQ: 20,0",), "OK")])


SENTENCE = gga().encode()


@pytest.mark.parametrize("end", [b"", b"\r\n", b"\n"])
@pytest.mark.parametrize("before", [b"+", b'+CENG: 0,"01', b"+CENG: 1,1", b'255"'])
@pytest.mark.parametrize("sentences", [1, 3])
def test_a_sentence_of_a_receiver_takes_nothing_of_the_row_it_interrupts(before, end, sentences):
    at = CENG_REPLY.index(before) + len(before)
    inserted = (SENTENCE + end) * sentences
    check(
        framer_after("AT+CENG?"),
        CENG_REPLY[:at] + inserted + CENG_REPLY[at:],
        [
            *[Unsolicited(SENTENCE.decode())] * sentences,
            Reply("AT+CENG?", CENG_LINES, "OK"),
        ],
    )


@pytest.mark.parametrize(
    ("inserted", "after"),
    [
        (SENTENCE.replace(b"N", b"S"), b""),
        (SENTENCE[:20], b"\r\n"),
        (SENTENCE, b"\r\n"),  # the end of the row is lost
    ],
    ids=["damaged", "cut", "at the end"],
)
def test_a_row_that_may_have_lost_its_end_to_a_sentence_is_cut(inserted, after):
    data = b"\r\n+CSQ: 20,9" + inserted + after
    (reply,) = [
        event
        for event in feed_all(
            framer_after("AT+CSQ")(), [data, b"\r\nOK\r\n" if not after else b"OK\r\n"]
        )
        if isinstance(event, Reply)
    ]
    assert reply.marked_lines == ("+CSQ: 20,9", INTERRUPTION)


def test_a_row_torn_by_sentences_without_end_stays_small():
    framer = framer_after("AT+CSQ")()
    events = feed_all(framer, [b"x" + SENTENCE + b"\r\n"] * 10_000)
    assert len(framer._torn) <= MAX_LINE + 1
    assert Garbage not in map(type, events[:100])


@pytest.mark.parametrize(
    "final",
    [
        "OK",
        "ERROR",
        "+CME ERROR: 100",
        "+CME ERROR: SIM not inserted",
        "+CMS ERROR: 310",
        "NO CARRIER",
        "BUSY",
        "NO ANSWER",
        "NO DIALTONE",
    ],
)
def test_final_codes_close_a_reply(final):
    check(framer_after("AT+CENG?"), f"\r\n{final}\r\n".encode(), [Reply("AT+CENG?", (), final)])


@pytest.mark.parametrize(
    ("digit", "final"), [("0", "OK"), ("1", "CONNECT"), ("3", "NO CARRIER"), ("4", "ERROR")]
)
def test_numeric_codes_close_a_reply_in_words(digit, final):
    check(framer_after("AT"), f"AT\r{digit}\r".encode(), [Reply("AT", (), final)])
    check(
        framer_after("AT+CSQ"),
        f"+CSQ: 9,0\r\n{digit}\r".encode(),
        [Reply("AT+CSQ", ("+CSQ: 9,0",), final)],
    )


def test_number_in_a_reply_with_words_is_a_line():
    check(framer_after("AT+X"), b"AT+X\r\r\n0\r\n\r\nOK\r\n", [Reply("AT+X", ("0",), "OK")])


def test_number_is_a_line_once_the_modem_has_answered_in_words():
    framer = framer_after("AT")()
    assert feed_all(framer, [b"OK\n"]) == [Reply("AT", (), "OK")]
    framer.send("AT+X")
    assert feed_all(framer, [b"4\nOK\n"]) == [Reply("AT+X", ("4",), "OK")]


@pytest.mark.parametrize(
    "line",
    [
        "RDY",
        "+CFUN: 1",
        "+CPIN: READY",
        "Call Ready",
        "SMS Ready",
        "UNDER-VOLTAGE WARNNING",
        "UNDER-VOLTAGE WARNING",
        "UNDER-VOLTAGE POWER DOWN",
        "NORMAL POWER DOWN",
        "*ATREADY: 1",
        "*PSUTTZ: 2024,1,2,3,4,5",
        "DST: 1",
        "RING",
        '+CREG: 1,"0113","4E72"',
        "+CIEV: 10,26201",
        "QCRDY",
        "PB DONE",
    ],
)
def test_unsolicited_line_inside_a_reply(line):
    data = CENG_REPLY.replace(
        b"\r\n\r\n+CENG: 0", b"\r\n\r\n" + line.encode() + b"\r\n\r\n+CENG: 0"
    )
    reply = Reply("AT+CENG?", CENG_LINES, "OK", interrupted=frozenset({0}))
    check(framer_after("AT+CENG?"), data, [Unsolicited(line), reply])
    assert reply.marked_lines == (CENG_LINES[0], INTERRUPTION, *CENG_LINES[1:])


def test_lines_of_every_part_of_a_joined_command_belong_to_it():
    lines = ("+CPIN: READY", "+CSQ: 28,99", '+COPS: 0,2,"22288",7')
    check(
        framer_after("AT+CPIN?;+CSQ;+COPS?"),
        "\n".join([*lines, "+CREG: 1", "OK", ""]).encode(),
        [
            Unsolicited("+CREG: 1"),
            Reply("AT+CPIN?;+CSQ;+COPS?", lines, "OK", interrupted=frozenset({2})),
        ],
    )


def test_lines_without_prefix_belong_to_the_reply():
    line = 'Operator:"T, Mobile",MCC:310,MNC:260,Rxlev:53,Cellid:CF00,Arfcn:1709'
    check(
        framer_after("AT+CNETSCAN"),
        f"\r\n{line}\r\n\r\nOK\r\n".encode(),
        [Reply("AT+CNETSCAN", (line,), "OK")],
    )


def test_lines_while_nothing_is_pending_are_unsolicited():
    check(
        AtFramer,
        b"\r\nRDY\r\n\r\nOK\r\nhello\r\n",
        [Unsolicited("RDY"), Unsolicited("OK"), Unsolicited("hello")],
    )


def test_sim900_prefix_without_blank():
    check(
        framer_after("AT+CENG?"),
        b'+CENG:0,"06"\r\nOK\r\n',
        [Reply("AT+CENG?", ('+CENG:0,"06"',), "OK")],
    )


@pytest.mark.parametrize(
    "noise", [b"\x00", b"\xff\xfe", b"O\x01K", b"+CENG: 0,\xb01", b'"\x1b"', b"\x7f"]
)
def test_bytes_that_are_no_text_are_garbage(noise):
    check(framer_after("AT"), noise + b"\r\nOK\r\n", [Garbage(noise), Reply("AT", (), "OK")])


def test_high_bytes_are_text_between_quotation_marks():
    line = '+COPS: 0,0,"Téléphone"'
    check(
        framer_after("AT+COPS?"),
        f"{line}\r\nOK\r\n".encode("latin-1"),
        [Reply("AT+COPS?", (line,), "OK")],
    )


@pytest.mark.parametrize("length", [MAX_LINE + 1, 2 * MAX_LINE, 3 * MAX_LINE + 7])
def test_overlong_line_is_garbage(length):
    check(
        framer_after("AT"),
        b"x" * length + b"\r\nOK\r\n",
        [Garbage(b"x" * length), Reply("AT", (), "OK")],
    )


def test_longest_line_is_a_line():
    check(
        framer_after("ATI"),
        b"x" * MAX_LINE + b"\r\nOK\r\n",
        [Reply("ATI", ("x" * MAX_LINE,), "OK")],
    )


def test_memory_is_bounded_without_line_ends_and_without_final_code():
    framer = framer_after("ATI")()
    for _ in range(100):
        list(framer.feed(b"x" * 1000))
        assert len(framer._buffer) <= MAX_LINE
    framer = framer_after("ATI")()
    events = list(framer.feed(b"abc\n" * (MAX_LINES + 5)))
    assert events == [Unsolicited("abc")] * 5
    assert framer.expire() == Reply("ATI", ("abc",) * MAX_LINES, None)


def test_expired_command_keeps_its_lines():
    framer = framer_after("AT+CENG?")()
    assert list(framer.feed(b"\r\n+CENG: 1,1\r\n\r\n+CENG: 0,")) == []
    assert framer.expire() == Reply("AT+CENG?", ("+CENG: 1,1",), None)


def test_bytes_are_consumed_even_if_nothing_reads_the_events():
    framer = framer_after("AT+CENG?")()
    framer.feed(CENG_REPLY[:30])
    assert list(framer.feed(CENG_REPLY[30:])) == [Reply("AT+CENG?", CENG_LINES, "OK")]


def test_flush_ends_the_last_line_of_a_transcript():
    framer = framer_after("AT+CENG?")()
    assert list(framer.feed(CENG_REPLY.rstrip())) == []
    assert list(framer.flush()) == [Reply("AT+CENG?", CENG_LINES, "OK")]
    assert list(framer.flush()) == []


PIECES = st.sampled_from(
    [
        b"\r\n",
        b"\r",
        b"\n",
        b"OK\r\n",
        b"ERROR\r\n",
        b"0\r",
        b"AT+CENG?\r\r\n",
        b"RDY\r\n",
        b'+CENG: 1,"',
        b"0154,28",
        b'"\r\n',
        b"+CREG: 1\r\n",
        b"\xff",
        b"\x00\r\n",
        b" ",
        b"x" * 3000,
        CENG_REPLY,
    ]
)

STREAMS = st.lists(PIECES | st.binary(max_size=5), max_size=12).map(b"".join)


@given(
    STREAMS,
    st.lists(st.integers(0, 60), max_size=12),
    st.sampled_from(["AT", "AT+CENG?", "AT+CENG=1,1"]),
)
def test_chunks_make_no_difference(data, sizes, command):
    make = framer_after_expiry("AT+CENG?", then=command)
    assert feed_all(make(), split_at(data, sizes)) == feed_all(make(), [data])


@given(STREAMS)
def test_a_reply_comes_at_most_once(data):
    framer = framer_after("AT+CENG?")()
    assert sum(isinstance(event, Reply) for event in feed_all(framer, [data])) <= 1


def test_time_grows_with_the_rows_and_no_faster():
    def read(count: int) -> None:
        rows = b'+CENG: 1,"0128,15,30,a53f,310,411,178d"\r\n' * count + b"OK\r\n"
        framer = framer_after("AT+CENG?")()
        for i in range(0, len(rows), 64):
            list(framer.feed(rows[i : i + 64]))

    check_growth(read, 120, 960)
