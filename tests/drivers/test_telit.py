import pytest

from logger.core.types import CellReading
from logger.drivers.reading.row_language import NoCell, as_json
from logger.drivers.telit import Telit
from tests.kit.corpus import check_entry, entries, lines_of
from tests.kit.drivers import NO_IDENTITY, cells_of, identity_of

MODEM = Telit()

# Values of our own in the layouts of firmware_notes/telit.md.
SERVING = "#MONI: S 52 3F6A 1B7C 688 -79dbm 22 30 1 0 Example Net"

NEIGHBOUR = "#MONI: N1 46 3F6B 2C8D 962 -86dbm 17 15"

LABELLED = "#MONI: Cc:262 Nc:01 BSIC:52 RxQual:0 LAC:3F6A Id:1B7C ARFCN:1002 PWR:-71dbm TA:0"

UMTS = (
    "#MONI: Example 3G PSC:117 RSCP:-88 LAC:3F70 Id:1A2B3C4"
    " EcIo:-6.0 UARFCN:10713 PWR:-79 dBm DRX:64 SCR:1872"
)

LTE = "#MONI: Example Net RSRP:-98 RSRQ:-11 TAC:4E5F Id:2D3C4B5 EARFCN:1444 PWR:-69dbm DRX:128"

SERVINFO = '#SERVINFO: 58,-89,"Example, Net","26299",52,3F6A,02,1,,"II",01,6'

SERVINFO_UMTS = '#SERVINFO: 10713,-79,"Example Net","26202",117,3F70,64,3,-88,"II",30'

SERVINFO_LTE = '#SERVINFO: 1444,-69,"Example","001 010",2D3C4B5,4E5F,128,3,-98'

SURVEYED = (
    "arfcn: 61 bsic: 37 rxLev: -57 ber: 0.00 mcc: 262 mnc: 1 lac:"
    " 12345 cellId: 6789 cellStatus: CELL_SUITABLE "
    "numArfcn: 2 arfcn: 61 67 numChannels: 3 array: 3 9 27 pbcch: 0 mstxpwr: 5 rxaccmin: 4"
)

SURVEYED_HEX = (
    SURVEYED.replace("12345", "3039").replace("6789", "0A85").replace("bsic: 37", "bsic: 71")
)

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


def test_cell_that_is_received_and_not_decoded_keeps_its_level():
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


def test_a_neighbour_of_lte_with_its_code_under_a_label():
    row = one("#MONI: RSRP:-107 RSRQ:-18 PCI:137 EARFCN:1300 PWR:-79dbm")
    assert (row.role, row.arfcn, row.pci, row.rsrp_dbm) == ("neighbour", 1300, 137, -107.0)


def test_a_closing_bracket_is_no_part_of_a_level():
    row = one("#MONI: Adj Cell1 [LAC:3F6A, Id:1B7C, ARFCN:68, PWR:-76dbm]")
    assert (row.cid, row.arfcn, row.rssi_dbm) == (0x1B7C, 68, -76.0)


def test_a_channel_at_the_end_of_a_row_may_be_cut():
    row = one(LABELLED[: LABELLED.index("02 PWR")])  # ARFCN:10 of 1002
    assert (row.cell, row.arfcn) == (one(LABELLED).cell, None)


@pytest.mark.parametrize(
    ("channel", "rat", "code"),
    [(10737, "WCDMA", (136, None)), (5110, "LTE", (None, 136)), (68611, "LTE", (None, 136))],
)
def test_a_decimal_pci_on_a_channel_of_no_umts_is_no_scrambling_code(channel, rat, code):
    row = one(f'#SERVINFO: {channel},-72,"Example","001010",136,4E5F,128,3,-101')
    assert (row.rat, row.arfcn, (row.psc, row.pci), row.level_dbm) == (rat, channel, code, -101.0)


def test_a_decimal_pci_is_no_cell_identity_in_hexadecimal():
    row = one('#SERVINFO: 5110,-72,"Example","001010",352,4E5F,128,3,-101')
    assert (row.rat, row.tac, row.cid, row.pci) == ("LTE", 0x4E5F, None, 352)


def test_letters_in_a_pci_are_no_scrambling_code():
    reading = one(SERVINFO_LTE.replace("2D3C4B5", "7B"))
    assert (reading.rat, reading.tac, reading.cid) == ("LTE", 0x4E5F, None)
    assert (reading.rsrp_dbm, reading.rscp_dbm) == (-98, None)


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
def test_servinfo_that_is_cut_reads_nothing(line):
    assert MODEM.read([line]) == ()


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
