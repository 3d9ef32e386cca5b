"""Lists of channels and reselection values behind the cells of a Telit survey."""

import random

import pytest

from logger.core.types import Broadcast
from logger.drivers.protocols.at import AtFramer, Reply
from logger.drivers.reading.recognition import NumberHistory, mark_doubtful
from logger.drivers.telit import Telit
from logger.drivers.transcript import rows_of
from tests.kit.drivers import cells_of

MODEM = Telit()
CELL = (
    "arfcn: 48 bsic: 24 rxLev: -52 ber: 0.00 mcc: 262 mnc: 1 lac: 33281 cellId: 3648"
    " cellStatus: CELL_SUITABLE"
)
LISTS = " numArfcn: 2 arfcn: 30 48 numChannels: 5 array: 14 19 22 48 982"
RESELECTION = " mstxpwr: 5 rxaccmin: 8 croffset: 30 penaltyt: 31 t3212: 10 CRH: 4"
PACKET = (
    " pbcch: 1 nom: 2 rac: 8 spgc: 0 pat: 5 nco: 0 t3168: 10 t3192: 11 drxmax: 2 ctrlAck: 0"
    " bsCVmax: 15 alpha: 0 pcMeasCh: 0"
)
NUMBERS = "48,24,-52,0.00,262,01,33281,3648,0"
CHANNELS = (14, 19, 22, 48, 982)
FULL = Broadcast(CHANNELS, cro_db=60, penalty_time=31, t3212_raw=10)


def broadcast_in(line):
    (reading,) = cells_of(MODEM, [line])
    assert (reading.arfcn, reading.cell) == (48, "262-01-33281-3648")
    return reading.broadcast


@pytest.mark.parametrize("packet", ["", " pbcch: 0", PACKET])
def test_values_with_labels(packet):
    assert broadcast_in(CELL + LISTS + packet + RESELECTION) == FULL
    assert broadcast_in(CELL + LISTS + packet) == Broadcast(CHANNELS)


@pytest.mark.parametrize("packet", ["", ",0", ",1,2,8,0,5,0,10,11,2,0,15,0,0"])
@pytest.mark.parametrize("own", ["2,30 48", "0"])
def test_values_alone(packet, own):
    tail = f",{own},5,14 19 22 48 982{packet}"
    assert broadcast_in(NUMBERS + tail) == Broadcast(CHANNELS)
    assert broadcast_in(NUMBERS + tail + ",5,8,30,31,10,4") == FULL


def test_the_example_of_the_manual():
    (reading,) = cells_of(
        MODEM, ["48,24,-52,0.00,610,1,33281,3648,0,2,30 48,5,14 19 22 48 82"]
    )  # GM862 p386
    assert reading.broadcast.neighbour_arfcns == (14, 19, 22, 48, 82)


def test_an_empty_list_is_not_a_list_that_is_not_printed():
    for tail in (" numArfcn: 1 arfcn: 48", " numArfcn: 0", ""):
        assert broadcast_in(CELL + tail) is None
    for tail in (",1,48", ",0", ""):
        assert broadcast_in(NUMBERS + tail) is None
    without = " numArfcn: 1 arfcn: 48 numChannels: 0"
    for tail in (without, without + " array:", without + RESELECTION):
        assert broadcast_in(CELL + tail).neighbour_arfcns == ()
    assert broadcast_in(NUMBERS + ",1,48,0").neighbour_arfcns == ()
    assert broadcast_in(NUMBERS + ",1,48,5,8,30,31,10,4") == Broadcast(
        None, cro_db=60, penalty_time=31, t3212_raw=10
    )


@pytest.mark.parametrize(
    "tail",
    [
        LISTS.replace("982", "1024"),
        LISTS.replace("19", "14"),
        LISTS.replace("19", "019"),
        LISTS.replace("14 19", "1419"),
        LISTS.replace("22 ", ""),
        LISTS.replace("numChannels: 5 ", ""),
        LISTS.replace("array", "arra"),
        LISTS + " numChannels: 5 array: 14 19 22 48 982",
        LISTS.replace("arfcn: 30 48", "arfcn: 3048"),
        LISTS + " JAMMED",
        LISTS + RESELECTION.replace(" t3212: 10", " t3212: x"),
        LISTS + " t3212: 10 croffset: 30",
    ],
)
def test_a_tail_that_is_damaged_is_not_read(tail):
    assert broadcast_in(CELL + tail) is None


def test_values_out_of_range_are_unknown():
    tail = LISTS + RESELECTION.replace("30", "64").replace("31", "32").replace("10", "256")
    assert broadcast_in(CELL + tail) == Broadcast(CHANNELS)


def test_what_was_printed_once_is_unsure():
    line = CELL + LISTS + RESELECTION
    once, history = mark_doubtful(MODEM.read([line]), NumberHistory())
    assert once[0].broadcast.broadcast_unsure
    other = line.replace("22", "23")
    (changed,), history = mark_doubtful(MODEM.read([other]), history)
    assert changed.broadcast.broadcast_unsure
    (again,), history = mark_doubtful(MODEM.read([line]), history)
    assert again.broadcast == FULL
    elsewhere = line.replace("3648", "3649")
    (of_another,), _ = mark_doubtful(MODEM.read([elsewhere]), history)
    assert of_another.broadcast.broadcast_unsure


def test_a_later_survey_confirms_an_earlier_one_in_a_transcript():
    survey = ["Network survey started ...", CELL + LISTS, "Network survey ended", "OK"]
    lines = ["AT#CSURV", *survey, "AT#CSURV", *survey]
    assert [row.broadcast for row in rows_of(MODEM, lines)] == [Broadcast(CHANNELS)] * 2


MARKS = "0123456789 ,:axX-"


@pytest.mark.parametrize(
    "line", [CELL + LISTS + RESELECTION, NUMBERS + ",2,30 48,5,14 19 22 48 982,5,8,30,31,10,4"]
)
def test_every_single_damage_leaves_the_truth_nothing_or_a_doubt(line):
    """Each character is lost, doubled or replaced, after the whole row has been printed once."""
    _, history = mark_doubtful(MODEM.read([line]), NumberHistory())
    for at in range(len(line)):
        texts = ["", line[at] * 2, *MARKS, line[at] + "\n"]
        for text in texts:
            damaged = line[:at] + text + line[at + 1 :]
            check(damaged, history)
        check(line[:at], history)


def test_heavy_damage_gives_no_channel_that_is_not_printed():
    rng = random.Random(4)
    lines = [CELL + LISTS + RESELECTION, NUMBERS + ",2,30 48,5,14 19 22 48 982"]
    _, history = mark_doubtful(MODEM.read(lines), NumberHistory())
    for _ in range(3000):
        text = "\n".join(rng.choices(lines, k=2))
        for _ in range(rng.randint(1, 4)):
            at, size = rng.randrange(len(text)), rng.choice([0, 1, 1, 2, 9, 40])
            text = text[:at] + rng.choice(MARKS) * rng.randint(0, 2) + text[at + size :]
        check(text, history)


def check(text, history):
    rows, _ = mark_doubtful(MODEM.read(text.split("\n")), history)
    printed = set(text.replace(",", " ").replace(":", " ").split())
    for row in rows:
        found = getattr(row, "broadcast", None)
        if found is None or (row.arfcn, row.cell) != (48, "262-01-33281-3648"):
            continue
        assert set(map(str, found.neighbour_arfcns or ())) <= printed, text
        assert found.broadcast_unsure or found.neighbour_arfcns == CHANNELS, text
        assert found.broadcast_unsure or found.cro_db in {None, 60}, text


def test_byte_by_byte_and_whole():
    text = "\r\n".join(
        ["", "Network survey started ...", CELL + LISTS, "Network survey ended", "", "OK", ""]
    ).encode()
    for chunks in ([text], [text[i : i + 1] for i in range(len(text))]):
        framer = AtFramer()
        framer.send("AT#CSURV=0,62")
        replies = [e for chunk in chunks for e in framer.feed(chunk) if isinstance(e, Reply)]
        (reply,) = replies
        (reading,) = cells_of(MODEM, reply.marked_lines)
        assert reading.broadcast == Broadcast(CHANNELS)
