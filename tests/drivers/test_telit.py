import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.rows import NoCell, as_json
from logger.drivers.telit import Telit
from tests.kit.corpus import check_entry, entries, lines_of

MODEM = Telit()

# forms of the GM862, HE863 and LE910 manuals with values of our own
SERVING = "#MONI: S 73 D5BD 5265 736 -83dbm 19 33 1 0 I WIND"
NEIGHBOUR = "#MONI: N1 75 55FA 1297 983 -78dbm 26 20"
LABELLED = "#MONI: Cc:222 Nc:01 BSIC:73 RxQual:0 LAC:D5BD Id:5265 ARFCN:1009 PWR:-73dbm TA:0"
UMTS = "#MONI: vodafone IT PSC:295 RSCP:-86 LAC:5460 Id:12C9A2F EcIo:-5.0 UARFCN:10638 PWR:-80 dBm DRX:64 SCR:4720"
LTE = "#MONI: I WIND RSRP:-95 RSRQ:-10 TAC:562C Id:36B5A03 EARFCN:1325 PWR:-66dbm DRX:128"
SERVINFO = '#SERVINFO: 42,-93,"Cell, One","28601",63,855E,03,1,,"II",01,6'
SERVINFO_UMTS = '#SERVINFO: 10638,-80,"I WIND","22288",295,55FA,64,3,-86,"II",30'
SERVINFO_LTE = '#SERVINFO: 66786,-68,"T-Mobile","310 260",3089F02,2D18,640,3,-101'
SURVEYED = (
    "arfcn: 48 bsic: 24 rxLev: -52 ber: 0.00 mcc: 610 mnc: 1 lac: 33281 cellId: 3648 cellStatus: CELL_SUITABLE "
    "numArfcn: 2 arfcn: 30 49 numChannels: 3 array: 14 19 22 pbcch: 0 mstxpwr: 5 rxaccmin: 4"
)
SURVEYED_HEX = SURVEYED.replace("33281", "8201").replace("3648", "0E40").replace("bsic: 24", "bsic: 74")
CSV = "1018,21,-73,0,222,01,54717,14887,CELL_SUITABLE,0"
CSV_UMTS = "10638,-87,222,88,295,1231231,54600,0,-90,-3"
CSV_LTE = "66786,-68,310,260,50896642,11544,236,0,-103,-15,20"
ALL = [SERVING, NEIGHBOUR, LABELLED, UMTS, LTE, SERVINFO, SERVINFO_UMTS, SERVINFO_LTE, SURVEYED, SURVEYED_HEX]
ALL += [CSV, CSV_UMTS, CSV_LTE]


def cells(*lines):
    return [row for row in MODEM.read(lines) if isinstance(row, CellReading)]


def one(*lines):
    (row,) = MODEM.read(lines)
    return row


def who(reading):
    return reading.mcc, reading.mnc, reading.tac if reading.lac is None else reading.lac, reading.cid


NOBODY = (None, None, None, None)


@pytest.mark.parametrize("dialect", ["telit_moni", "telit_servinfo", "telit_csurv", "telit_lte"])
def test_real_replies(corpus, dialect):
    found = entries(corpus, dialect)
    assert found
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


# --- AT#MONI


def test_table():
    operator = {"operator": "I WIND"}
    assert one(SERVING) == CellReading(
        "serving", "GSM", lac=0xD5BD, cid=0x5265, arfcn=736, bsic=59, rssi_dbm=-83, rxq=0, c1=19, c2=33, more=operator
    )
    assert one(NEIGHBOUR) == CellReading(
        "neighbour", "GSM", lac=0x55FA, cid=0x1297, arfcn=983, bsic=61, rssi_dbm=-78.0, c1=26, c2=20
    )


def test_cell_that_is_heard_and_not_decoded_keeps_its_level():
    row = one("#MONI: N2 FF FFFF 0000 685 -79dbm -1 -1;")
    assert (who(row), row.bsic, row.arfcn, row.rssi_dbm, row.c1) == (NOBODY, None, 685, -79.0, None)


@pytest.mark.parametrize(
    "line",
    [
        "#MONI: N3 FF FFFF 0000 1024 -111dbm -1 -1",
        "#MONI: Cell BSIC LAC CellId ARFCN Power C1 C2 TA RxQual PLMN",
        "#MONI: (7,0)",
        "#MONI: BSIC:FF RxQual:7 LAC:FFFF Id:0000 ARFCN:1024 PWR:-111dbm TA:0",
        "#MONI: ",
    ],
)
def test_no_cell_in_an_empty_slot_or_a_head(line):
    assert MODEM.read([line]) == ()


def test_labels_of_the_three_technologies():
    gsm = one(LABELLED)
    assert (who(gsm), gsm.bsic, gsm.arfcn, gsm.rssi_dbm, gsm.ta) == (("222", "01", 0xD5BD, 0x5265), 59, 1009, -73, None)
    umts = one(UMTS)
    assert (umts.rat, who(umts), umts.psc, umts.arfcn) == ("WCDMA", (None, None, 0x5460, 0x12C9A2F), 295, 10638)
    assert (umts.rscp_dbm, umts.ecio_db, umts.rssi_dbm, umts.more["operator"]) == (-86, -5, -80, "vodafone IT")
    lte = one(LTE)
    assert (lte.rat, lte.tac, lte.cid, lte.arfcn, lte.rsrp_dbm, lte.pci) == ("LTE", 0x562C, 0x36B5A03, 1325, -95, None)


def test_cells_beside_the_serving_one():
    rows = cells(
        "#MONI: Adj Cell3 LAC:D5BD Id:5266 ARFCN:1010 PWR:-83 dBm",
        "#MONI: Adj Cell 4 ARFCN:1011 PWR:-84dBm",
        "#MONI: PSC:295 RSCP:-86 EcIo:-5 UARFCN:10638 SCR:33",
        "#MONI: RSRP:-107 RSRQ:-18 Id:0000142 EARFCN:66786 PWR:-79dbm",
    )
    assert [row.role for row in rows] == ["neighbour"] * 4
    assert [row.cid for row in rows] == [0x5266, None, None, None]
    assert rows[3].pci == 0x142
    assert all("operator" not in row.more for row in rows)


@pytest.mark.parametrize("text", ["00000AF", "00001F7"])
def test_what_may_be_the_physical_identity_is_no_cell_identity(text):
    assert one(LTE.replace("36B5A03", text)).cid is None
    assert one(SERVINFO_LTE.replace("3089F02", text)).cid is None


@pytest.mark.parametrize(("line", "lac", "cid"), [("LAC:8AD3", 0x8AD3, None), ("LAC:8AD3 ", 0x8AD3, None)])
def test_line_that_its_author_has_broken(line, lac, cid):
    row = one("#MONI: Cingular BSIC:51 RxQual:0 " + line)
    assert (row.role, row.bsic, row.lac, row.cid) == ("serving", 41, lac, cid)
    assert MODEM.read(["#MONI: Cingular BSIC:51 RxQual:0 LAC:8AD"]) == ()


def test_rows_in_a_log():
    rows = cells(f"12:00:01,5 <- {SERVING}\\r\\n{NEIGHBOUR}\\r\\n", f"> {SERVINFO.replace(chr(34), chr(92) + chr(34))}")
    assert [row.role for row in rows] == ["serving", "neighbour", "serving"]
    assert rows[0].more == {"operator": "I WIND"}
    assert rows[2].more == {"operator": "Cell, One", "plmn": "28601"}
    assert cells(SERVING.lower())[0].cid == 0x5265


# --- AT#SERVINFO


def test_servinfo_of_the_three_technologies():
    gsm, umts, lte = (one(line) for line in (SERVINFO, SERVINFO_UMTS, SERVINFO_LTE))
    assert (gsm.rat, gsm.arfcn, gsm.lac, gsm.rssi_dbm, gsm.bsic, gsm.ta) == ("GSM", 42, 0x855E, -93, None, None)
    assert (umts.rat, umts.arfcn, umts.psc, umts.lac, umts.rscp_dbm) == ("WCDMA", 10638, 295, 0x55FA, -86)
    assert (lte.rat, lte.arfcn, lte.tac, lte.cid, lte.rsrp_dbm) == ("LTE", 66786, 0x2D18, 0x3089F02, -101)
    assert lte.more["plmn"] == "310260"


@pytest.mark.parametrize(
    ("line", "rat"),
    [
        ('#SERVINFO: 65535,-0,"","",255,FFFF,255,0', "GSM"),
        ('#SERVINFO: 65535,-0,"","",,,,,-255,,', "WCDMA"),
        ('#SERVINFO: 65535,-0,"","",0000000,FFFF,,,-0', "LTE"),
        ('#SERVINFO: 0,-255,"","",,,,', "GSM"),
    ],
)
def test_no_service(line, rat):
    assert one(line) == NoCell(rat)


@pytest.mark.parametrize(
    "line",
    [
        SERVINFO_LTE[: SERVINFO_LTE.rindex(",")],
        SERVINFO_UMTS[:50],
        "#SERVINFO: 42,-93",
        "#SERVINFO: (0-1)",
        "#SERVINFO:",
    ],
)
def test_servinfo_that_is_cut_tells_nothing(line):
    assert MODEM.read([line]) == ()


# --- surveys


def test_survey_with_labels():
    row = one(SURVEYED)
    assert (row.role, who(row), row.arfcn, row.bsic) == ("scan", ("610", "01", 33281, 3648), 48, 24)
    assert (row.rssi_dbm, row.more) == (-52.0, {"status": "CELL_SUITABLE"})


def test_survey_in_hexadecimal_has_an_octal_bsic():
    row = one(SURVEYED_HEX)
    assert (who(row), row.bsic) == (("610", "01", 0x8201, 0x0E40), 60)


def test_survey_in_numbers():
    gsm, umts, lte = cells(CSV, CSV_UMTS, CSV_LTE)
    assert (gsm.rat, who(gsm), gsm.bsic, gsm.more["status"]) == (
        "GSM",
        ("222", "01", 54717, 14887),
        21,
        "CELL_SUITABLE",
    )
    assert (umts.rat, who(umts), umts.psc, umts.rscp_dbm) == ("WCDMA", ("222", "88", 54600, 1231231), 295, -90)
    assert (lte.rat, who(lte), lte.pci, lte.rsrp_dbm) == ("LTE", ("310", "260", 11544, 50896642), 236, -103)
    assert lte.rsrq_db == -15


AMBIGUOUS = "44,21,-73,0,222,01,5471,1488,0,0"


def test_base_that_does_not_show_gives_no_identity():
    row = one(AMBIGUOUS)
    assert (who(row), row.bsic, row.rssi_dbm) == (NOBODY, None, -73.0)


@pytest.mark.parametrize(
    ("beside", "lac", "bsic"), [(CSV, 5471, 21), (CSV.replace("54717,14887", "D5BD,3A27"), 0x5471, 0o21)]
)
def test_base_shows_in_other_lines_of_the_survey(beside, lac, bsic):
    row = cells(beside, AMBIGUOUS)[1]
    assert (row.lac, row.bsic) == (lac, bsic)


@pytest.mark.parametrize(("setting", "lac"), [("AT#CSURVF=0", 5471), ("#CSURVF: 1", 0x5471), ("AT#CSURVF=2", 0x5471)])
def test_base_that_the_transcript_sets(setting, lac):
    assert cells(setting, AMBIGUOUS)[0].lac == lac


def test_line_in_another_base_than_its_survey_names_no_cell():
    assert [row.cell is None for row in cells(CSV, CSV, CSV.replace("54717", "5A717"))] == [False, False, True]


def test_codes_as_hexadecimal_numbers():
    for line in ("6400,-71,DE,A,1A2B3C4,562C,163,0,-98,-8,15", "6400,-71,0DE,0A,1A2B3C4,562C,163,0,-98,-8,15"):
        assert who(one(line)) == ("222", "10", 0x562C, 0x1A2B3C4)
    assert who(one("6400,-71,136,104,1A2B3C4,562C,163,0,-98,-8,15"))[:2] == ("310", "260")


def test_carrier_without_identity():
    lines = ["Network survey started ...", "44,-93", "arfcn: 30 rxLev: -95", "5,12,-80,0,FFF,FF,FFFF,FFFF,5,0"]
    rows = cells(*lines)
    assert [(row.arfcn, row.rssi_dbm) for row in rows] == [(44, -93), (30, -95), (5, -80)]
    assert {who(row) for row in rows} == {NOBODY}
    assert MODEM.read(["44,-93"]) == ()
    assert MODEM.read([*lines[:1], "Network survey ended (Carrier: 2 BCCh: 1)", "44,-93"]) == ()


def test_two_records_that_have_run_into_each_other():
    for end in range(60, 140):
        for row in cells(SURVEYED[:end] + SURVEYED.replace("33281", "33282").replace("3648", "4711")):
            assert who(row) in {NOBODY, ("610", "01", 33281, 3648), ("610", "01", 33282, 4711)}


# --- damage


def identities(rows):
    return {
        (name, value) for row in rows for name in ("mcc", "mnc", "lac", "tac", "cid") if (value := getattr(row, name))
    }


@pytest.mark.parametrize("line", ALL)
def test_cut_line_names_no_other_cell(line):
    whole = identities(cells(line))
    for end in range(len(line)):
        assert identities(cells(line[:end])) <= whole, line[:end]


def test_damage_raises_nothing_and_invents_no_identity():
    chance = random.Random(1)
    for _ in range(4000):
        text = damaged("\n".join(chance.sample(ALL, 3)), chance)
        tokens = re.findall(r"[0-9A-Fa-f]+", text)
        numbers = {int(token, base) for token in tokens for base in (10, 16) if base == 16 or token.isdecimal()}
        for name, value in identities(cells(*text.split("\n"))):
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
                    text[:at] + chance.choice([",", ":", " ", "0", "F", "\n", '"', "#MONI: ", "\x00", "é"]) + text[at:]
                )
    return text
