import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.rows import NoCell, as_json
from logger.drivers.ublox import Ublox
from tests.kit.corpus import check_entry, entries, lines_of

MODEM = Ublox()

# layouts of the captures and of u-blox's ubxlib, with values of our own where nothing else is said
SCAN_2G = "MCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24, Arfcn:00594, RXLEV:017"
SCAN_3G = "MCC:310, MNC:410, LAC:2cf7, RAC:65, CI:8a5a782, DLF: 4384, ULF: 4159, SC:26, RSCP LEV:32, ECN0 LEV:32"
SCAN_LTE = "MCC:222, MNC:88, TAC:562c, CI:36b5a03, DLF: 1325, ULF:19325, PCI:163, RSRP LEV:25, RSRQ LEV:1"
CELLINFO_2G = "+UCELLINFO: 0,0,  222,   10, d5bd,    5265,  36, 255, 255, 255"
CELLINFO_3G = "+UCELLINFO: 1,     2,  310,  410, 7f05, 57b14e2, 395, 1032, 46, 42"
R5 = [
    "+UCGED: 2",
    "6,4,001,01",
    "2525,5,50,50,e8fe,1a2d001,1,d60814d1,8001,01,28,31,13.75,3,1,10,28,-50,-6,0,255,255,0",
]
R422 = ["+UCGED: 2", "6,310,410", '5110,12,10,10,830e,162,-86,-14,131,-1,3,255,128,"FB306E02"']
R6_2G = ["+UCGED: 2", "2,222,01", "1009,0,5265,11,d5bd,00,36,-1,30,30,1,1"]
R6_3G = ["+UCGED: 2", "3,4,001,01", "4400,5,0a1b2c3,00fd,80,9,4,62,42,255"]
ENVIRONMENT_3G = ['+CGED: RAT:"UMTS",', "Mcc:262, Mnc:  2, Lac:1c96, Ci:bcf4e8d, DLF:10612 , ULF:9662"]
ENVIRONMENT_2G = [
    "Service-Cell:",
    "MCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24",
    "Arfcn:33485, RxLevServ:039, RxLevFull:255",
    "Equivalent PLMNs:",
    "Mcc:310, Mnc:410",
    "Neighbour Cell 1:",
    "MCC:310, MNC:260, LAC:ab23, CI:ffff, BSIC:23, Arfcn:00596, RxLev:012",
    "Neighbour Cell 2:",
    "MCC:65535, MNC:65535, LAC:ffff, CI:ffff, BSIC:ff, Arfcn:00600, RxLev:005",
]
ALL = [[SCAN_2G], [SCAN_3G], [SCAN_LTE], [CELLINFO_2G], [CELLINFO_3G], R5, R422, R6_2G, R6_3G, ENVIRONMENT_3G]
ALL += [ENVIRONMENT_2G]


def cells(lines):
    return [row for row in MODEM.read(lines) if isinstance(row, CellReading)]


def one(*lines):
    (row,) = MODEM.read(lines)
    return row


def who(reading):
    return reading.mcc, reading.mnc, reading.tac if reading.lac is None else reading.lac, reading.cid


@pytest.mark.parametrize("dialect", ["ublox_cops5", "ublox_cged", "ublox_ucellinfo", "ublox_ucged", "ublox_log"])
def test_real_replies(corpus, dialect):
    found = entries(corpus, dialect)
    assert found
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


# --- AT+COPS=5


def test_scan():
    gsm, umts, lte = cells([SCAN_2G, SCAN_3G, SCAN_LTE])
    assert (gsm.role, gsm.rat, who(gsm), gsm.arfcn) == ("scan", "GSM", ("310", "260", 0xAB22, 0xB633), 594)
    assert (umts.rat, who(umts), umts.arfcn, umts.psc) == ("WCDMA", ("310", "410", 0x2CF7, 0x8A5A782), 4384, 26)
    assert umts.more == {"rscp_raw": 32, "ecn0_raw": 32}
    assert (lte.rat, who(lte), lte.arfcn, lte.pci) == ("LTE", ("222", "88", 0x562C, 0x36B5A03), 1325, 163)
    assert (lte.rsrp_dbm, lte.rsrq_db, lte.more) == (-116, -19.5, {"rsrp_raw": 25, "rsrq_raw": 1})


def test_scan_keeps_what_has_no_known_base_as_printed():
    row = one(SCAN_2G)
    assert (row.bsic, row.rxlev_raw, row.level_dbm) == (None, None, None)
    assert row.more == {"bsic_text": "24", "rxlev_text": "017"}


@pytest.mark.parametrize(
    ("line", "cid"), [(SCAN_2G.replace("b633", "ffff"), None), (SCAN_3G.replace("8a5a782", "fffffff"), None)]
)
def test_cell_that_is_not_known(line, cid):
    assert one(line).cid is cid
    assert one(line).lac is not None


def test_cell_of_lte_is_read_where_a_letter_shows_its_base():
    decimal = SCAN_LTE.replace("36b5a03", "5736704")
    assert one(decimal).cid is None
    assert one(decimal).tac == 0x562C
    assert [row.cid for row in cells([SCAN_LTE, decimal])] == [0x36B5A03, 0x5736704]
    assert [row.cid for row in cells([decimal, SCAN_LTE.replace("36b5a03", "fffffff")])] == [None, None]


def test_scan_in_a_log():
    lines = [f"0000031841 [app] INFO: {SCAN_2G}\\r\\n", "0000012867 [app] INFO: \\r\\n", f"{SCAN_3G}\\r\\n{SCAN_2G}"]
    assert [row.rat for row in cells(lines)] == ["GSM", "WCDMA", "GSM"]
    assert who(cells([SCAN_2G.lower()])[0]) == who(one(SCAN_2G))


# --- +UCELLINFO


def test_cellinfo():
    gsm, umts = cells([CELLINFO_2G, CELLINFO_3G])
    assert (gsm.role, gsm.rat, who(gsm), gsm.rxlev_raw) == ("serving", "GSM", ("222", "10", 0xD5BD, 0x5265), 36)
    assert (umts.rat, who(umts), umts.psc, umts.arfcn) == ("WCDMA", ("310", "410", 0x7F05, 0x57B14E2), 395, 1032)
    assert umts.more == {"rscp_raw": 46, "ecn0_raw": 42}


@pytest.mark.parametrize(("kind", "role"), [("0", "serving"), ("1", "neighbour")])
def test_cellinfo_types_of_2g(kind, role):
    assert one(CELLINFO_2G.replace("0,0", f"0,{kind}")).role == role


@pytest.mark.parametrize(("kind", "role"), [("2", "serving"), ("3", "neighbour"), ("4", "neighbour")])
def test_cellinfo_types_of_3g(kind, role):
    assert one(CELLINFO_3G.replace("     2,", f"     {kind},")).role == role


def test_cellinfo_that_is_unknown_or_cut_or_of_a_type_without_layout():
    assert MODEM.read(["+UCELLINFO: 0,0,65535,65535,ffff,ffff,255"]) == (NoCell("GSM"),)
    assert MODEM.read(["+UCELLINFO: 0,1,FFFF,FFFF,ffff,ffff,255"]) == ()
    assert MODEM.read([CELLINFO_3G[: CELLINFO_3G.index(", 46")]]) == ()
    assert MODEM.read(["+UCELLINFO: 0,5,222,10,562c,36b5a03,163,1325,25,1"]) == ()
    umts = one("+UCELLINFO: 1,3,310,410,7f05,fffffff,395,1032,255,255")
    assert (who(umts), umts.psc, umts.more) == (("310", "410", 0x7F05, None), 395, {"rscp_raw": None, "ecn0_raw": None})


# --- +UCGED


def test_ucged_of_the_models():
    r5, r422, gsm, umts = (one(*lines) for lines in (R5, R422, R6_2G, R6_3G))
    assert (r5.rat, who(r5), r5.band, r5.pci) == ("LTE", ("001", "01", 0xE8FE, 0x1A2D001), 5, 1)
    assert (r5.rsrp_dbm, r5.rsrq_db, r5.sinr_db) == (-113, -4.5, 13.75)
    assert (r422.rat, who(r422), r422.pci) == ("LTE", ("310", "410", 0x830E, None), 162)
    assert (r422.rsrp_dbm, r422.rsrq_db, r422.sinr_db, r422.more) == (-86, -14, None, {"sinr_raw": 131})
    assert (gsm.rat, who(gsm), gsm.rxlev_raw, gsm.ta) == ("GSM", ("222", "01", 0xD5BD, 0x5265), 36, None)
    assert (umts.rat, who(umts), umts.psc, umts.rssi_dbm) == ("WCDMA", ("001", "01", 0xFD, 0xA1B2C3), 9, -38)


def test_ucged_without_a_cell():
    lines = ["+UCGED: 2", "6,2,fff ,fff ", "65535,255,255,255,ffff,0000000,65535,00000000,ffff,ff,255 ,255 ,255,1,255"]
    assert MODEM.read(lines) == (NoCell("LTE"),)


def test_ucged_of_a_cell_without_a_network():
    row = one("+UCGED: 2", "6,2,fff,fff", R5[2])
    assert (who(row), row.arfcn, row.rsrp_dbm) == ((None, None, None, None), 2525, -113)


@pytest.mark.parametrize(
    "lines", [R5[1:], [R5[0], R5[2]], R5[:2], [*R5[:2], "OK", R5[2]], [*R5[:2], R422[2]], R5[::-1]]
)
def test_ucged_that_is_not_whole(lines):
    assert cells(lines) == []


def test_ucged_line_after_line_in_a_log():
    lines = [f"     5.297 AT read  +   20 {line}\\r\\n" for line in ["", R5[0], "", *R5[1:], "OK", *R422]]
    assert [row.pci for row in cells(lines)] == [1, 162]


def test_levels_of_a_sara_r4():
    rows = cells(['+RSRP: 162,5110,"-86.10",163,5110,"-90.00",', '+RSRQ: 162,5110,"-10.20"'])
    assert [(row.role, row.pci, row.arfcn, row.rsrp_dbm, row.rsrq_db) for row in rows] == [
        ("serving", 162, 5110, -86.1, -10.2),
        ("neighbour", 163, 5110, -90.0, None),
    ]


# --- +CGED


def test_environment_of_3g():
    row = one(*ENVIRONMENT_3G)
    assert (row.role, row.rat, row.arfcn) == ("serving", "WCDMA", 10612)
    assert (who(row), row.more) == (("262", None, 0x1C96, 0xBCF4E8D), {"mnc_raw": 2})


def test_environment_of_2g():
    serving, first, second = cells(ENVIRONMENT_2G)
    assert (serving.role, serving.rat, who(serving)) == ("serving", "GSM", ("310", "260", 0xAB22, 0xB633))
    assert (serving.arfcn, serving.arfcn_raw, serving.rxlev_raw) == (33485 - 0x8000, 33485, 39)
    assert (first.role, who(first), first.arfcn, first.rxlev_raw) == (
        "neighbour",
        ("310", "260", 0xAB23, None),
        596,
        12,
    )
    assert (who(second), second.arfcn) == ((None, None, None, None), 600)


def test_dump_has_no_cell_in_empty_slots_and_in_those_not_measured():
    lines = [
        '+CGED: RAT:"UMTS",',
        "Cell-ID:bcf4e8d, DLF:10612, ULF: 9662, SC:24, RSCP LEV:46, ECN0 LEV:42, C:0, D:0, PSM: 0",
        "Cell:G, B:- Arfcn:- RXLEV:- Bsic:- RV:-,",
        "Cell:G, B:D, Arfcn:700, RXLEV:30, Bsic:12, RV:1,",
        "Cell:U, SC:25, RSCP LEV:46, ECN0 LEV:41, DLF:10564, RV:65532,",
        "Cell:NU, SC:8, RSCP LEV:0, ECN0 LEV:0, DLF:10612, RS:6,",
        "Cell:NG, B:, Arfcn:9, RXLEV:0, Bsic:31, RS:1",
        "Serving PLMN:",
        "Mcc:262, Mnc:  2, Lac:1c96, RAC:  1 ",
        "OK",
    ]
    rows = cells(lines)
    assert [(row.role, row.rat, row.cid, row.arfcn) for row in rows] == [
        ("serving", "WCDMA", 0xBCF4E8D, 10612),
        ("neighbour", "GSM", None, 700),
        ("neighbour", "WCDMA", None, 10564),
    ]


def test_scan_after_an_environment_is_a_scan():
    assert [row.role for row in cells([*ENVIRONMENT_3G, "OK", SCAN_2G])] == ["serving", "scan"]
    assert [row.role for row in cells([*ENVIRONMENT_3G, "AT+COPS=5", SCAN_2G])] == ["serving", "scan"]


# --- damage


def identities(rows):
    return {
        (name, value) for row in rows for name in ("mcc", "mnc", "lac", "tac", "cid") if (value := getattr(row, name))
    }


@pytest.mark.parametrize("lines", ALL)
def test_cut_reply_names_no_other_cell(lines):
    text = "\n".join(lines)
    whole = identities(cells(lines))
    for end in range(len(text)):
        # the last number of a line may be one that is cut; no row ends with one that names a cell
        assert identities(cells(text[:end].split("\n"))) <= whole, text[:end]


def test_damage_raises_nothing_and_invents_no_identity():
    chance = random.Random(2)
    for _ in range(4000):
        text = damaged("\n".join("\n".join(lines) for lines in chance.sample(ALL, 3)), chance)
        tokens = re.findall(r"[0-9A-Fa-f]+", text)
        numbers = {int(token, base) for token in tokens for base in (10, 16) if base == 16 or token.isdecimal()}
        for name, value in identities(cells(text.split("\n"))):
            assert int(value) in numbers, (name, value, text)


def damaged(text, chance):
    for _ in range(chance.randint(1, 5)):
        at = chance.randrange(len(text))
        match chance.randrange(4):
            case 0:
                text = text[:at] + chr(ord(text[at]) ^ 1 << chance.randrange(8)) + text[at + 1 :]
            case 1:
                text = text[:at] + text[at + chance.randint(1, 20) :] or "x"
            case 2:
                text = text.replace("\n", "", 1)
            case _:
                text = (
                    text[:at] + chance.choice([",", ":", " ", "0", "F", "\n", '"', "+UCGED: 2\n", "\x00"]) + text[at:]
                )
    return text
