import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logger.drivers.protocols.at import AtFramer
from logger.drivers.sim800 import Sim800
from tests.kit.drivers import NO_IDENTITY, identity_of

MODEM = Sim800()

SERVING = '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"'
NEIGHBOUR = '+CENG: 1,"1688,16,25,a53f,310,260,0113"'
SCAN = 'Operator:"T, Mobile",MCC:310,MNC:260,Rxlev:53,Cellid:CF00,Arfcn:1709,Lac:0113,Bsic:2C'


def one(line, header=None):
    readings = MODEM.read([line] if header is None else [header, line])
    assert len(readings) <= 1
    return readings[0] if readings else None


@pytest.mark.parametrize("row", [SERVING, NEIGHBOUR, SCAN])
def test_cut_row_is_the_complete_cell_or_none(row):
    whole = one(row)
    for end in range(len(row)):
        reading = one(row[:end])
        assert reading is None or identity_of(reading) in (
            identity_of(whole),
            ("310", "260", None, 0xCF00),
        ), row[:end]


@pytest.mark.parametrize(
    ("row", "cell"),
    [
        (NEIGHBOUR, "310-260-275-42303"),
        (NEIGHBOUR.replace("0113", "113"), None),
        (SERVING, "310-411-6029-15"),
        ('+CENG: 1,"262,01,2b3c,4d5e,27,31"', "262-01-11068-19806"),
        ('+CENG: 1,"262,01,2b3c,4d5e,27,3"', None),
    ],
)
def test_row_that_lost_only_its_closing_mark_is_read_where_nothing_can_be_cut(row, cell):
    reading = one(row[:-1])
    assert (reading.cell if reading else None) == cell


def test_row_without_marks_as_the_manual_prints_it():
    assert one("+CENG: 0,262,02,3d4e,5f60,37,41").cell == "262-02-15694-24416"
    assert MODEM.role_of("+CENG: 0,262,02,3d4e,5f60,37,41") == "serving"


@pytest.mark.parametrize("lost", [m.start() for m in re.finditer(",", NEIGHBOUR[10:])])
def test_lost_comma_names_no_cell(lost):
    row = NEIGHBOUR[: 10 + lost] + NEIGHBOUR[11 + lost :]
    reading = one(row)
    assert reading is None or (identity_of(reading), reading.arfcn_raw, reading.rxlev_raw) == (
        NO_IDENTITY,
        1688,
        16,
    )


@pytest.mark.parametrize("lac", ["013", "03", "00", "01130", "g113", "-113", " "])
def test_number_that_no_firmware_prints_names_no_cell(lac):
    reading = one(NEIGHBOUR.replace("0113", lac))
    assert identity_of(reading) == NO_IDENTITY or (lac == " " and reading.cell is None)


def test_rows_spliced_into_each_other_are_no_cell():
    assert one(NEIGHBOUR[:-3] + '"0233,26,00,,,0000"') is None
    assert one('+CENG: 2,"233,26,00,,,0000"') is None


def test_two_rows_on_one_line():
    assert [r.role for r in MODEM.read([SERVING + NEIGHBOUR])] == ["serving", "neighbour"]
    assert [r.role for r in MODEM.read([SERVING[:30] + NEIGHBOUR])] == ["neighbour"]


ROWS = [
    SERVING,
    NEIGHBOUR,
    '+CENG: 2,"0233,26,00,,,0000"',
    '+CENG: 3,"262,01,2b3c,4d5e,27,31"',
    '+CENG: 0,"0037,44,00,260,01,43,67f4,05,05,539d,255,-69,145,145,x,x,x,x,x,x,x"',
    '+CENG: 1,"0009,25,61,260,01,539d,80,56"',
    '+CENG:6,"0727,06,127,ffff,000,00,0"',
    SCAN,
]
TRANSCRIPT = "\n".join([*ROWS, "OK", ""]).encode()
MUTATIONS = st.lists(
    st.tuples(
        st.integers(0, len(TRANSCRIPT) - 1),
        st.sampled_from(["set", "cut", "add"]),
        st.integers(0, 255),
    ),
    max_size=8,
)


def mutate(data, mutations):
    damaged = bytearray(data)
    for at, what, byte in mutations:
        if what == "set":
            damaged[at % len(damaged)] = byte
        elif what == "cut":
            del damaged[at % len(damaged)]
        else:
            damaged.insert(at, byte)
    return bytes(damaged)


def assert_identities_are_printed(readings, text):
    tokens = set(re.split(r"[^0-9A-Za-z]", text))
    numbers = {int(token, 16) for token in tokens if re.fullmatch(r"[0-9a-fA-F]{1,4}", token)}
    for reading in readings:
        assert {reading.mcc, reading.mnc} <= tokens | {None}
        assert {reading.lac, reading.cid} <= numbers | {None}
        assert reading.mcc is not None or (reading.lac, reading.cid) == (None, None)


@given(MUTATIONS)
def test_damage_raises_nothing_and_invents_no_identity(mutations):
    data = mutate(TRANSCRIPT, mutations)
    framer = AtFramer()
    framer.send("AT+CENG?")
    for event in [*framer.feed(data), framer.expire()]:
        lines = getattr(event, "lines", (getattr(event, "line", ""),))
        for line in lines:
            assert_identities_are_printed(MODEM.read([line]), line)
    assert_identities_are_printed(
        MODEM.read(data.decode("latin-1").split("\n")), data.decode("latin-1")
    )


def test_lost_comma_mark_or_line_end_makes_no_other_cell():
    known = {identity_of(reading) for reading in MODEM.read(TRANSCRIPT.decode().split("\n"))} | {
        NO_IDENTITY
    }
    for at in range(len(TRANSCRIPT)):
        if chr(TRANSCRIPT[at]).isalnum():
            continue  # a digit lost inside a number cannot be seen
        damaged = TRANSCRIPT[:at] + TRANSCRIPT[at + 1 :]
        assert {identity_of(r) for r in MODEM.read(damaged.decode().split("\n"))} <= known, damaged[
            :at
        ]


@given(st.lists(st.text(), max_size=5))
def test_any_text_is_harmless(lines):
    MODEM.read(lines)
    for line in lines:
        MODEM.role_of(line), MODEM.is_restart(line)
