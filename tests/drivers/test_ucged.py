import pytest

from logger.drivers.reading.row_language import NoCell
from logger.drivers.ublox import Ublox
from tests.kit.drivers import cells_of, identity_of

MODEM = Ublox()

R5 = [
    "+UCGED: 2",
    "6,4,001,01",
    "1444,3,50,50,4e5f,2d3c4b5,303,a1b2c3d4,8001,01,35,27,11.25,2,1,8,20,-40,-4,0,255,255,0",
]

R422 = ["+UCGED: 2", "6,262,03", '1444,3,15,15,4e60,305,-92,-12,118,-1,3,255,128,"0A1B2C3D"']

R6_2G = ["+UCGED: 2", "2,262,01", "1002,0,5e6f,31,3c4d,00,29,-1,27,27,1,1"]

R6_3G = ["+UCGED: 2", "3,4,001,01", "10713,1,3f4a5b6,1d2e,80,117,4,58,31,255"]


def cells(lines):
    return cells_of(MODEM, lines)


def one(*lines):
    (row,) = MODEM.read(lines)
    return row


def test_ucged_of_the_models():
    r5, r422, gsm, umts = (one(*lines) for lines in (R5, R422, R6_2G, R6_3G))
    assert (r5.rat, identity_of(r5), r5.band, r5.pci) == (
        "LTE",
        ("001", "01", 0x4E5F, 0x2D3C4B5),
        3,
        303,
    )
    assert (r5.rsrp_dbm, r5.rsrq_db, r5.sinr_db) == (-106, -6.5, 11.25)
    assert (r422.rat, identity_of(r422), r422.pci) == ("LTE", ("262", "03", 0x4E60, None), 305)
    assert (r422.rsrp_dbm, r422.rsrq_db, r422.sinr_db, r422.more) == (
        -92,
        -12,
        None,
        {"sinr_raw": 118},
    )
    assert (gsm.rat, identity_of(gsm), gsm.rxlev_raw, gsm.ta) == (
        "GSM",
        ("262", "01", 0x3C4D, 0x5E6F),
        29,
        None,
    )
    assert (umts.rat, identity_of(umts), umts.psc, umts.rssi_dbm) == (
        "WCDMA",
        ("001", "01", 0x1D2E, 0x3F4A5B6),
        117,
        -42,
    )


@pytest.mark.parametrize(
    ("channel", "flag", "band"), [(700, 1, 1900), (700, 0, None), (1002, 1, None), (900, 0, None)]
)
def test_the_flag_of_the_1900_mhz_band(channel, flag, band):
    (row,) = MODEM.read([*R6_2G[:2], R6_2G[2].replace("1002,0", f"{channel},{flag}")])
    assert (row.arfcn, row.band) == (channel, band)


def test_ucged_without_a_cell():
    lines = [
        "+UCGED: 2",
        "6,2,fff ,fff ",
        "65535,255,255,255,ffff,0000000,65535,00000000,ffff,ff,255 ,255 ,255,1,255",
    ]
    assert MODEM.read(lines) == (NoCell("LTE"),)


def test_ucged_of_a_cell_without_a_network():
    row = one("+UCGED: 2", "6,2,fff,fff", R5[2])
    assert (identity_of(row), row.arfcn, row.rsrp_dbm) == ((None, None, None, None), 1444, -106)


@pytest.mark.parametrize(
    "lines", [R5[1:], [R5[0], R5[2]], R5[:2], [*R5[:2], "OK", R5[2]], [*R5[:2], R422[2]], R5[::-1]]
)
def test_ucged_that_is_not_complete(lines):
    assert cells(lines) == []


def test_ucged_line_after_line_in_a_log():
    lines = [
        f"    12.345 AT read  +   20 {line}\\r\\n" for line in ["", R5[0], "", *R5[1:], "OK", *R422]
    ]
    assert [row.pci for row in cells(lines)] == [303, 305]


def test_levels_of_a_sara_r4():
    rows = cells(['+RSRP: 303,1444,"-91.20",305,1444,"-97.50",', '+RSRQ: 303,1444,"-11.40"'])
    assert [(row.role, row.pci, row.arfcn, row.rsrp_dbm, row.rsrq_db) for row in rows] == [
        ("serving", 303, 1444, -91.2, -11.4),
        ("neighbour", 305, 1444, -97.5, None),
    ]
