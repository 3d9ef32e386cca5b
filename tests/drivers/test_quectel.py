import re

import pytest

from logger.core.types import CellReading
from logger.drivers.quectel import Quectel
from logger.drivers.reading.row_language import Signal
from tests.kit.corpus import check_recorded
from tests.kit.drivers import NO_IDENTITY, cells_of, identity_of, only_cell_of

MODEM = Quectel()

# Values of our own in the layouts of the EC2x manual 6.17; WCDMA, SA, EN_DC and SHORT_SCAN are in
# the corpus.
GSM = (
    '+QENG: "servingcell","NOCONN","GSM",262,01,1A2B,3C4D,21,57,'
    '-,-66,255,255,0,39,41,1,-,-,-,-,-,-,-,-,-,"-"'
)

IN_CALL = (
    '+QENG: "servingcell","CONNECT","GSM",262,01,1A2B,3C4E,18,73,'
    '0,-71,5,12,3,0,0,0,h,1,5,0,31,40,41,0,0,"EFR"'
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

QOPS = ['+QOPS: "EXAMPLE NET","EXNET","26203"', '1,"2G",21,1A2D,3C50,14,25,22,0,1']

GSM_ON_GSM = '+QENG: "neighbourcell","GSM",262,01,1A2C,3C4F,27,61,-79,24,25,0,0'

GSM_ON_LTE = '+QENG: "neighbourcell","GSM",88,2,12,48,255,0,37,-810,18'

SCAN = '+QSCAN: "LTE",262,02,6300,77,-101,-10,15,15,1F2E3D4,5A6B,50,20'

SHORT_SCAN = '+QSCAN: "NR5G",310,260,501390,364,-104,-11,7,1'


@pytest.mark.parametrize(
    "dialect",
    [
        "qeng_lte",
        "qeng_lte_gsm",
        "qeng_lte_wcdma",
        "qeng_5g",
        "qscan",
        "qcsq",
        "registration",
        "qgpsloc",
    ],
)
def test_recorded_replies(corpus, dialect):
    check_recorded(corpus, MODEM, f"quectel_{dialect}")


def cells(*lines):
    return cells_of(MODEM, lines)


def one(*lines):
    return only_cell_of(MODEM, lines)


# --- forms


def test_gsm():
    assert one(GSM) == CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="01",
        lac=0x1A2B,
        cid=0x3C4D,
        arfcn=57,
        bsic=21,
        rssi_dbm=-66.0,
        c1=39,
        c2=41,
        more={"state": "NOCONN"},
    )
    assert one(IN_CALL).ta == 5


def test_gsm_level_as_an_index_as_the_manual_says():
    assert one(GSM.replace("-66", "30")).rssi_dbm == -81.0
    assert one(GSM.replace("-66", "-")).rssi_dbm is None


def test_wcdma():
    cell = one(WCDMA)
    assert (identity_of(cell), cell.arfcn, cell.psc) == (
        ("515", "03", 0x3AB2, 0xB55EEFF),
        3037,
        352,
    )
    assert (cell.rscp_dbm, cell.ecio_db) == (-94.0, -15.0)


def test_ids_of_digits_only_are_hexadecimal():
    assert identity_of(one(LTE)) == ("262", "01", 0xB2C, 0x314159)
    assert identity_of(one(LTE.replace("B2C", "1729"))) == ("262", "01", 0x1729, 0x314159)


@pytest.mark.parametrize(
    ("tail", "srxlev"),
    [("", None), (",21", 21), (",-", None), (",", None), (",7,50,33", 33), (",7,50", None)],
)
def test_end_of_an_lte_row(tail, srxlev):
    cell = one(LTE.removesuffix(",23") + tail)
    assert (cell.rsrp_dbm, cell.rsrq_db, cell.rssi_dbm) == (-97.0, -8.0, -70.0)
    assert cell.more == {"state": "NOCONN", "duplex": "FDD", "sinr_raw": 14, "srxlev": srxlev}


@pytest.mark.parametrize(
    ("word", "rat"),
    [
        ("LTE", "LTE"),
        ("CAT-M", "LTE-M"),
        ("CAT-M1", "LTE-M"),
        ("eMTC", "LTE-M"),
        ("NBIoT", "NB-IoT"),
        ("CAT-NB1", "NB-IoT"),
        ("NTN NBIoT", "NB-IoT"),
    ],
)
def test_words_for_a_technology(word, rat):
    assert one(LTE.replace('"LTE"', f'"{word}"')).rat == rat
    assert MODEM.read([f'+QCSQ: "{word}",-58,-84,172,-9']) == (
        Signal(rat, rssi_dbm=-58.0, rsrp_dbm=-84.0, rsrq_db=-9.0, more={"sinr_raw": 172}),
    )


def test_5g_alone():
    cell = one(SA)
    assert (cell.rat, cell.more["mode"], identity_of(cell)) == (
        "NR",
        "SA",
        ("460", "00", 0x46550B, 0x170C23000),
    )
    assert (cell.arfcn, cell.band, cell.rsrp_dbm, cell.rsrq_db) == (504990, 41, -54.0, -10.0)


def test_5g_beside_lte():
    lte, nr = cells(*EN_DC)
    assert (lte.cell, lte.more["state"]) == ("515-03-19107-53844326", "NOCONN")
    assert (nr.rat, nr.more["mode"], nr.pci, nr.rsrp_dbm, nr.rsrq_db) == (
        "NR",
        "NSA",
        832,
        -76.0,
        -11.0,
    )
    assert (nr.more["sinr_raw"], nr.arfcn, nr.band) == (21, 528030, 41)
    assert one('+QENG: "NR5G-NSA",515,03,832,-76,21,-11').rsrq_db == -11.0
    assert one('+QENG: "NR5G-NSA",262,03,65535,-32768,-32768,-32768') is None


def test_order_in_a_neighbour_row_follows_the_technology_camped_on():
    gsm = one(GSM_ON_GSM)
    assert (identity_of(gsm), gsm.bsic, gsm.arfcn, gsm.rssi_dbm) == (
        ("262", "01", 0x1A2C, 0x3C4F),
        27,
        61,
        -79.0,
    )
    for arfcn in (88, 262):  # the second could be a network code
        gsm = one(GSM_ON_LTE.replace('"GSM",88', f'"GSM",{arfcn}'))
        assert (identity_of(gsm), gsm.arfcn, gsm.bsic, gsm.rssi_dbm) == (
            NO_IDENTITY,
            arfcn,
            37,
            -81.0,
        )
    gsm = one('+QENG: "neighbourcell","GSM",45,-93,14,-6')
    assert (gsm.arfcn, gsm.bsic, gsm.rssi_dbm) == (None, 45, -93.0)


def test_a_row_of_lte_without_its_rsrq_keeps_its_rsrp():
    for unknown in ("-", "", "-32768"):
        cell = one(f'+QENG: "neighbourcell intra","LTE",1850,371,-104,{unknown},-72,-,-,-,-,-,-')
        assert (cell.rsrp_dbm, cell.rsrq_db, cell.rssi_dbm) == (-104.0, None, None)
    filled = one('+QENG: "neighbourcell intra","LTE",1850,371,0,-104,-72,0,20')
    assert (filled.rsrp_dbm, filled.rsrq_db) == (-104.0, None)


def test_numbers_that_mean_no_channel_and_no_cell():
    assert one(LTE.replace(",1300,", ",65535,")).arfcn is None
    for filler in ("FFFFFFF", "0x7FFFFFFF", "FFFFFFFF", "FFFFFFFFF"):
        assert one(SA.replace("170C23000", filler)).cid is None


@pytest.mark.parametrize("row", ["882,12,48,255,0,37,-1920,0", "23,4,12,48,255,0,37,-1920,0"])
def test_channel_and_priority_without_their_comma_are_no_network(row):
    found = cells(f'+QENG: "neighbourcell","GSM",{row}')
    assert [identity_of(cell) for cell in found] in ([], [NO_IDENTITY])


@pytest.mark.parametrize(
    "row",
    ["10663,5,12,60,219,-970,-80,21", "10663,-698,219,-970,-80,4,-32768,-", "10663,219,-97,-8"],
)
def test_wcdma_neighbour(row):
    cell = one(f'+QENG: "neighbourcell","WCDMA",{row}')
    assert (cell.arfcn, cell.psc, cell.rscp_dbm, cell.ecio_db) == (10663, 219, -97.0, -8.0)


@pytest.mark.parametrize(
    "row",
    [
        '"neighbourcell intra","LTE",800,310,-12,-116,-84,0,9,4,10,2,62',
        '"neighbourcell inter","LTE",800,310,-12,-116,-84,0,9,2,6,6',
        '"neighbourcell inter","LTE",800,310,-116,-12,9,0,2,6',  # Unisoc chip
        '"neighbourcell","LTE",800,310,-116,-12',
    ],
)
def test_lte_neighbour(row):
    cell = one(f"+QENG: {row}")
    assert (cell.role, cell.arfcn, cell.pci, cell.rsrp_dbm, cell.rsrq_db) == (
        "neighbour",
        800,
        310,
        -116.0,
        -12.0,
    )
    assert cell.more.get("kind") == (re.search("int(ra|er)", row) or [None])[0]


@pytest.mark.parametrize(
    "row",
    [
        '"neighbourcell inter","LTE",37900,-,-,-,-,-,-,0,22,6',
        '"neighbourcell inter","LTE",66986,-,-,-,-,-,0,6,6,1,-,-,-,-',
        '"neighbourcell","WCDMA",512,6,14,62,-,-,-,-',
        '"neighbourcell","WCDMA",512,6,14,0,-,-,-,-',
    ],
)
def test_frequency_without_a_cell(row):
    assert one(f"+QENG: {row}") is None


def test_gsm_channel_that_is_announced_but_not_received():
    cell = one('+QENG: "neighbourcell","GSM",88,2,12,48,255,0,0,-1920,0')
    assert (cell.arfcn, cell.bsic, cell.rssi_dbm) == (88, None, None)


def test_scan_of_a_5g_modem():
    cell = one(SCAN)
    assert (cell.role, identity_of(cell), cell.band) == (
        "scan",
        ("262", "02", 0x5A6B, 0x1F2E3D4),
        20,
    )
    cell = one(SHORT_SCAN)
    assert (identity_of(cell), cell.arfcn, cell.pci) == (("310", "260", None, None), 501390, 364)
    assert identity_of(one(SCAN.removesuffix(",5A6B,50,20"))) == ("262", "02", None, None)


def test_band_scan():
    gsm, lost, lte, umts = cells(
        *QOPS,
        '2,"2G",118,1A2D,3C51,33,77,1,0,1',
        '+QOPS: "OTHER NET","OTHER","26204"',
        '1,"4G",1850,118,2,2B3C4D5,-98,-11,-69,0',
        '2,"3G",10663,219,6B7C,4D5E6F7,-97,19,0',
    )
    assert (gsm.role, identity_of(gsm), gsm.arfcn, gsm.bsic) == (
        "scan",
        ("262", "03", 0x1A2D, 0x3C50),
        21,
        14,
    )
    assert (gsm.rxlev_raw, gsm.rssi_dbm, lost.rxlev_raw) == (25, None, None)
    assert (identity_of(lte), lte.pci, lte.rsrp_dbm) == (("262", "04", 2, 0x2B3C4D5), 118, -98.0)
    assert (identity_of(umts), umts.psc, umts.rscp_dbm) == (
        ("262", "04", 0x6B7C, 0x4D5E6F7),
        219,
        -97.0,
    )
    assert identity_of(one(QOPS[1])) == NO_IDENTITY


def test_levels():
    assert MODEM.read(['+QCSQ: "GSM",-67']) == (Signal("GSM", rssi_dbm=-67.0),)
    assert MODEM.read(['+QCSQ: "WCDMA",-72,-79,-7']) == (
        Signal("WCDMA", rssi_dbm=-72.0, rscp_dbm=-79.0, ecio_db=-7.0),
    )
    assert MODEM.read(['+QCSQ: "NR5G",-75,4,-11']) == (
        Signal("NR", rsrp_dbm=-75.0, rsrq_db=-11.0, more={"sinr_raw": 4}),
    )
    assert MODEM.read(['+QCSQ: "LTE",-71,-8']) == ()


@pytest.mark.parametrize("priority", ["2", "-", "", "255", "-32768"])
def test_a_cell_of_gsm_seen_from_lte_whose_priority_is_unknown_is_no_other_cell(priority):
    # written after the EC2x manual 6.17: arfcn, priority, thresholds, NCC, band, BSIC, tenths
    reading = one(f'+QENG: "neighbourcell","GSM",114,{priority},24,12,61,1,22,-750,20')
    assert (reading.mcc, reading.lac, reading.cid) == (None, None, None)
    assert (reading.arfcn, reading.bsic, reading.rssi_dbm) == (114, 22, -75.0)
