import pytest

from logger.core.types import CellReading
from logger.drivers.reading.rows import NoCell, as_json
from logger.drivers.telit.telit import Telit
from tests.kit.corpus import check_entry, entries, lines_of
from tests.kit.drivers import NO_IDENTITY, cells_of, identity_of

MODEM = Telit()

# Values of our own in the layouts of firmware_notes/telit.md.
SERVING = "#MONI: S 52 3F6A 1B7C 688 -79dbm 22 30 1 0 Example Net"
NEIGHBOUR = "#MONI: N1 46 3F6B 2C8D 962 -86dbm 17 15"
LABELLED = "#MONI: Cc:262 Nc:01 BSIC:52 RxQual:0 LAC:3F6A Id:1B7C ARFCN:1002 PWR:-71dbm TA:0"
UMTS = "#MONI: Example 3G PSC:117 RSCP:-88 LAC:3F70 Id:1A2B3C4 EcIo:-6.0 UARFCN:10713 PWR:-79 dBm DRX:64 SCR:1872"
LTE = "#MONI: Example Net RSRP:-98 RSRQ:-11 TAC:4E5F Id:2D3C4B5 EARFCN:1444 PWR:-69dbm DRX:128"
SERVINFO = '#SERVINFO: 58,-89,"Example, Net","26299",52,3F6A,02,1,,"II",01,6'
SERVINFO_UMTS = '#SERVINFO: 10713,-79,"Example Net","26202",117,3F70,64,3,-88,"II",30'
SERVINFO_LTE = '#SERVINFO: 1444,-69,"Example","001 010",2D3C4B5,4E5F,128,3,-98'
SURVEYED = (
    "arfcn: 61 bsic: 37 rxLev: -57 ber: 0.00 mcc: 262 mnc: 1 lac: 12345 cellId: 6789 cellStatus: CELL_SUITABLE "
    "numArfcn: 2 arfcn: 61 67 numChannels: 3 array: 3 9 27 pbcch: 0 mstxpwr: 5 rxaccmin: 4"
)
SURVEYED_HEX = (
    SURVEYED.replace("12345", "3039").replace("6789", "0A85").replace("bsic: 37", "bsic: 71")
)
CSV = "1005,26,-76,0,262,02,23456,34567,CELL_SUITABLE,0"
CSV_UMTS = "10713,-85,262,88,117,1234567,23457,0,-91,-4"
CSV_LTE = "1444,-69,001,010,47432885,20063,303,0,-98,-12,20"
ALL = [
    SERVING,
    NEIGHBOUR,
    LABELLED,
    UMTS,
    LTE,
    SERVINFO,
    SERVINFO_UMTS,
    SERVINFO_LTE,
    SURVEYED,
    SURVEYED_HEX,
]
ALL += [CSV, CSV_UMTS, CSV_LTE]


def cells(*lines):
    return cells_of(MODEM, lines)


def one(*lines):
    (row,) = MODEM.read(lines)
    return row


@pytest.mark.parametrize("dialect", ["telit_moni", "telit_servinfo", "telit_csurv", "telit_lte"])
def test_real_replies(corpus, dialect):
    found = entries(corpus, dialect)
    assert found
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


# --- AT#MONI


def test_table():
    operator = {"operator": "Example Net"}
    assert one(SERVING) == CellReading(
        "serving",
        "GSM",
        lac=0x3F6A,
        cid=0x1B7C,
        arfcn=688,
        bsic=42,
        rssi_dbm=-79,
        rxq=0,
        ta=1,
        c1=22,
        c2=30,
        more=operator,
    )
    assert one(NEIGHBOUR) == CellReading(
        "neighbour", "GSM", lac=0x3F6B, cid=0x2C8D, arfcn=962, bsic=38, rssi_dbm=-86.0, c1=17, c2=15
    )


def test_cell_that_is_heard_and_not_decoded_keeps_its_level():
    row = one("#MONI: N2 FF FFFF 0000 693 -88dbm -1 -1;")
    assert (identity_of(row), row.bsic, row.arfcn, row.rssi_dbm, row.c1) == (
        NO_IDENTITY,
        None,
        693,
        -88.0,
        None,
    )


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
    assert (identity_of(gsm), gsm.bsic, gsm.arfcn, gsm.rssi_dbm, gsm.ta) == (
        ("262", "01", 0x3F6A, 0x1B7C),
        42,
        1002,
        -71,
        0,
    )
    umts = one(UMTS)
    assert (umts.rat, identity_of(umts), umts.psc, umts.arfcn) == (
        "WCDMA",
        (None, None, 0x3F70, 0x1A2B3C4),
        117,
        10713,
    )
    assert (umts.rscp_dbm, umts.ecio_db, umts.rssi_dbm, umts.more["operator"]) == (
        -88,
        -6,
        -79,
        "Example 3G",
    )
    lte = one(LTE)
    assert (lte.rat, lte.tac, lte.cid, lte.arfcn, lte.rsrp_dbm, lte.pci) == (
        "LTE",
        0x4E5F,
        0x2D3C4B5,
        1444,
        -98,
        None,
    )


def test_cells_beside_the_serving_one():
    rows = cells(
        "#MONI: Adj Cell3 LAC:3F6A Id:1B7D ARFCN:1003 PWR:-81 dBm",
        "#MONI: Adj Cell 4 ARFCN:1004 PWR:-84dBm",
        "#MONI: PSC:117 RSCP:-90 EcIo:-7 UARFCN:10713 SCR:33",
        "#MONI: RSRP:-105 RSRQ:-16 Id:000012F EARFCN:1444 PWR:-77dbm",
    )
    assert [row.role for row in rows] == ["neighbour"] * 4
    assert [row.cid for row in rows] == [0x1B7D, None, None, None]
    assert rows[3].pci == 0x12F
    assert all("operator" not in row.more for row in rows)


@pytest.mark.parametrize("text", ["00000B2", "00001F7"])
def test_what_may_be_the_physical_identity_is_no_cell_identity(text):
    assert one(LTE.replace("2D3C4B5", text)).cid is None
    assert one(SERVINFO_LTE.replace("2D3C4B5", text)).cid is None


@pytest.mark.parametrize(
    ("line", "lac", "cid"), [("LAC:5C6D", 0x5C6D, None), ("LAC:5C6D ", 0x5C6D, None)]
)
def test_line_that_its_author_has_broken(line, lac, cid):
    row = one("#MONI: Example BSIC:53 RxQual:0 " + line)
    assert (row.role, row.bsic, row.lac, row.cid) == ("serving", 43, lac, cid)
    assert MODEM.read(["#MONI: Example BSIC:53 RxQual:0 LAC:5C6"]) == ()


def test_rows_in_a_log():
    rows = cells(
        f"12:00:01,5 <- {SERVING}\\r\\n{NEIGHBOUR}\\r\\n",
        f"> {SERVINFO.replace(chr(34), chr(92) + chr(34))}",
    )
    assert [row.role for row in rows] == ["serving", "neighbour", "serving"]
    assert rows[0].more == {"operator": "Example Net"}
    assert rows[2].more == {"operator": "Example, Net", "plmn": "26299"}
    assert cells(SERVING.lower())[0].cid == 0x1B7C


# --- AT#SERVINFO


def test_servinfo_of_the_three_technologies():
    gsm, umts, lte = (one(line) for line in (SERVINFO, SERVINFO_UMTS, SERVINFO_LTE))
    assert (gsm.rat, gsm.arfcn, gsm.lac, gsm.rssi_dbm, gsm.bsic, gsm.ta) == (
        "GSM",
        58,
        0x3F6A,
        -89,
        None,
        None,
    )
    assert (umts.rat, umts.arfcn, umts.psc, umts.lac, umts.rscp_dbm) == (
        "WCDMA",
        10713,
        117,
        0x3F70,
        -88,
    )
    assert (lte.rat, lte.arfcn, lte.tac, lte.cid, lte.rsrp_dbm) == (
        "LTE",
        1444,
        0x4E5F,
        0x2D3C4B5,
        -98,
    )
    assert lte.more["plmn"] == "001010"


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
        "#SERVINFO: 58,-89",
        "#SERVINFO: (0-1)",
        "#SERVINFO:",
    ],
)
def test_servinfo_that_is_cut_tells_nothing(line):
    assert MODEM.read([line]) == ()


# --- surveys


def test_survey_with_labels():
    row = one(SURVEYED)
    assert (row.role, identity_of(row), row.arfcn, row.bsic) == (
        "scan",
        ("262", "01", 12345, 6789),
        61,
        37,
    )
    assert (row.rssi_dbm, row.more) == (-57.0, {"status": "CELL_SUITABLE"})


def test_survey_in_hexadecimal_has_an_octal_bsic():
    row = one(SURVEYED_HEX)
    assert (identity_of(row), row.bsic) == (("262", "01", 0x3039, 0x0A85), 57)


def test_survey_in_numbers():
    gsm, umts, lte = cells(CSV, CSV_UMTS, CSV_LTE)
    assert (gsm.rat, identity_of(gsm), gsm.bsic, gsm.more["status"]) == (
        "GSM",
        ("262", "02", 23456, 34567),
        26,
        "CELL_SUITABLE",
    )
    assert (umts.rat, identity_of(umts), umts.psc, umts.rscp_dbm) == (
        "WCDMA",
        ("262", "88", 23457, 1234567),
        117,
        -91,
    )
    assert (lte.rat, identity_of(lte), lte.pci, lte.rsrp_dbm) == (
        "LTE",
        ("001", "010", 20063, 47432885),
        303,
        -98,
    )
    assert lte.rsrq_db == -12


AMBIGUOUS = "44,26,-76,0,262,02,2345,3456,0,0"


def test_base_that_does_not_show_is_taken_as_shipped_and_unsure():
    row = one(AMBIGUOUS)
    assert (identity_of(row), row.identity_unsure) == (("262", "02", 2345, 3456), True)
    assert (row.bsic, row.rssi_dbm) == (None, -76.0)
    assert not cells(CSV, AMBIGUOUS)[1].identity_unsure


@pytest.mark.parametrize("head", [["Network survey started ..."], ["AT#CSURVC"], []])
@pytest.mark.parametrize(
    "end", ["0,-98,-12,20", "0,-98,-12", "CELL_SUITABLE,-98,-12", "0", "CELL_OTHER"]
)
def test_carrier_of_lte_without_what_stands_around_it(head, end):
    (row,) = cells(*head, f"66786,-68,001,010,47432885,20063,303,{end}")
    assert (row.rat, identity_of(row), row.arfcn, row.pci) == (
        "LTE",
        ("001", "010", 20063, 47432885),
        66786,
        303,
    )
    assert row.rssi_dbm == -68
    assert (row.rsrp_dbm is None) == ("-98" not in end)


def test_carrier_of_lte_or_wcdma_that_is_not_decoded():
    rows = cells(
        "Network survey started ...",
        "66786,-88",
        "earfcn: 1444 rxLev: -91",
        "uarfcn: 10713 rxLev: -93",
    )
    assert [(row.rat, row.arfcn, row.rssi_dbm) for row in rows] == [
        ("LTE", 66786, -88), ("LTE", 1444, -91), ("WCDMA", 10713, -93),
    ]  # fmt: skip


@pytest.mark.parametrize("ta", [0, 1, 37, 63])
def test_timing_advance_in_both_forms(ta):
    assert one(SERVING.replace(" 1 0 Ex", f" {ta} 0 Ex")).ta == ta
    assert one(LABELLED.replace("TA:0", f"TA:{ta}")).ta == ta
    assert one(LABELLED.replace("TA:0", "TA:64")).ta is None


@pytest.mark.parametrize(
    ("beside", "lac", "bsic"),
    [(CSV, 2345, 26), (CSV.replace("23456,34567", "5BA0,87C7"), 0x2345, 0o26)],
)
def test_base_shows_in_other_lines_of_the_survey(beside, lac, bsic):
    row = cells(beside, AMBIGUOUS)[1]
    assert (row.lac, row.bsic) == (lac, bsic)


@pytest.mark.parametrize(
    ("setting", "lac"), [("AT#CSURVF=0", 2345), ("#CSURVF: 1", 0x2345), ("AT#CSURVF=2", 0x2345)]
)
def test_base_that_the_transcript_sets(setting, lac):
    assert cells(setting, AMBIGUOUS)[0].lac == lac


def test_line_in_another_base_than_its_survey_names_no_cell():
    assert [row.cell is None for row in cells(CSV, CSV, CSV.replace("23456", "2345A"))] == [
        False,
        False,
        True,
    ]


def test_codes_as_hexadecimal_numbers():
    for line in (
        "6300,-73,E8,B,1A2B3C4,4E5F,163,0,-99,-9,15",
        "6300,-73,0E8,0B,1A2B3C4,4E5F,163,0,-99,-9,15",
    ):
        assert identity_of(one(line)) == ("232", "11", 0x4E5F, 0x1A2B3C4)
    lines = (
        "6300,-73,106,065,1A2B3C4,4E5F,163,0,-99,-9,15",
        "6300,-79,106,065,1A2B3C5,4E5F,164,0,-99,-9,15",
    )
    assert [identity_of(row)[:2] for row in cells(*lines)] == [("262", "101")] * 2


@pytest.mark.parametrize("damaged", ["182", "062", "2A2", "E62", "26F", "22"])
def test_a_country_code_that_is_damaged_is_not_taken_for_hexadecimal(damaged):
    row = one(CSV.replace("262", damaged))
    assert (identity_of(row), row.rssi_dbm) == (NO_IDENTITY, -76.0)


def test_carrier_without_identity():
    lines = [
        "Network survey started ...",
        "44,-93",
        "arfcn: 30 rxLev: -95",
        "5,12,-80,0,FFF,FF,FFFF,FFFF,5,0",
    ]
    rows = cells(*lines)
    assert [(row.arfcn, row.rssi_dbm) for row in rows] == [(44, -93), (30, -95), (5, -80)]
    assert {identity_of(row) for row in rows} == {NO_IDENTITY}
    assert MODEM.read(["44,-93"]) == ()
    assert MODEM.read([*lines[:1], "Network survey ended (Carrier: 2 BCCh: 1)", "44,-93"]) == ()


def test_two_records_that_have_run_into_each_other():
    for end in range(60, 140):
        for row in cells(
            SURVEYED[:end] + SURVEYED.replace("12345", "12346").replace("6789", "4711")
        ):
            assert identity_of(row) in {
                NO_IDENTITY,
                ("262", "01", 12345, 6789),
                ("262", "01", 12346, 4711),
            }


# --- damage


def identities(rows):
    return {
        (name, value)
        for row in rows
        for name in ("mcc", "mnc", "lac", "tac", "cid")
        if (value := getattr(row, name))
    }


@pytest.mark.parametrize("line", ALL)
def test_cut_line_names_no_other_cell(line):
    whole = identities(cells(line))
    for end in range(len(line)):
        assert identities(cells(line[:end])) <= whole, line[:end]
