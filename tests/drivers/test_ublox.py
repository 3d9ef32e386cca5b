import pytest

from logger.drivers.reading.row_language import NoCell, as_json
from logger.drivers.ublox import Ublox
from tests.kit.corpus import check_entry, entries, lines_of
from tests.kit.drivers import cells_of, identity_of

MODEM = Ublox()

# Values of our own in the layouts of firmware_notes/ublox.md.
SCAN_2G = "MCC:262, MNC:01, LAC:3c4d, CI:5e6f, BSIC:31, Arfcn:00067, RXLEV:023"

SCAN_3G = (
    "MCC:262, MNC:02, LAC:1d2e, RAC:12, CI:3f4a5b6, DLF:10713,"
    " ULF: 9763, SC:117, RSCP LEV:38, ECN0 LEV:30"
)

SCAN_LTE = (
    "MCC:262, MNC:03, TAC:4e5f, CI:2d3c4b5, DLF: 1444, ULF:19444, PCI:303, RSRP LEV:41, RSRQ LEV:7"
)

CELLINFO_2G = "+UCELLINFO: 0,0,  262,   11, 3c4d,    5e6f,  29, 255, 255, 255"

CELLINFO_3G = "+UCELLINFO: 1,     2,  262,   12, 1d2e, 3f4a5b6, 117, 10713, 44, 31"

R5 = [
    "+UCGED: 2",
    "6,4,001,01",
    "1444,3,50,50,4e5f,2d3c4b5,303,a1b2c3d4,8001,01,35,27,11.25,2,1,8,20,-40,-4,0,255,255,0",
]

R422 = ["+UCGED: 2", "6,262,03", '1444,3,15,15,4e60,305,-92,-12,118,-1,3,255,128,"0A1B2C3D"']

R6_2G = ["+UCGED: 2", "2,262,01", "1002,0,5e6f,31,3c4d,00,29,-1,27,27,1,1"]

R6_3G = ["+UCGED: 2", "3,4,001,01", "10713,1,3f4a5b6,1d2e,80,117,4,58,31,255"]

ENVIRONMENT_3G = [
    '+CGED: RAT:"UMTS",',
    "Mcc:262, Mnc:  3, Lac:2d3e, Ci:4a5b6c7, DLF:10713 , ULF:9763",
]

ENVIRONMENT_2G = [
    "Service-Cell:",
    "MCC:262, MNC:01, LAC:3c4d, CI:5e6f, BSIC:31",
    "Arfcn:33472, RxLevServ:035, RxLevFull:255",
    "Equivalent PLMNs:",
    "Mcc:262, Mnc:02",
    "Neighbour Cell 1:",
    "MCC:262, MNC:01, LAC:3c4e, CI:ffff, BSIC:30, Arfcn:00671, RxLev:018",
    "Neighbour Cell 2:",
    "MCC:65535, MNC:65535, LAC:ffff, CI:ffff, BSIC:ff, Arfcn:00688, RxLev:007",
]

ALL = [
    [SCAN_2G],
    [SCAN_3G],
    [SCAN_LTE],
    [CELLINFO_2G],
    [CELLINFO_3G],
    R5,
    R422,
    R6_2G,
    R6_3G,
    ENVIRONMENT_3G,
]


def cells(lines):
    return cells_of(MODEM, lines)


def one(*lines):
    (row,) = MODEM.read(lines)
    return row


@pytest.mark.parametrize(
    "dialect", ["ublox_cops5", "ublox_cged", "ublox_ucellinfo", "ublox_ucged", "ublox_log"]
)
def test_real_replies(corpus, dialect):
    found = entries(corpus, dialect)
    assert found
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


# --- AT+COPS=5


def test_scan():
    gsm, umts, lte = cells([SCAN_2G, SCAN_3G, SCAN_LTE])
    assert (gsm.role, gsm.rat, identity_of(gsm), gsm.arfcn) == (
        "scan",
        "GSM",
        ("262", "01", 0x3C4D, 0x5E6F),
        67,
    )
    assert (umts.rat, identity_of(umts), umts.arfcn, umts.psc) == (
        "WCDMA",
        ("262", "02", 0x1D2E, 0x3F4A5B6),
        10713,
        117,
    )
    assert umts.more == {"rscp_raw": 38, "ecn0_raw": 30}
    assert (lte.rat, identity_of(lte), lte.arfcn, lte.pci) == (
        "LTE",
        ("262", "03", 0x4E5F, 0x2D3C4B5),
        1444,
        303,
    )
    assert (lte.rsrp_dbm, lte.rsrq_db, lte.more) == (-100, -16.5, {"rsrp_raw": 41, "rsrq_raw": 7})


def test_scan_keeps_what_has_no_known_base_as_printed():
    row = one(SCAN_2G)
    assert (row.bsic, row.rxlev_raw, row.level_dbm) == (None, None, None)
    assert row.more == {"bsic_text": "31", "rxlev_text": "023"}


@pytest.mark.parametrize(
    ("line", "cid"),
    [(SCAN_2G.replace("5e6f", "ffff"), None), (SCAN_3G.replace("3f4a5b6", "fffffff"), None)],
)
def test_cell_that_is_not_known(line, cid):
    assert one(line).cid is cid
    assert one(line).lac is not None


def test_cell_of_lte_is_read_where_a_letter_shows_its_base():
    decimal = SCAN_LTE.replace("2d3c4b5", "4743288")
    assert one(decimal).cid is None
    assert one(decimal).tac == 0x4E5F
    assert [row.cid for row in cells([SCAN_LTE, decimal])] == [0x2D3C4B5, 0x4743288]
    assert [row.cid for row in cells([decimal, SCAN_LTE.replace("2d3c4b5", "fffffff")])] == [
        None,
        None,
    ]


def test_uplink_channels_of_the_bands_above_64_have_six_digits():
    row = one(SCAN_LTE.replace("DLF: 1444, ULF:19444", "DLF:68611, ULF:133147"))  # band 71
    assert (row.cell, row.arfcn, row.pci, row.rsrp_dbm) == (one(SCAN_LTE).cell, 68611, 303, -100.0)


def test_scan_in_a_log():
    lines = [
        f"0000004711 [app] INFO: {SCAN_2G}\\r\\n",
        "0000004712 [app] INFO: \\r\\n",
        f"{SCAN_3G}\\r\\n{SCAN_2G}",
    ]
    assert [row.rat for row in cells(lines)] == ["GSM", "WCDMA", "GSM"]
    assert identity_of(cells([SCAN_2G.lower()])[0]) == identity_of(one(SCAN_2G))


# --- +UCELLINFO


def test_cellinfo():
    gsm, umts = cells([CELLINFO_2G, CELLINFO_3G])
    assert (gsm.role, gsm.rat, identity_of(gsm), gsm.rxlev_raw) == (
        "serving",
        "GSM",
        ("262", "11", 0x3C4D, 0x5E6F),
        29,
    )
    assert (umts.rat, identity_of(umts), umts.psc, umts.arfcn) == (
        "WCDMA",
        ("262", "12", 0x1D2E, 0x3F4A5B6),
        117,
        10713,
    )
    assert umts.more == {"rscp_raw": 44, "ecn0_raw": 31}


@pytest.mark.parametrize(("kind", "role"), [("0", "serving"), ("1", "neighbour")])
def test_cellinfo_types_of_2g(kind, role):
    assert one(CELLINFO_2G.replace("0,0", f"0,{kind}")).role == role


@pytest.mark.parametrize(("kind", "role"), [("2", "serving"), ("3", "neighbour")])
def test_cellinfo_types_of_3g(kind, role):
    assert one(CELLINFO_3G.replace("     2,", f"     {kind},")).role == role


def test_cellinfo_that_is_unknown_or_cut_or_of_a_type_without_layout():
    assert MODEM.read(["+UCELLINFO: 0,0,65535,65535,ffff,ffff,255"]) == (NoCell("GSM"),)
    assert MODEM.read(["+UCELLINFO: 0,1,FFFF,FFFF,ffff,ffff,255"]) == ()
    assert MODEM.read([CELLINFO_3G[: CELLINFO_3G.index(", 44")]]) == ()
    for kind in (4, 5):  # of LTE: a row of WCDMA would be one of another cell
        assert MODEM.read([f"+UCELLINFO: 0,{kind},262,03,4e5f,2d3c4b5,303,1444,41,7"]) == ()
    umts = one("+UCELLINFO: 1,3,262,12,1d2e,fffffff,117,10713,255,255")
    assert (identity_of(umts), umts.psc, umts.more) == (
        ("262", "12", 0x1D2E, None),
        117,
        {"rscp_raw": None, "ecn0_raw": None},
    )


# --- +CGED


def test_environment_of_3g():
    row = one(*ENVIRONMENT_3G)
    assert (row.role, row.rat, row.arfcn) == ("serving", "WCDMA", 10713)
    assert (identity_of(row), row.more) == (("262", None, 0x2D3E, 0x4A5B6C7), {"mnc_raw": 3})


def test_environment_of_2g():
    serving, first, second = cells(ENVIRONMENT_2G)
    assert (serving.role, serving.rat, identity_of(serving)) == (
        "serving",
        "GSM",
        ("262", "01", 0x3C4D, 0x5E6F),
    )
    assert (serving.arfcn, serving.arfcn_raw, serving.rxlev_raw) == (704, 33472, 35)
    assert (first.role, identity_of(first), first.arfcn, first.rxlev_raw) == (
        "neighbour",
        ("262", "01", 0x3C4E, None),
        671,
        18,
    )
    assert (identity_of(second), second.arfcn) == ((None, None, None, None), 688)


def test_dump_has_no_cell_in_empty_slots_and_in_those_not_measured():
    lines = [
        '+CGED: RAT:"UMTS",',
        "Cell-ID:4a5b6c7, DLF:10713, ULF: 9763, SC:41, RSCP LEV:44, ECN0 LEV:40, C:0, D:0, PSM: 0",
        "Cell:G, B:- Arfcn:- RXLEV:- Bsic:- RV:-,",
        "Cell:G, B:D, Arfcn:703, RXLEV:28, Bsic:12, RV:1,",
        "Cell:U, SC:42, RSCP LEV:39, ECN0 LEV:36, DLF:10688, RV:1,",
        "Cell:NU, SC:9, RSCP LEV:0, ECN0 LEV:0, DLF:10713, RS:6,",
        "Cell:NG, B:, Arfcn:12, RXLEV:0, Bsic:30, RS:1",
        "Serving PLMN:",
        "Mcc:262, Mnc:  3, Lac:2d3e, RAC:  1 ",
        "OK",
    ]
    rows = cells(lines)
    assert [(row.role, row.rat, row.cid, row.arfcn) for row in rows] == [
        ("serving", "WCDMA", 0x4A5B6C7, 10713),
        ("neighbour", "GSM", None, 703),
        ("neighbour", "WCDMA", None, 10688),
    ]


def test_scan_after_an_environment_is_a_scan():
    assert [row.role for row in cells([*ENVIRONMENT_3G, "OK", SCAN_2G])] == ["serving", "scan"]
    assert [row.role for row in cells([*ENVIRONMENT_3G, "AT+COPS=5", SCAN_2G])] == [
        "serving",
        "scan",
    ]


# --- damage


def identities(rows):
    return {
        (name, value)
        for row in rows
        for name in ("mcc", "mnc", "lac", "tac", "cid")
        if (value := getattr(row, name))
    }


@pytest.mark.parametrize("lines", ALL)
def test_cut_reply_names_no_other_cell(lines):
    text = "\n".join(lines)
    whole = identities(cells(lines))
    for end in range(len(text)):
        # the last number of a line may be one that is cut; no row ends with one that names a cell
        assert identities(cells(text[:end].split("\n"))) <= whole, text[:end]


def test_a_cell_whose_heading_is_lost_is_no_second_serving_cell():
    # written after the SARA-G3 manual's form of +CGED=5; a line that nobody asked for takes the
    # heading of the neighbour
    lines = [
        "+CGED: Service Cell:",
        "MCC:262, MNC:02, LAC:1a2b, CI:3c4d, BSIC:18",
        "Arfcn:00033, RxLevServ:048",
        "Neigh",
        "bour Cell 1:",
        "MCC:262, MNC:02, LAC:1a2b, CI:3c4e, BSIC:19",
        "Arfcn:00045, RxLev:035",
    ]
    cells = [(row.role, row.cid) for row in MODEM.read(lines)]
    assert cells == [("serving", 0x3C4D), ("neighbour", 0x3C4E)]
