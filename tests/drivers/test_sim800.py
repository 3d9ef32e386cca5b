import pytest

from logger.core.types import CellReading
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


# --- layouts


def test_serving_cell():
    assert one(SERVING) == CellReading(
        role="serving",
        rat="GSM",
        mcc="310",
        mnc="411",
        lac=0x178D,
        cid=0x000F,
        arfcn=154,
        arfcn_raw=154,
        bsic=12,
        rxlev_raw=28,
        rxq=0,
        rssi_dbm=-85.0,
    )


def test_neighbour_with_cell_id_and_flag_of_the_1900_band():
    assert one(NEIGHBOUR) == CellReading(
        role="neighbour",
        rat="GSM",
        mcc="310",
        mnc="260",
        lac=0x0113,
        cid=0xA53F,
        arfcn=664,
        arfcn_raw=1688,
        bsic=25,
        rxlev_raw=16,
        rssi_dbm=-97.0,
    )


def test_neighbour_without_cell_id():
    assert identity_of(one('+CENG: 1,"0128,15,30,310,411,178d"')) == ("310", "411", 0x178D, None)


def test_mode_4():
    serving = one('+CENG: 0,"0061,38,00,262,01,37,5e6f,05,05,3c4d,7,-75,30,-5,x,x,x,x,x,x,x"')
    assert (serving.cell, serving.rssi_dbm, serving.ta, serving.c1, serving.c2) == (
        "262-01-15437-24175",
        -75.0,
        7,
        30,
        -5,
    )
    row = one('+CENG: 1,"0067,21,44,262,01,3c4d,18,-6"')
    assert (identity_of(row), row.c1, row.c2) == (("262", "01", 0x3C4D, None), 18, -6)
    row = one('+CENG: 1,"0067,21,44,5e70,262,01,3c4d,x,x"')
    assert (identity_of(row), row.c1, row.c2) == (("262", "01", 0x3C4D, 0x5E70), None, None)


@pytest.mark.parametrize("header", [None, "+CENG: 3,0", "+CENG: 3,1"])
@pytest.mark.parametrize("number", [0, 4])
def test_mode_3_has_no_channel(number, header):
    reading = one(f'+CENG: {number},"262,01,2b3c,4d5e,27,31"', header)
    assert (identity_of(reading), reading.bsic, reading.rxlev_raw) == (
        ("262", "01", 0x2B3C, 0x4D5E),
        27,
        31,
    )
    assert (reading.arfcn, reading.arfcn_raw) == (None, None)
    assert reading.role == ("neighbour" if number else "serving")


def test_header_decides_between_the_two_meanings_of_six_values():
    row = '+CENG: 2,"208,15,30,310,411,178d"'
    assert identity_of(one(row, "+CENG: 1,0")) == ("310", "411", 0x178D, None)
    assert one(row, "+CENG: 3,0") is None
    assert one(row) is None
    assert one('+CENG: 2,"0208,15,30,310,411,178d"', "+CENG: 3,0") is None


def test_sim900_has_no_documented_level_in_dbm():
    serving = one('+CENG:0,"0668,13,99,310,260,59,5431,05,03,fd,0"')
    assert identity_of(serving) == ("310", "260", 0xFD, 0x5431)
    assert (serving.rxlev_raw, serving.rssi_dbm, serving.rxq, serving.ta) == (13, None, None, 0)


def test_sim900_row_in_the_order_of_its_older_manual_names_no_cell():
    row = one('+CENG:0,"0668,13,99,310,260,59,5431,00fd,05,03,0"')
    assert (identity_of(row), row.arfcn, row.rxlev_raw) == (NO_IDENTITY, 668, 13)


def test_scan_line():
    reading = one(SCAN)
    assert (reading.role, identity_of(reading), reading.bsic) == (
        "scan",
        ("310", "260", 0x0113, 0xCF00),
        0x2C,
    )
    assert (reading.arfcn, reading.arfcn_raw, reading.rxlev_raw, reading.rssi_dbm) == (
        685,
        1709,
        53,
        None,
    )


def test_short_scan_line_has_no_lac():
    assert identity_of(one(SCAN[: SCAN.index(",Lac")])) == ("310", "260", None, 0xCF00)


# --- unknown values


@pytest.mark.parametrize(
    ("row", "channel", "rxl"),
    [
        ('+CENG: 3,"0233,26,00,,,0000"', 233, 26),
        ('+CENG: 3,"0233,26,00,ffff,,,0000"', 233, 26),
        ('+CENG:6,"0727,06,127,ffff,000,00,0"', 727, 6),
        ('+CENG: 3,"0233,00,00,0000,000,00,0000"', 233, 0),
        ('+CENG: 0,"0031,12,00,000,00,00,0000,00,00,0000,255"', 31, 12),
    ],
)
def test_undecoded_cell_keeps_its_level(row, channel, rxl):
    reading = one(row)
    assert (identity_of(reading), reading.cell) == (NO_IDENTITY, None)
    assert (reading.arfcn, reading.rxlev_raw, reading.bsic) == (channel, rxl, None)


@pytest.mark.parametrize(
    "row",
    [
        '+CENG: 2,",,0000,0000,00,00"',
        '+CENG: 6,"000,00,0,0,00,00"',
        '+CENG: 5,"310,260,0000,0000,00,00"',
        '+CENG: 6,"0000,00,00,,,0000"',
        '+CENG: 6,",,,,,,"',
        '+CENG: 6,"0000,00,00,ffff,000,00,0"',
        '+CENG: 6,""',
        "+CENG: 3,0",
        "+CENG: 1,1",
    ],
)
def test_empty_slot_is_no_cell(row):
    assert one(row) is None


def test_test_network_is_a_network():
    assert one(NEIGHBOUR.replace("310,260", "001,01")).cell == "001-01-275-42303"


def test_networks_and_ids_that_look_like_fillers():
    assert one('+CENG: 1,"0030,16,25,00ff,460,00,0f00"').cell == "460-00-3840-255"
    assert one('+CENG: 1,"0030,16,25,127,255,06,75"').cell == "255-06-117-295"


@pytest.mark.parametrize(
    ("text", "bsic"), [("00", 0), ("63", 63), ("64", None), ("127", None), ("156", None)]
)
def test_bsic(text, bsic):
    assert one(NEIGHBOUR.replace(",25,", f",{text},")).bsic == bsic


@pytest.mark.parametrize(
    ("text", "bsic"), [("3F", 63), ("40", None), ("FF", None), ("08", 8), ("5", None), ("", None)]
)
def test_bsic_of_a_scan_is_hexadecimal(text, bsic):
    assert one(SCAN.replace("Bsic:2C", f"Bsic:{text}")).bsic == bsic


@pytest.mark.parametrize(
    ("text", "ta"), [("0", 0), ("63", 63), ("64", None), ("255", None), ("x", None), ("", None)]
)
def test_timing_advance(text, ta):
    assert one(SERVING.replace("255", text)).ta == ta


@pytest.mark.parametrize(("text", "rxq"), [("00", 0), ("07", 7), ("08", None), ("99", None)])
def test_quality(text, rxq):
    assert one(SERVING.replace(",28,00,", f",28,{text},")).rxq == rxq


@pytest.mark.parametrize(
    ("text", "dbm"), [("00", -113.0), ("63", -50.0), ("64", -49.0), ("99", None)]
)
def test_level(text, dbm):
    assert one(NEIGHBOUR.replace(",16,", f",{text},")).rssi_dbm == dbm


@pytest.mark.parametrize(
    ("printed", "arfcn"),
    [("0000", 0), ("0037", 37), ("1023", 1023), ("1536", 512), ("1834", 810), ("1100", None)],
)
def test_channel(printed, arfcn):
    reading = one(NEIGHBOUR.replace("1688", printed))
    assert (reading.arfcn, reading.arfcn_raw) == (arfcn, int(printed))
