import pytest

from logger.core.types import CellReading
from logger.drivers.dialogue import Reply
from logger.drivers.family import AUTOBAUD_TRIES
from logger.drivers.rows import NoCell, as_json
from logger.drivers.sim7600 import Sim7600
from tests.kit.corpus import check_entry, entries, lines_of

MODEM = Sim7600()
NOBODY = (None, None, None, None)

GSM = "+CCINFO:[SCELL],ARFCN:34,MCC:240,MNC:24,LAC:10001,ID:31,BSIC:18,RXLev:-78dbm,C1:33,C2:-3,TA:0,TXPWR:0"
GSM_NEIGHBOUR = "+CCINFO:[NCell1],ARFCN:69,MCC:240,MNC:24,LAC:10001,ID:6333,BSIC:52,RXLev:-79dbm,C1:32,C2:31"
WCDMA = (
    "+CCINFO:[SCELL],UARFCN:4436,MCC:505,MNC:001,LAC:338,ID:14302219,PSC:214,SSC:0,RSCP:88,ECIO:8.0"
    ",RXLev:-87dbm,TXPWR:0"
)
WCDMA_NEIGHBOUR = "+CCINFO:[NCell1],UARFCN:4436,PSC:230,SSC:0,RSCP:97,ECIO:15.5,RXLev:-96dbm"

# from github.com/4IceG/luci-app-3ginfo-lite issue 61 (SIM7906), neighbours on another channel added by us
CMGRMI = [
    "+CMGRMI: Main_Info,4,1,1,0,2,52709,0,2,11",
    "+CMGRMI: Serving_Cell,1725,250,02,3832,2,22060,3,3,3,19,58,-107,-890,-625,0",
    "+CMGRMI: CA_Scell,0,0,0,0,0,0,0,0,0,0,0,0",
    "+CMGRMI: LTE_Intra,1,1725,58,2",
    "+CMGRMI: LTE_Intra_Cell1,58,-107,-890,-625,0",
    "+CMGRMI: LTE_Intra_Cell2,77,-150,-990,-700,0",
    "+CMGRMI: LTE_Inter,2,Freq1,38100,2,0,0,0,0,Freq2,3200,1,0,0,0,0",
    "+CMGRMI: LTE_InterFreq1_Cell1,455,-120,-991,-781,0",
    "+CMGRMI: LTE_InterFreq2_Cell1,130,-100,-946,-756,0",
    "+CMGRMI: GSM_Info,0,Freq_Group1,0,0,0,0,0,Freq_Group2,0,0,0,0,0",
]
CPSI = "+CPSI: LTE,Online,250-02,0x0EF8,22060,58,EUTRAN-BAND3,1725,3,3,-108,-889,-614,19"


def one(line):
    readings = MODEM.read([line])
    assert len(readings) <= 1
    return readings[0] if readings else None


def who(reading):
    return reading.mcc, reading.mnc, reading.tac if reading.lac is None else reading.lac, reading.cid


# --- CCINFO


def test_gsm_cell():
    assert one(GSM) == CellReading(
        role="serving",
        rat="GSM",
        mcc="240",
        mnc="24",
        lac=10001,
        cid=31,
        arfcn=34,
        rssi_dbm=-78.0,
        ta=0,
        c1=33,
        c2=-3,
        more={"bsic_raw": "18"},
    )
    row = one(GSM_NEIGHBOUR)
    assert (row.role, who(row), row.c2, row.bsic) == ("neighbour", ("240", "24", 10001, 6333), 31, None)


def test_wcdma_cell_whose_levels_have_lost_their_sign():
    row = one(WCDMA)
    assert (row.rat, row.psc, row.arfcn) == ("WCDMA", 214, 4436)
    assert (row.rscp_dbm, row.ecio_db, row.rssi_dbm) == (-88.0, -8.0, -87.0)
    row = one(WCDMA_NEIGHBOUR)
    assert (who(row), row.psc, row.rscp_dbm, row.ecio_db, row.rssi_dbm) == (NOBODY, 230, -97.0, -15.5, -96.0)


@pytest.mark.parametrize(
    ("printed", "mnc"), [("001", None), ("1", None), ("010", None), ("01", "01"), ("24", "24"), ("410", "410")]
)
def test_network_code_with_a_zero_in_front_is_not_known(printed, mnc):
    assert who(one(WCDMA.replace("MNC:001", f"MNC:{printed}"))) == ("505", mnc, 338, 14302219)


@pytest.mark.parametrize(
    ("whole", "other", "cell"),
    [
        ("LAC:10001", "LAC:65534", ("240", "24", None, 31)),
        ("ID:31,", "ID:65535,", ("240", "24", 10001, None)),
        ("ID:31,", "ID:99999,", ("240", "24", 10001, None)),
        ("MCC:240", "MCC:000", NOBODY),
        ("MCC:240", "MCC:2x0", NOBODY),
        ("LAC:10001", "LAC:27a1", NOBODY),
        ("LAC:10001,", "LAC:10001", NOBODY),
        ("LAC:10001,", "", NOBODY),
        ("ID:31,BSIC", "ID:31", NOBODY),
    ],
)
def test_identity_is_whole_or_nothing(whole, other, cell):
    row = one(GSM.replace(whole, other))
    assert (who(row), row.rssi_dbm) == (cell, -78.0)


@pytest.mark.parametrize(("printed", "ta"), [("0", 0), ("63", 63), ("64", None), ("255", None), ("", None)])
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
        "+CCINFO:[SCELL],MCC:240,MNC:24,LAC:10001,ID:31,BSIC:18,RXLev:-78dbm",
        "+CCINFO:[SCELL],EARFCN:1725,MCC:240,MNC:24,TAC:10001,ID:31,PCI:18,RSRP:-890",
        "+CCINFO:[NCell2],ARFCN:0,MCC:0,MNC:0,LAC:0,ID:0,BSIC:0,RXLev:0dbm,C1:0,C2:0",
        GSM[: GSM.index(",LAC")],
    ],
)
def test_rows_that_say_nothing(line):
    assert one(line) is None


def test_rows_run_into_each_other():
    rows = MODEM.read([WCDMA[: WCDMA.index("CIO")] + WCDMA_NEIGHBOUR])
    assert [(row.role, row.cid, row.rscp_dbm) for row in rows] == [
        ("serving", 14302219, -88.0),
        ("neighbour", None, -97.0),
    ]


# --- CMGRMI


def test_lte_cells():
    serving, *neighbours = MODEM.read(CMGRMI)
    assert serving == CellReading(
        role="serving",
        rat="LTE",
        mcc="250",
        mnc="02",
        tac=3832,
        cid=22060,
        arfcn=1725,
        band=3,
        pci=58,
        rsrp_dbm=-89.0,
        rsrq_db=-10.7,
        rssi_dbm=-62.5,
        sinr_db=19.0,
    )
    assert [(row.role, row.arfcn, row.pci, row.rsrp_dbm) for row in neighbours] == [
        ("neighbour", 1725, 77, -99.0),
        ("neighbour", 38100, 455, -99.1),
        ("neighbour", 3200, 130, -94.6),
    ]
    assert {who(row) for row in neighbours} == {NOBODY}


def test_neighbour_without_the_row_of_its_group_has_no_channel():
    row = one("+CMGRMI: LTE_InterFreq1_Cell1,455,-120,-991,-781,0")
    assert (row.arfcn, row.pci, row.rsrp_dbm, row.rsrq_db, row.rssi_dbm) == (None, 455, -99.1, -12.0, -78.1)


@pytest.mark.parametrize(
    ("whole", "other"),
    [(",250,02,", ",65535,02,"), (",250,02,", ",250,2,"), (",250,02,", ",250,002,"), (",250,02,3832", ",250,023832")],
)
def test_serving_cell_whose_network_is_not_whole_is_nobody(whole, other):
    assert all(who(row) == NOBODY for row in MODEM.read([CMGRMI[1].replace(whole, other)]))


def test_empty_groups_and_cut_rows_are_no_cell():
    assert MODEM.read([CMGRMI[0], CMGRMI[2], *CMGRMI[9:]]) == ()
    assert MODEM.read(["+CMGRMI: LTE_Intra_Cell2,0,0,0,0,0", "+CMGRMI: LTE_Intra_Cell2,77,-150,-99"]) == ()
    assert MODEM.read([CMGRMI[1][: CMGRMI[1].index(",-890")]]) == ()


# --- the modem


@pytest.mark.parametrize(
    "text",
    [
        "Manufacturer: SIMCOM INCORPORATED Model: SIMCOM_SIM5360E",
        "SIMCOM_SIM7600JC-H",
        "SIMCOM_SIM7500E",
        "SIM7100E",
        "SIM7670G",
        "SIM7906E",
        "SIMCOM_SIM8200EA-M2",
        "SIM8380G",
        "Model: A7670E-LASE Revision: A7670M7_V1.11.1",
        "SIMCOM_A7672S",
    ],
)
def test_it_knows_its_modems(text):
    assert Sim7600.identifies.search(text)


@pytest.mark.parametrize("text", ["SIMCOM_SIM7000G", "SIM7070G", "SIM800 R14.18", "EC25EFAR06A7670", "SIM868"])
def test_it_leaves_others(text):
    assert not Sim7600.identifies.search(text)


def converse(dialogue, exchange):
    """Result of a dialogue over [(command, answer lines, final), ...], all of which must be used."""
    command = next(dialogue)
    for number, (text, lines, final) in enumerate(exchange, 1):
        assert command.text == text
        try:
            command = dialogue.send(Reply(text, tuple(lines), final))
        except StopIteration as stop:
            assert number == len(exchange)
            return stop.value
    pytest.fail(f"asks on: {command.text}")


def test_setup():
    quiet = [(text, [], "OK") for text in ("AT", "ATE0", "ATV1", "AT+CMEE=1")]
    assert converse(MODEM.setup(), quiet) is True
    assert converse(MODEM.setup(), [("AT", [], None)] * AUTOBAUD_TRIES) is False


ASKED = ("AT+CPSI?", "AT+CCINFO", "AT+CMGRMI=4", "AT+CESQ")


def polled(*answers):
    return converse(MODEM.poll(), [(text, *answer) for text, answer in zip(ASKED, answers, strict=True)])


def test_poll_names_the_serving_cell_once():
    serving, *others = polled(([CPSI], "OK"), ([], "ERROR"), (CMGRMI, "OK"), (["+CESQ: 99,99,255,255,20,51"], "OK"))
    assert (serving.cid, serving.rsrp_dbm, serving.role) == (22060, -88.9, "serving")
    assert [row.pci for row in others if isinstance(row, CellReading)] == [77, 455, 130]


def test_poll_takes_the_network_from_the_line_that_knows_it():
    cpsi = "+CPSI: WCDMA,Online,505-01,0x0152,14302219,WCDMA 850,214,4436,0,12.5,83,23,36,500"
    serving, neighbour = polled(([cpsi], "OK"), ([WCDMA, WCDMA_NEIGHBOUR], "OK"), ([], "ERROR"), ([], "ERROR"))
    assert (serving.cell, serving.rscp_dbm, neighbour.role) == ("505-01-338-14302219", -83.0, "neighbour")


def test_first_answer_after_power_up_is_an_error():
    assert polled(*[([], "ERROR")] * 4) is None
    assert polled(*[([], None)] * 4) is None
    rows = polled(([], "ERROR"), ([GSM], "OK"), ([], "+CME ERROR: 3"), ([], None))
    assert [row.cid for row in rows if isinstance(row, CellReading)] == [31]


def test_poll_without_service():
    rows = polled((["+CPSI: NO SERVICE,Online"], "OK"), ([], "OK"), ([], "ERROR"), ([], "ERROR"))
    assert rows == (NoCell(status="NO SERVICE", state="Online"),)


def test_recorded_replies(corpus):
    dialects = ("simcom_cpsi", "simcom_ccinfo", "simcom_cnwinfo", "simcom_boot", "simcom_cgpsinfo", "simcom_csq")
    found = [entry for entry in entries(corpus, *dialects) if "SIM7000" not in entry["source"]]
    assert len(found) >= 15
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])
