import re
from dataclasses import replace

import pytest

from logger.core.types import CellReading
from logger.drivers.generic import NAME, Generic
from logger.drivers.quectel_gsm import QuectelGsm
from logger.drivers.reading.row_language import NoCell
from tests.kit.corpus import check_recorded
from tests.kit.drivers import (
    NO_IDENTITY,
    cells_of,
    identity_of,
    only_cell_of,
    poll_on_the_wire,
    run_dialogue,
    run_exchange,
)

MODEM = QuectelGsm()

# Values of our own in the documented layout; NBIOT is a row of the corpus.
HEADER = "+QENG: 1,4"
SERVING = "+QENG: 0,262,01,1b2c,4d5e,3,42,-73,38,38,5,7,x,x,x,x,x,x,x"
NEIGHBOURS = (
    "+QENG: 1,1,5,-76,30,35,35,262,01,1b2c,4d5f,2,11,-80,17,31,31,"
    "262,01,1b2c,4d60,3,14,-88,44,23,23,262,01,1b2c,7a8b"
)
CHANNELS = "+QENG: 4,4,(5,-76,30),(11,-80,17),(16,-101,x),(7,-102,6)"
NBIOT = '+QENG: 0,1769,9,400,"00288516",-103,-9,-94,5,3,"A924",0,14,2'
SAMPLES = [HEADER, SERVING, NEIGHBOURS, CHANNELS, NBIOT]


@pytest.mark.parametrize("dialect", ["qeng_gsm", "qeng_nbiot"])
def test_recorded_replies(corpus, dialect):
    check_recorded(corpus, MODEM, f"quectel_{dialect}")


def cells(*lines):
    return cells_of(MODEM, lines)


def one(*lines):
    return only_cell_of(MODEM, lines)


# --- forms


def test_serving_cell():
    assert one(SERVING) == CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="01",
        lac=0x1B2C,
        cid=0x4D5E,
        arfcn=3,
        bsic=42,
        rssi_dbm=-73.0,
        c1=38,
        c2=38,
    )


def test_neighbours():
    found = cells(NEIGHBOURS)
    assert [cell.cell for cell in found] == [
        "262-01-6956-19807",
        "262-01-6956-19808",
        "262-01-6956-31371",
    ]
    assert [(cell.role, cell.arfcn, cell.rssi_dbm, cell.bsic) for cell in found] == [
        ("neighbour", 5, -76.0, 30),
        ("neighbour", 11, -80.0, 17),
        ("neighbour", 14, -88.0, 44),
    ]
    assert (found[1].c1, found[1].c2) == (31, 31)


@pytest.mark.parametrize("at", range(12, len(NEIGHBOURS), 3))
@pytest.mark.parametrize("end", ["", " "])
def test_neighbours_in_a_line_that_a_terminal_has_wrapped(at, end):
    whole = cells(NEIGHBOURS)
    assert cells(NEIGHBOURS[:at] + end, NEIGHBOURS[at:]) == whole
    assert (
        cells(
            HEADER, SERVING, NEIGHBOURS[:at], NEIGHBOURS[at : at + 20], NEIGHBOURS[at + 20 :], "OK"
        )[1:]
        == whole
    )


def test_a_urc_between_the_parts_of_a_wrapped_line_ends_it():
    assert [cell.cell for cell in cells(NEIGHBOURS[:70], "+CIEV: 1", NEIGHBOURS[70:])] == [
        "262-01-6956-19807",
        None,
    ]


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_neighbour_of_several_that_is_not_received(number):
    fields = NEIGHBOURS.removeprefix("+QENG: 1,").split(",")
    start = 10 * (number - 1)
    fields[start + 1 : start + 10] = "x" * 9
    received = [cell for n, cell in enumerate(cells(NEIGHBOURS), 1) if n != number]
    assert cells("+QENG: 1," + ",".join(fields)) == received
    assert cells("+QENG: 1," + ",".join(fields) + ",") == received


def test_neighbour_that_is_not_decoded_keeps_its_level():
    first, second = cells("+QENG: 1,1,9,-85,x,x,x,x,x,x,x,2,11,-80,17,31,31,262,01,1b2c,4d60")
    assert (identity_of(first), first.arfcn, first.rssi_dbm, first.bsic) == (
        NO_IDENTITY,
        9,
        -85.0,
        None,
    )
    assert second.cell == "262-01-6956-19808"


def test_strongest_channels():
    assert [(cell.arfcn, cell.rssi_dbm, cell.bsic) for cell in cells(CHANNELS)] == [
        (5, -76.0, 30),
        (11, -80.0, 17),
        (16, -101.0, None),
        (7, -102.0, 6),
    ]


def test_nbiot_cell_has_the_same_prefix():
    cell = one(NBIOT)
    assert (cell.rat, identity_of(cell), cell.arfcn, cell.pci) == (
        "NB-IoT",
        (None, None, 0xA924, 0x288516),
        1769,
        400,
    )
    assert (cell.rsrp_dbm, cell.rsrq_db, cell.rssi_dbm, cell.band) == (-103.0, -9.0, -94.0, 3)


@pytest.mark.parametrize(
    ("row", "area_and_cell"),
    [
        (NBIOT.replace(",9,400", ",,400"), (0xA924, 0x288516)),
        (NBIOT.replace("-103,-9,-94,5", ",,,"), (0xA924, 0x288516)),
        (NBIOT.replace('"A924"', "3095"), (None, 0x288516)),
        (NBIOT.replace('"00288516"', "00288516"), (0xA924, None)),
        (NBIOT.replace('"00288516"', '"00288516').replace('"A924"', 'A924"'), (0xA924, 0x288516)),
        (NBIOT[: NBIOT.index(",14,2")], (0xA924, 0x288516)),
        (NBIOT.replace("0,1769", "0,262").replace("9,400", "20,400"), (0xA924, 0x288516)),
    ],
)
def test_nbiot_values_that_are_missing_or_of_unknown_base(row, area_and_cell):
    cell = one(row)
    assert (cell.rat, cell.pci, (cell.tac, cell.cid)) == ("NB-IoT", 400, area_and_cell)


def test_impossible_nbiot_level_is_unknown():
    assert one(NBIOT.replace("-94", "31")).rssi_dbm is None


def test_nbiot_neighbours():
    with_offset, without = one("+QENG: 1,3740,1,137,-92"), one("+QENG: 1,3740,137,-92,-11")
    for cell in (with_offset, without):
        assert (cell.role, cell.rat, cell.arfcn, cell.pci, cell.rsrp_dbm) == (
            "neighbour",
            "NB-IoT",
            3740,
            137,
            -92.0,
        )
    assert (with_offset.rsrq_db, without.rsrq_db) == (None, -11.0)
    assert len(cells("+QENG: 1,3740,1,137,-92,3741,1,205,-97")) == 2


def test_nbiot_modem_that_searches_has_no_cell():
    assert MODEM.read(['+QENG: 0,0,0,0,"00000000",-157,-20,-110,-20,0,"0000",0,,3']) == (
        NoCell("NB-IoT"),
    )


@pytest.mark.parametrize(
    "line", ["+QENG: 1,0", "+QENG: 1,4", "+QENG: 0,0", "+QENG: 0", "+QENG: 2,21,88", "+QENG: 4,0"]
)
def test_lines_without_a_cell(line):
    assert MODEM.read([line]) == ()
    assert MODEM.role_of(line) is None


def test_rows_of_bc660_that_are_no_cells():
    assert (
        MODEM.read(
            [
                "+QENG: 3,917,84,31",
                '+QENG: 4,"EMM_REGISTERED","NORMAL_SERVICE","IDLE","HPLMN",26201',
            ]
        )
        == ()
    )


# --- unknown and damaged


@pytest.mark.parametrize(
    ("printed", "identity"),
    [
        ("262,01,ffff,4d5e", ("262", "01", None, 0x4D5E)),
        ("262,01,1b2c,0000", ("262", "01", 0x1B2C, None)),
        ("x,x,x,x", NO_IDENTITY),
        ("262,01,1b2c,4d5e0", NO_IDENTITY),
        ("262,01,1b2g,4d5e", NO_IDENTITY),
        ("26,01,1b2c,4d5e", NO_IDENTITY),
    ],
)
def test_identity_is_complete_or_nothing(printed, identity):
    cell = one(SERVING.replace("262,01,1b2c,4d5e", printed))
    assert (identity_of(cell), cell.arfcn, cell.rssi_dbm) == (identity, 3, -73.0)


def test_lost_comma_names_no_other_cell():
    for row in (SERVING, NEIGHBOURS, NBIOT):
        known = {identity_of(cell) for cell in cells(row)} | {NO_IDENTITY}
        for comma in (match.start() for match in re.finditer(",", row)):
            assert {identity_of(cell) for cell in cells(row[:comma] + row[comma + 1 :])} <= known, (
                row[:comma]
            )


@pytest.mark.parametrize("row", [SERVING, NEIGHBOURS, NBIOT])
def test_cut_row_names_no_other_cell(row):
    known = {identity_of(cell) for cell in cells(row)} | {NO_IDENTITY, (None, None, None, 0x288516)}
    for end in range(len(row)):
        assert {identity_of(cell) for cell in cells(row[:end])} <= known, row[:end]


@pytest.mark.parametrize(
    "write",
    [
        lambda row: f"12:00:01.123 <- {row}",
        lambda row: f"b'\\r\\n{row}\\r\\n\\r\\nOK\\r\\n'",
        lambda row: row.replace(": ", ":"),
        lambda row: row.replace(",", ", "),
    ],
)
@pytest.mark.parametrize("row", [SERVING, NEIGHBOURS, CHANNELS, NBIOT])
def test_row_in_a_log(row, write):
    assert cells(write(row)) == cells(row)


# --- conversation


AWAKE = [(text, [], "OK") for text in ("AT", "ATE0", "ATV1", "AT+CMEE=1")]


def test_setup():
    """An old M95 refuses the second, an NB-IoT modem both."""
    for first, second in (("OK", "OK"), ("OK", "ERROR"), ("ERROR", "ERROR")):
        asked = [("AT+QENG=1,1", [], first), ("AT+QENG=1,4", [], second)]
        assert run_exchange(MODEM.setup(), [*AWAKE, *asked]) is True
    assert run_exchange(MODEM.setup(), [("AT", [], None)] * 5) is False


def test_poll_of_a_gsm_modem():
    rows = run_exchange(MODEM.poll(), [("AT+QENG?", [HEADER, SERVING, NEIGHBOURS], "OK")])
    assert [identity_of(row) for row in rows] == [
        identity_of(cell) for cell in cells(SERVING, NEIGHBOURS)
    ]
    assert run_exchange(MODEM.poll(), [("AT+QENG?", [HEADER, SERVING], None)]) == (one(SERVING),)
    assert run_exchange(MODEM.poll(), [("AT+QENG?", [HEADER], "OK")]) == ()


@pytest.mark.parametrize(
    ("lines", "final"), [([], None), ([HEADER], None), ([], "OK"), (["+QENG: 0,0"], "OK")]
)
def test_poll_without_an_answer(lines, final):
    assert run_exchange(MODEM.poll(), [("AT+QENG?", lines, final)]) is None


def test_poll_of_an_nbiot_modem():
    refused = ("AT+QENG?", [], "+CME ERROR: 50")
    names = [(one.text, [], "ERROR") for one in NAME]
    asked = [refused, ("AT+QENG=0", [NBIOT], "OK"), *names]
    assert run_exchange(MODEM.poll(), asked) == (one(NBIOT),)
    assert run_exchange(MODEM.poll(), [refused, ("AT+QENG=0", [], "OK")]) == ()
    assert run_exchange(MODEM.poll(), [refused, ("AT+QENG=0", [], None)]) is None
    common = [one.text for one in (*NAME, *Generic.poll_commands)]
    others = [(text, [], "ERROR") for text in ("AT+QENG=0", "AT+NUESTATS=CELL", *common)]
    assert run_exchange(MODEM.poll(), [refused, *others]) is None


def test_a_modem_that_refuses_all_rows_is_reported_unless_it_names_its_cell():
    unnamed = {"AT+CREG?": (["+CREG: 0,2"], "OK")}
    assert run_dialogue(MODEM.poll(), unnamed)[0] is None
    named = {"AT+CEREG?": (['+CEREG: 2,1,"A924","00288516",9'], "OK")}
    assert run_dialogue(MODEM.poll(), named)[0][0].cid == 0x288516


NETWORK = {"AT+COPS?": '+COPS:0,2,"26202"\n\nOK'}


def test_the_network_of_an_nbiot_cell_is_that_of_cops():
    registration = {"AT+CEREG?": '+CEREG: 2,1,"A924","00288516",9\n\nOK'}
    replies = {"AT+QENG=0": f"{NBIOT}\n\nOK", **NETWORK, **registration}
    cell = one(NBIOT)
    (row,) = poll_on_the_wire(MODEM, replies)
    assert (row, row.cid) == (replace(cell, mcc="262", mnc="02"), 0x288516)


@pytest.mark.parametrize("form", ["NUESTATS:CELL,{}", '+NUESTATS: "CELL",{}'])
def test_cells_of_a_bc95(form):
    rows = ("3740,137,1,-1012,-108,-921,62", "3740,138,0,-1090,-145,-932,-31")
    replies = {
        "AT+NUESTATS=CELL": "\n".join(map(form.format, rows)) + "\n\nOK",
        "AT+CEREG?": "+CEREG:2,1,4E5F,2D3C4B5,7\n\nOK",
        **NETWORK,
    }
    serving, neighbour = poll_on_the_wire(MODEM, replies)
    assert serving == CellReading(
        "serving",
        "NB-IoT",
        "262",
        "02",
        tac=0x4E5F,
        cid=0x2D3C4B5,
        arfcn=3740,
        pci=137,
        rssi_dbm=-92.1,
        rsrp_dbm=-101.2,
        rsrq_db=-10.8,
    )
    assert (neighbour.role, neighbour.pci, neighbour.rsrp_dbm) == ("neighbour", 138, -109.0)


@pytest.mark.parametrize("damaged", ["-101", "-10", "1012", "-101x", "-"])
def test_a_damaged_level_of_a_bc95_is_none(damaged):
    assert cells(f"NUESTATS:CELL,3740,137,1,{damaged},-108,-921,62") == []


@pytest.mark.parametrize("end", [r"\r\n", "\\r\\n\n", "\\r\n", r"\n"])
def test_a_line_end_that_a_log_has_as_text_ends_a_row_and_joins_no_number(end):
    row = "+QENG: 0,262,01,1b2c,4d5e,3,42,-73,38,38,5,7,x,x,x,x,x,x,x"
    driver = QuectelGsm()
    assert driver.read([row])
    for at in range(len("+QENG: 0,2"), len("+QENG: 0,262,01,1b2c,4d5e")):
        found = driver.read((row[:at] + end + row[at:]).split("\n"))
        assert not any(cell.cid for cell in found if isinstance(cell, CellReading)), at
