import pytest

from logger.core.types import CellReading
from logger.drivers.family import AUTOBAUD_TRIES
from logger.drivers.reading.row_language import NoCell, as_json
from logger.drivers.sim7600 import Sim7600
from tests.kit.corpus import check_entry, entries, lines_of
from tests.kit.drivers import NO_IDENTITY, identity_of, run_exchange

MODEM = Sim7600()

# Values of our own in the layouts of firmware_notes/simcom.md.
GSM = (
    "+CCINFO:[SCELL],ARFCN:52,MCC:262,MNC:03,LAC:12345,ID:4321,"
    "BSIC:27,RXLev:-74dbm,C1:29,C2:-3,TA:0,TXPWR:0"
)
GSM_NEIGHBOUR = (
    "+CCINFO:[NCell1],ARFCN:77,MCC:262,MNC:03,LAC:12345,ID:4322,BSIC:41,RXLev:-83dbm,C1:26,C2:25"
)
WCDMA = (
    "+CCINFO:[SCELL],UARFCN:10688,MCC:262,MNC:002,LAC:2587,ID:19088743,PSC:117,SSC:0,RSCP:86"
    ",ECIO:9.0,RXLev:-79dbm,TXPWR:0"
)
WCDMA_NEIGHBOUR = "+CCINFO:[NCell1],UARFCN:10688,PSC:305,SSC:0,RSCP:99,ECIO:14.5,RXLev:-92dbm"

CMGRMI = [
    "+CMGRMI: Main_Info,4,1,1,0,2,41234,0,2,11",
    "+CMGRMI: Serving_Cell,1300,262,02,5432,2,7654321,3,5,5,12,211,-95,-912,-604,0",
    "+CMGRMI: CA_Scell,0,0,0,0,0,0,0,0,0,0,0,0",
    "+CMGRMI: LTE_Intra,1,1300,211,2",
    "+CMGRMI: LTE_Intra_Cell1,211,-95,-912,-604,0",
    "+CMGRMI: LTE_Intra_Cell2,86,-140,-1003,-689,0",
    "+CMGRMI: LTE_Inter,2,Freq1,37900,2,0,0,0,0,Freq2,2850,1,0,0,0,0",
    "+CMGRMI: LTE_InterFreq1_Cell1,417,-125,-1011,-772,0",
    "+CMGRMI: LTE_InterFreq2_Cell1,158,-105,-957,-741,0",
    "+CMGRMI: GSM_Info,0,Freq_Group1,0,0,0,0,0,Freq_Group2,0,0,0,0,0",
]
CPSI = "+CPSI: LTE,Online,262-02,0x1538,7654321,211,EUTRAN-BAND3,1300,5,5,-96,-911,-602,12"


def one(line):
    readings = MODEM.read([line])
    assert len(readings) <= 1
    return readings[0] if readings else None


# --- CCINFO


def test_gsm_cell():
    assert one(GSM) == CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="03",
        lac=12345,
        cid=4321,
        arfcn=52,
        rssi_dbm=-74.0,
        ta=0,
        c1=29,
        c2=-3,
        more={"bsic_raw": "27"},
    )
    row = one(GSM_NEIGHBOUR)
    assert (row.role, identity_of(row), row.c2, row.bsic) == (
        "neighbour",
        ("262", "03", 12345, 4322),
        25,
        None,
    )


def test_wcdma_cell_whose_levels_have_lost_their_sign():
    row = one(WCDMA)
    assert (row.rat, row.psc, row.arfcn) == ("WCDMA", 117, 10688)
    assert (row.rscp_dbm, row.ecio_db, row.rssi_dbm) == (-86.0, -9.0, -79.0)
    row = one(WCDMA_NEIGHBOUR)
    assert (identity_of(row), row.psc, row.rscp_dbm, row.ecio_db, row.rssi_dbm) == (
        NO_IDENTITY,
        305,
        -99.0,
        -14.5,
        -92.0,
    )


@pytest.mark.parametrize(
    ("printed", "mnc"),
    [("001", None), ("1", None), ("010", None), ("01", "01"), ("24", "24"), ("410", "410")],
)
def test_network_code_with_a_zero_in_front_is_not_known(printed, mnc):
    assert identity_of(one(WCDMA.replace("MNC:002", f"MNC:{printed}"))) == (
        "262",
        mnc,
        2587,
        19088743,
    )


@pytest.mark.parametrize(
    ("whole", "other", "cell"),
    [
        ("LAC:12345", "LAC:65534", ("262", "03", None, 4321)),
        ("ID:4321,", "ID:65535,", ("262", "03", 12345, None)),
        ("ID:4321,", "ID:99999,", ("262", "03", 12345, None)),
        ("MCC:262", "MCC:000", NO_IDENTITY),
        ("MCC:262", "MCC:2x2", NO_IDENTITY),
        ("LAC:12345", "LAC:30a9", NO_IDENTITY),
        ("LAC:12345,", "LAC:12345", NO_IDENTITY),
        ("LAC:12345,", "", NO_IDENTITY),
        ("ID:4321,BSIC", "ID:4321", NO_IDENTITY),
    ],
)
def test_identity_is_complete_or_nothing(whole, other, cell):
    row = one(GSM.replace(whole, other))
    assert (identity_of(row), row.rssi_dbm) == (cell, -74.0)


@pytest.mark.parametrize(
    ("printed", "ta"), [("0", 0), ("63", 63), ("64", None), ("255", None), ("", None)]
)
def test_timing_advance(printed, ta):
    assert one(GSM.replace("TA:0", f"TA:{printed}")).ta == ta


@pytest.mark.parametrize(
    "line",
    [
        GSM.replace("dbm", "dBm"),
        GSM.replace("[SCELL]", "[SCell]").replace("RXLev", "RXLEV"),
        GSM.replace("CCINFO:", "CCINFO: "),
        GSM.replace(",", ", "),
        "12:00:01 -> " + GSM + "\r",
        GSM + "\\r\\nOK",
        "AT+CCINFO" + GSM,
    ],
)
def test_writing_of_a_row(line):
    assert one(line) == one(GSM)


@pytest.mark.parametrize(
    "line",
    [
        "+CCINFO:[SCELL]",
        "+CCINFO:[SCELL],MCC:262,MNC:03,LAC:12345,ID:4321,BSIC:27,RXLev:-74dbm",
        "+CCINFO:[SCELL],EARFCN:1300,MCC:262,MNC:03,TAC:12345,ID:4321,PCI:27,RSRP:-912",
        "+CCINFO:[NCell2],ARFCN:0,MCC:0,MNC:0,LAC:0,ID:0,BSIC:0,RXLev:0dbm,C1:0,C2:0",
        GSM[: GSM.index(",LAC")],
    ],
)
def test_rows_that_state_nothing(line):
    assert one(line) is None


def test_rows_run_into_each_other():
    rows = MODEM.read([WCDMA[: WCDMA.index("CIO")] + WCDMA_NEIGHBOUR])
    assert [(row.role, row.cid, row.rscp_dbm) for row in rows] == [
        ("serving", 19088743, -86.0),
        ("neighbour", None, -99.0),
    ]


# --- CMGRMI


def test_lte_cells():
    serving, *neighbours = MODEM.read(CMGRMI)
    assert serving == CellReading(
        role="serving",
        rat="LTE",
        mcc="262",
        mnc="02",
        tac=5432,
        cid=7654321,
        arfcn=1300,
        band=3,
        pci=211,
        rsrp_dbm=-91.2,
        rsrq_db=-9.5,
        rssi_dbm=-60.4,
        sinr_db=12.0,
    )
    assert [(row.role, row.arfcn, row.pci, row.rsrp_dbm) for row in neighbours] == [
        ("neighbour", 1300, 86, -100.3),
        ("neighbour", 37900, 417, -101.1),
        ("neighbour", 2850, 158, -95.7),
    ]
    assert {identity_of(row) for row in neighbours} == {NO_IDENTITY}


def test_neighbour_without_the_row_of_its_group_has_no_channel():
    row = one("+CMGRMI: LTE_InterFreq1_Cell1,417,-125,-1011,-772,0")
    assert (row.arfcn, row.pci, row.rsrp_dbm, row.rsrq_db, row.rssi_dbm) == (
        None,
        417,
        -101.1,
        -12.5,
        -77.2,
    )


@pytest.mark.parametrize(
    ("whole", "other"),
    [
        (",262,02,", ",65535,02,"),
        (",262,02,", ",262,2,"),
        (",262,02,", ",262,002,"),
        (",262,02,5432", ",262,025432"),
    ],
)
def test_serving_cell_whose_network_is_not_complete_is_no_cell(whole, other):
    assert all(
        identity_of(row) == NO_IDENTITY for row in MODEM.read([CMGRMI[1].replace(whole, other)])
    )


def test_empty_groups_and_cut_rows_are_no_cell():
    assert MODEM.read([CMGRMI[0], CMGRMI[2], *CMGRMI[9:]]) == ()
    assert (
        MODEM.read(["+CMGRMI: LTE_Intra_Cell2,0,0,0,0,0", "+CMGRMI: LTE_Intra_Cell2,86,-140,-100"])
        == ()
    )
    assert MODEM.read([CMGRMI[1][: CMGRMI[1].index(",-912")]]) == ()


# --- the modem


def test_setup():
    quiet = [(text, [], "OK") for text in ("AT", "ATE0", "ATV1", "AT+CMEE=1")]
    assert run_exchange(MODEM.setup(), quiet) is True
    assert run_exchange(MODEM.setup(), [("AT", [], None)] * AUTOBAUD_TRIES) is False


ASKED = ("AT+CPSI?", "AT+CCINFO", "AT+CMGRMI=4", "AT+CESQ")


def poll_with(*answers):
    return run_exchange(
        MODEM.poll(), [(text, *answer) for text, answer in zip(ASKED, answers, strict=True)]
    )


def test_the_serving_cell_without_the_row_of_its_channel_is_no_neighbour():
    rows = MODEM.read([line for line in CMGRMI if "LTE_Intra," not in line])
    assert [(row.arfcn, row.pci) for row in rows] == [
        (1300, 211),
        (None, 86),
        (37900, 417),
        (2850, 158),
    ]


@pytest.mark.parametrize("serving", [CMGRMI[1] + ",1", CMGRMI[1][:60]])
def test_the_serving_cell_in_a_row_of_another_form_is_no_neighbour(serving):
    rows = MODEM.read([CMGRMI[0], serving, *CMGRMI[2:]])
    assert [(row.arfcn, row.pci) for row in rows] == [(1300, 86), (37900, 417), (2850, 158)]


def test_poll_names_the_serving_cell_once():
    serving, *others = poll_with(
        ([CPSI], "OK"), ([], "ERROR"), (CMGRMI, "OK"), (["+CESQ: 99,99,255,255,20,51"], "OK")
    )
    assert (serving.cid, serving.rsrp_dbm, serving.role) == (7654321, -91.1, "serving")
    assert [row.pci for row in others if isinstance(row, CellReading)] == [86, 417, 158]


def test_poll_takes_the_network_from_the_line_that_has_it():
    cpsi = "+CPSI: WCDMA,Online,262-02,0x0A1B,19088743,WCDMA 2100,117,10688,0,9.5,84,25,31,500"
    serving, neighbour = poll_with(
        ([cpsi], "OK"), ([WCDMA, WCDMA_NEIGHBOUR], "OK"), ([], "ERROR"), ([], "ERROR")
    )
    assert (serving.cell, serving.rscp_dbm, neighbour.role) == (
        "262-02-2587-19088743",
        -84.0,
        "neighbour",
    )


def test_first_answer_after_power_up_is_an_error():
    assert poll_with(*[([], "ERROR")] * 4) is None
    assert poll_with(*[([], None)] * 4) is None
    rows = poll_with(([], "ERROR"), ([GSM], "OK"), ([], "+CME ERROR: 3"), ([], None))
    assert [row.cid for row in rows if isinstance(row, CellReading)] == [4321]


def test_poll_without_service():
    rows = poll_with((["+CPSI: NO SERVICE,Online"], "OK"), ([], "OK"), ([], "ERROR"), ([], "ERROR"))
    assert rows == (NoCell(status="NO SERVICE", state="Online"),)


def test_recorded_replies(corpus):
    dialects = (
        "simcom_cpsi",
        "simcom_ccinfo",
        "simcom_cnwinfo",
        "simcom_boot",
        "simcom_cgpsinfo",
        "simcom_csq",
    )
    found = [entry for entry in entries(corpus, *dialects) if "SIM7000" not in entry["source"]]
    assert len(found) >= 15
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])
