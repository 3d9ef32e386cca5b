import re

import pytest

from logger.drivers.quectel import Quectel
from logger.drivers.reading.row_language import NoCell
from tests.kit.drivers import NO_IDENTITY, identity_of, only_cell_of

MODEM = Quectel()

# Values of our own in the layouts of the EC2x manual 6.17; WCDMA, SA, EN_DC and SHORT_SCAN are in
# the corpus.
GSM = (
    '+QENG: "servingcell","NOCONN","GSM",262,01,1A2B,3C4D,21,57,'
    '-,-66,255,255,0,39,41,1,-,-,-,-,-,-,-,-,-,"-"'
)

WCDMA = '+QENG: "servingcell","NOCONN","WCDMA",515,03,3AB2,B55EEFF,3037,352,1,-94,-15,-,-,-,-,-'

LTE = '+QENG: "servingcell","NOCONN","LTE","FDD",262,01,314159,212,1300,3,5,5,B2C,-97,-8,-70,14,23'

SA = (
    '+QENG: "servingcell","NOCONN","NR5G-SA","TDD",460,00,'
    "170C23000,901,46550B,504990,41,-,-54,-10,16,-,-"
)

EN_DC = [
    '+QENG: "servingcell","NOCONN"',
    '+QENG: "LTE","FDD",515,03,3359966,1,150,1,5,5,4AA3,-89,-13,-58,16,15,20,-',
    '+QENG:"NR5G-NSA",515,03,832,-76,21,-11,528030,41,8,1',
]

GSM_ON_GSM = '+QENG: "neighbourcell","GSM",262,01,1A2C,3C4F,27,61,-79,24,25,0,0'

GSM_ON_LTE = '+QENG: "neighbourcell","GSM",88,2,12,48,255,0,37,-810,18'

SCAN = '+QSCAN: "LTE",262,02,6300,77,-101,-10,15,15,1F2E3D4,5A6B,50,20'


def one(*lines):
    return only_cell_of(MODEM, lines)


def test_no_cell():
    assert MODEM.read(['+QENG: "servingcell","SEARCH"']) == (NoCell(state="SEARCH"),)
    assert MODEM.read(['+QCSQ: "NOSERVICE"']) == (NoCell(status="NOSERVICE"),)
    assert MODEM.read(['+QENG: "servingcell","NOCONN"', 'AT+QENG="servingcell"', "OK"]) == ()


@pytest.mark.parametrize("row", [GSM, WCDMA, LTE, SA, GSM_ON_GSM, GSM_ON_LTE, SCAN])
@pytest.mark.parametrize(
    "write",
    [
        lambda row: f"May/06/2023 14:49:20 lte,async,raw lte1: rcvd {row}",
        lambda row: f"[04-21_17:35:15:441] AT< {row}",
        lambda row: f"b'\\r\\n{row}\\r\\n\\r\\nOK\\r\\n'",
        lambda row: '"' + row.replace('"', '\\"') + '\\r\\n"',
        lambda row: row.replace('"', ""),
        lambda row: row.replace(": ", ":"),
        lambda row: row.replace(",", ", ") + "  ",
        lambda row: row.replace('",', ","),
        lambda row: f'{row}+QSPN: "spusu","spusu","spusu",0,"22288"',
        lambda row: row.lower().replace("fdd", "FDD"),
    ],
)
def test_row_in_a_log(write, row):
    cell, found = one(row), one(write(row))
    assert (found.role, found.rat, identity_of(found), found.arfcn) == (
        cell.role,
        cell.rat,
        identity_of(cell),
        cell.arfcn,
    )
    assert found.level_dbm == cell.level_dbm


@pytest.mark.parametrize(
    ("printed", "identity"),
    [
        ("262,01,FFFF,3C4D", ("262", "01", None, 0x3C4D)),
        ("262,01,1A2B,FFFF", ("262", "01", 0x1A2B, None)),
        ("262,01,1A2B,-", ("262", "01", 0x1A2B, None)),
        ("-,-,-,-", NO_IDENTITY),
        ("262,1,1A2B,3C4D", NO_IDENTITY),
        ("2G2,01,1A2B,3C4D", NO_IDENTITY),
        ("262,01,1H2B,3C4D", NO_IDENTITY),
        ("262,01,1A2B,3C4D3", NO_IDENTITY),
        ("000,01,1A2B,3C4D", NO_IDENTITY),
    ],
)
def test_identity_is_complete_or_nothing(printed, identity):
    cell = one(GSM.replace("262,01,1A2B,3C4D", printed))
    assert (identity_of(cell), cell.arfcn, cell.rssi_dbm) == (identity, 57, -66.0)


def test_unknown_is_none():
    cell = one(GSM.replace(",21,57,-,-66,", ",255,-,-,-,"))
    assert (cell.cell, cell.bsic, cell.arfcn, cell.level_dbm, cell.ta) == (
        "262-01-6699-15437",
        None,
        None,
        None,
        None,
    )


@pytest.mark.parametrize("row", [GSM, WCDMA, LTE, SA, GSM_ON_GSM, SCAN, EN_DC[1]])
def test_cut_row_is_the_same_cell_or_no_cell(row):
    whole = identity_of(one(row))
    for end in range(len(row)):
        cell = one(row[:end])
        assert cell is None or identity_of(cell) in {
            whole,
            NO_IDENTITY,
            (*whole[:2], None, None),
        }, row[:end]


@pytest.mark.parametrize("row", [GSM, WCDMA, LTE, SA, GSM_ON_GSM, GSM_ON_LTE, EN_DC[1]])
def test_lost_comma_names_no_other_cell(row):
    whole = identity_of(one(row))
    for comma in (match.start() for match in re.finditer(",", row)):
        cell = one(row[:comma] + row[comma + 1 :])
        assert cell is None or identity_of(cell) in {whole, NO_IDENTITY}, comma


@pytest.mark.parametrize(
    "line", ["", "+QENG:", "+QENG: ,", '+QENG: "servingcell"', "+QSCAN:", "+QCSQ:", "+QOPS:", "OK"]
)
def test_lines_that_read_nothing(line):
    assert MODEM.read([line]) == ()
