import pytest

from logger.core.types import CellReading
from logger.drivers.cinterion import Cinterion
from logger.drivers.rows import NoCell

MODEM = Cinterion()

# Examples of the manuals of MC35 (V05.00 p186), TC35 (V02.10 p110) and EHS6 (V03.001 p191); MONI_CALL and SNMON are put
# together from the syntax in the manuals.
HEADER = [
    "Serving Cell     I Dedicated channel",
    "chann rs  dBm  PLMN  LAC cell NCC BCC PWR RXLev  C1 I chann TS timAdv",
]
MONI = "1013  21  -71 00101 1001 0103   7   7  33  -105  33 I    No connection"
MONI_CALL = "1013  19 -76 001 01 1001 0103 7   7   33  -105  33 I 1015  1  3  5  -76  0 S_HR"
MONP = "29 22 -70 26201 2 33 33"
SMONP = "1021,36,-75,262,07,7,1,31,21,4EED,08B2,0,0"
SNMON = '^SNMON: "INS",0,1,0,83BA,0143,"26202",71,49,-61,1'


def one(*lines):
    found = MODEM.cells_in(lines)
    assert len(found) == 1
    return found[0]


def who(reading):
    return reading.mcc, reading.mnc, reading.lac, reading.cid


@pytest.mark.parametrize(
    "row",
    [
        MONI,
        MONI.replace("00101", "001 01"),
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
        mcc="001",
        mnc="01",
        lac=0x1001,
        cid=0x0103,
        arfcn=1013,
        bsic=63,
        rssi_dbm=-71.0,
        c1=33,
        more={"ncc": 7, "bcc": 7, "state": "No connection"},
    )


def test_moni_in_a_call_and_while_searching():
    reading = one(MONI_CALL)
    assert (reading.ta, reading.rxq, reading.more) == (3, 0, {"ncc": 7, "bcc": 7})
    assert one(*HEADER, "                  Searching") == NoCell("GSM", state="Searching")
    assert MODEM.cells_in(["Searching"]) == ()
    reading = one(MONI.replace("0103   7   7  33  -105  33", "0000   -   -   -     -   -"))
    assert (who(reading), reading.bsic, reading.rssi_dbm) == (("001", "01", 0x1001, None), None, -71.0)


@pytest.mark.parametrize("row", [MONP, "29  22  -70 262  01   2  33  33", "  29 22 -70 26201 2 - -"])
def test_monp(row):
    reading = one(row)
    assert (reading.role, who(reading), reading.arfcn) == ("neighbour", ("262", "01", None, None), 29)
    assert (reading.rssi_dbm, reading.more, reading.bsic) == (-70.0, {"bcc": 2}, None)
    assert reading.c1 == (None if "-" in row[-3:] else 33)


def test_smonp_under_its_headings():
    gsm, wcdma = MODEM.cells_in(
        ["2G:", SMONP, "1006,37,-74,262,07,7,4", "3G:", "10564,96,-6.5,-77", "-----,---,-----,----"]
    )
    assert (gsm.cell, gsm.bsic, gsm.rssi_dbm) == ("262-07-20205-2226", 57, -75.0)
    assert (wcdma.rat, wcdma.psc, wcdma.rscp_dbm, wcdma.ecio_db) == ("WCDMA", 96, -77.0, -6.5)
    assert who(one("2G:", SMONP.replace("08B2", "----"))) == ("262", "07", 0x4EED, None)
    assert MODEM.cells_in([SMONP]) == ()


def test_scan():
    reading = one(SNMON)
    assert (reading.role, who(reading), reading.arfcn) == ("scan", ("262", "02", None, None), 71)
    assert (reading.rssi_dbm, reading.more) == (-61.0, {"lac_raw": "0143", "cell_raw": "83BA"})
    assert MODEM.cells_in(['^SNMON: "INS",0,1']) == ()
