import pytest

from logger.core.types import CellReading
from logger.drivers.cinterion import Cinterion
from logger.drivers.reading.row_language import NoCell
from tests.kit.drivers import identity_of

MODEM = Cinterion()

# Values of our own in the layouts of firmware_notes/cinterion.md.
HEADER = [
    "Serving Cell     I Dedicated channel",
    "chann rs  dBm  PLMN  LAC cell NCC BCC PWR RXLev  C1 I chann TS timAdv",
]
MONI = "847  19  -75 26201 2A3B 4C5D   5   2  33  -104  30 I    No connection"
MONI_CALL = "847  17 -79 262 01 2A3B 4C5D 5   2   33  -104  30 I 851  2  4  5  -80  1 S_HR"
MONP = "67 24 -81 26201 4 27 25"
SMONP = "853,31,-80,262,07,4,3,26,22,2A3C,4C5E,0,0"
SNMON = '^SNMON: "INS",0,1,0,4C5D,2A3B,"26202",67,41,-70,1'


def one(*lines):
    found = MODEM.rows_in(lines)
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize(
    "row",
    [
        MONI,
        MONI.replace("26201", "262 01"),
        MONI.replace("  ", "\t"),
        "12:00:01 " + MONI,
        MONI.replace("-", "\u2013"),
        MONI.replace("-", "\xe2\x80\x93"),
    ],
)
def test_moni_with_the_network_in_one_column_or_two(row):
    assert one(row) == CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="01",
        lac=0x2A3B,
        cid=0x4C5D,
        arfcn=847,
        bsic=42,
        rssi_dbm=-75.0,
        c1=30,
        more={"ncc": 5, "bcc": 2, "state": "No connection"},
    )


def test_moni_in_a_call_and_while_searching():
    reading = one(MONI_CALL)
    assert (reading.ta, reading.rxq, reading.more) == (4, 1, {"ncc": 5, "bcc": 2})
    assert one(*HEADER, "                  Searching") == NoCell("GSM", state="Searching")
    assert MODEM.rows_in(["Searching"]) == ()
    reading = one(MONI.replace("4C5D   5   2  33  -104  30", "0000   -   -   -     -   -"))
    assert (identity_of(reading), reading.bsic, reading.rssi_dbm) == (
        ("262", "01", 0x2A3B, None),
        None,
        -75.0,
    )


@pytest.mark.parametrize(
    "row", [MONP, "67  24  -81 262  01   4  27  25", "  67 24 -81 26201 4 - -"]
)
def test_monp(row):
    reading = one(row)
    assert (reading.role, identity_of(reading), reading.arfcn) == (
        "neighbour",
        ("262", "01", None, None),
        67,
    )
    assert (reading.rssi_dbm, reading.more, reading.bsic) == (-81.0, {"bcc": 4}, None)
    assert reading.c1 == (None if "-" in row[-3:] else 27)


def test_smonp_under_its_headings():
    gsm, wcdma = MODEM.rows_in(
        ["2G:", SMONP, "851,30,-82,262,07,4,1", "3G:", "10713,117,-7.0,-84", "-----,---,-----,----"]
    )
    assert (gsm.cell, gsm.bsic, gsm.rssi_dbm) == ("262-07-10812-19550", 35, -80.0)
    assert (wcdma.rat, wcdma.psc, wcdma.rscp_dbm, wcdma.ecio_db) == ("WCDMA", 117, -84.0, -7.0)
    assert identity_of(one("2G:", SMONP.replace("4C5E", "----"))) == ("262", "07", 0x2A3C, None)
    assert MODEM.rows_in([SMONP]) == ()


def test_scan():
    reading = one(SNMON)
    assert (reading.role, identity_of(reading), reading.arfcn) == (
        "scan",
        ("262", "02", None, None),
        67,
    )
    assert (reading.rssi_dbm, reading.more) == (-70.0, {"lac_raw": "2A3B", "cell_raw": "4C5D"})
    assert MODEM.rows_in(['^SNMON: "INS",0,1']) == ()
