import re

import pytest

from logger.core.types import CellReading
from logger.drivers.reading.row_language import NoCell, Operator
from logger.drivers.sierra import Sierra
from tests.kit.corpus import check_recorded
from tests.kit.drivers import check_cuts, identity_of, run_dialogue

MODEM = Sierra()

# Values of our own under the labels of firmware_notes/sierra.md.
LTE = [
    "!GSTATUS: ",
    "Current Time:  271828\t\tTemperature: 31",
    "System mode:   LTE        \tPS state:    Attached     ",
    "LTE band:      B3     \t\tLTE bw:      20 MHz  ",
    "LTE Rx chan:   1444\t\tLTE Tx chan: 19444",
    "EMM state:     Registered     \tNormal Service ",
    "",
    "PCC RxM RSSI:  -83\t\tPCC RxM RSRP:  -111",
    "PCC RxD RSSI:  -78\t\tPCC RxD RSRP:  -106",
    "SCC RxM RSSI:  -72\t\tSCC RxM RSRP:  -102",
    "Tx Power:      --\t\tTAC:         2B67 (11111)",
    "RSRQ (dB):     -9.5\t\tCell ID:     01234567 (19088743)",
    "SINR (dB):     11.2",
    "OK",
]
WCDMA = [
    "AT!GSTATUS?",
    "!GSTATUS: ",
    "System mode:   WCDMA            PS state:    Attached     ",
    "WCDMA band:    WCDMA 2100 ",
    "WCDMA channel: 10713",
    "RX level C0:   -71              LAC:         2B68 (11112)",
    "RX level C1:   -104             Cell ID:     03F4A5B6 (66364854)",
    "OK",
]
GSM = [
    "!GSTATUS:",
    "System mode: GSM PS state: Not attached",
    "GSM band: GSM900",
    "GSM channel: 987",
    "RX level (dBm):-63 LAC: 2B69 (11113)",
    "Serving Cell: 5 Cell ID: 00009C5D (40029)",
    "OK",
]
LTEINFO = [
    "!LTEINFO: ",
    "Serving:   EARFCN MCC MNC   TAC      CID Bd D U SNR PCI  RSRQ   RSRP   RSSI RXLV",
    "             1444 262  03 11111 01234567  3 5 5  19 303 -11.3  -91.4  -61.2 --",
    "",
    "IntraFreq:                                          PCI  RSRQ   RSRP   RSSI RXLV",
    "                                                    303 -11.3  -91.4  -61.2 --",
    "                                                    305 -15.2  -99.7  -68.0 --",
    "",
    "InterFreq: EARFCN ThresholdLow ThresholdHi Priority PCI  RSRQ   RSRP   RSSI RXLV",
    "             6300            0           0        0 211 -13.4  -97.2  -66.1   4",
    "WCDMA:     UARFCN ThreshL ThreshH Prio PSC   RSCP   ECN0 RXLV",
    "            10713       0       0    0 117  -97.0  -11.5 --",
    "GSM:       ThreshL ThreshH Prio NCC ARFCN 1900 valid BSIC RSSI RXLV",
    "OK",
]
SAMPLES = ["\n".join(sample) for sample in (LTE, WCDMA, GSM, LTEINFO)]


@pytest.mark.parametrize("dialect", ["sierra_gstatus", "sierra_lteinfo"])
def test_recorded_replies(corpus, dialect):
    check_recorded(corpus, MODEM, dialect)


def one(lines):
    found = MODEM.rows_in(lines)
    assert len(found) == 1
    return found[0]


# --- forms


def test_lte():
    assert one(LTE) == CellReading(
        role="serving",
        rat="LTE",
        tac=11111,
        cid=19088743,
        arfcn=1444,
        band="B3",
        rssi_dbm=-83.0,
        rsrp_dbm=-111.0,
        rsrq_db=-9.5,
        sinr_db=11.2,
    )


def test_wcdma_and_gsm():
    wcdma, gsm = MODEM.rows_in([*WCDMA, *GSM])
    assert (wcdma.rat, wcdma.lac, wcdma.cid, wcdma.arfcn) == ("WCDMA", 11112, 66364854, 10713)
    assert (wcdma.rssi_dbm, wcdma.band) == (-71.0, "WCDMA 2100")
    assert (gsm.rat, gsm.lac, gsm.cid, gsm.arfcn) == ("GSM", 11113, 40029, 987)
    assert (gsm.rssi_dbm, gsm.band) == (-63.0, "GSM900")


@pytest.mark.parametrize(
    "lines",
    [
        [re.sub(r"\s+", " ", line) for line in LTE],
        [
            f"{number}:[{' '.join(line.split())}]"
            for number, line in enumerate(["AT!GSTATUS?", *LTE[1:]])
        ],
        [f"2022-03-15 17:03:01 {line}" for line in LTE],
        [line.replace("\t", "        ").upper() for line in LTE],
        ["\\r\\n".join(line.replace("\t", "\\t") for line in LTE)],
        LTE[1:],
        LTE[:-1],
        ["AT!GSTATUS?", *LTE, "AT+CREG?", '+CREG: 2,1,"FFFE","1234567",7', "OK"],
    ],
)
def test_logs_write_it_in_many_ways(lines):
    assert one(lines) == one(LTE)


def test_levels_of_older_and_newer_labels():
    older = [
        re.sub("PCC RxM RSSI:  -83", "RSSI (dBm):    -83", line).replace(
            "PCC RxM RSRP", "RSRP (dBm)"
        )
        for line in LTE
    ]
    mixed = [
        line.replace("PCC RxM RSRP", "RSRP (dBm)").replace("CC RxD RSRP", "CC RSRP (dBm)")
        for line in LTE
    ]
    for lines in (older, mixed):
        assert (one(lines).rssi_dbm, one(lines).rsrp_dbm) == (-83.0, -111.0)
    absent = [line.replace("-111", "--") for line in mixed]
    assert one(absent).rsrp_dbm is None


def test_unknown_values():
    row = one(
        [
            line.replace("2B67 (11111)", "FFFF (65535)")
            .replace("1444", "65535")
            .replace("B3", "--")
            for line in LTE
        ]
    )
    assert (row.tac, row.cid, row.arfcn, row.band) == (None, 19088743, None, None)
    assert one([*WCDMA[:3], "WCDMA band: Unknown", *WCDMA[4:]]).band is None


def test_no_service():
    assert one(
        ["!GSTATUS:", "System mode:   NO SERVICE       PS state:    Not attached"]
    ) == NoCell(status="NO SERVICE")
    assert one(
        ["!GSTATUS:", "System mode:   LTE              PS state:    Not attached"]
    ) == NoCell("LTE", status="LTE")
    assert MODEM.rows_in(["!GSTATUS:", "Temperature: 32", "OK"]) == ()


def test_table():
    serving, intra, inter, wcdma = MODEM.rows_in(LTEINFO)
    assert (serving.cell, serving.arfcn, serving.band, serving.pci) == (
        "262-03-11111-19088743",
        1444,
        3,
        303,
    )
    assert (serving.rsrp_dbm, serving.rsrq_db, serving.rssi_dbm, serving.sinr_db) == (
        -91.4,
        -11.3,
        -61.2,
        19.0,
    )
    assert (intra.role, intra.pci, intra.arfcn, intra.rsrp_dbm) == ("neighbour", 305, 1444, -99.7)
    assert (inter.pci, inter.arfcn, inter.more["srxlev"]) == (211, 6300, 4)
    assert (wcdma.rat, wcdma.psc, wcdma.arfcn, wcdma.rscp_dbm, wcdma.ecio_db) == (
        "WCDMA",
        117,
        10713,
        -97.0,
        -11.5,
    )
    assert MODEM.rows_in([f"17:03:01.250 {line}" for line in LTEINFO]) == (
        serving,
        intra,
        inter,
        wcdma,
    )


# --- damage


@pytest.mark.parametrize(
    ("good", "bad"),
    [("(19088743)", "(1908743)"), ("01234567 (", "01234657 ("), ("(11111)", "(1111)")],
)
def test_numbers_that_contradict_each_other_leave_the_identity_unsure(good, bad):
    assert not one(LTE).identity_unsure
    row = one([line.replace(good, bad) for line in LTE])
    assert row.identity_unsure
    assert row.rsrp_dbm == one(LTE).rsrp_dbm


@pytest.mark.parametrize(
    ("good", "bad"), [("01234567 (19088743)", "01234567 (19088743"), ("(19088743)", "")]
)
def test_place_without_its_number_in_brackets_is_no_place(good, bad):
    assert identity_of(one([line.replace(good, bad) for line in LTE]))[3] is None


@pytest.mark.parametrize(
    ("good", "bad"),
    [("262  03", "26203"), ("01234567", "0123456"), ("1444 262", "1444 0 262"), ("11111", "11-11")],
)
def test_damaged_row_of_a_table_is_no_cell(good, bad):
    assert not any(row.cell for row in MODEM.rows_in([line.replace(good, bad) for line in LTEINFO]))


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_replies_read_nothing_else(sample):
    check_cuts(MODEM, sample)


# --- conversation


def cops(act):
    return {"AT+COPS?": ([f'+COPS: 0,2,"26201",{act}'], "OK")}


def test_poll_takes_the_network_from_the_operator_of_that_technology():
    operator, cell = run_dialogue(MODEM.poll(), {"AT!GSTATUS?": (GSM, "OK"), **cops(0)})[0][::-1]
    assert (cell.cell, operator) == ("262-01-11113-40029", Operator("GSM", plmn="26201", act=0))
    assert run_dialogue(MODEM.poll(), {"AT!GSTATUS?": (GSM, "OK"), **cops(7)})[0][0].mcc is None
    assert run_dialogue(MODEM.poll(), {"AT!GSTATUS?": (GSM, "OK")})[0][0].mcc is None


def test_poll_reports_the_serving_cell_once():
    rows = run_dialogue(
        MODEM.poll(), {"AT!GSTATUS?": (LTE, "OK"), "AT!LTEINFO?": (LTEINFO, "OK"), **cops(7)}
    )[0]
    assert [row.cell for row in rows if isinstance(row, CellReading) and row.role == "serving"] == [
        "262-03-11111-19088743"
    ]


def test_the_carrier_of_nr_beside_lte_is_a_reading_of_its_own():
    lines = [
        *(line.replace("LTE        \t", "ENDC       \t") for line in LTE[:-1]),
        "NR5G band:     n78",
        "NR5G dl bw:    100 MHz\t\tNR5G ul bw:  100 MHz",
        "NR5G Tx chan:  636666\t\tNR5G Rx chan: 636666",
        "NR5G RSRP (dBm): -93\t\tNR5G RSRQ (dB): -11",
        "NR5G SINR (dB):  15.5",
        "OK",
    ]
    lte, nr = MODEM.read(lines)
    assert (lte.rat, lte.band, lte.rsrp_dbm) == ("LTE", "B3", -111.0)
    assert nr == CellReading(
        "serving",
        "NR",
        arfcn=636666,
        band="n78",
        rsrp_dbm=-93.0,
        rsrq_db=-11.0,
        sinr_db=15.5,
    )
    without_level = [line.replace("-93", "--").replace("-11\n", "--") for line in lines]
    assert [row.rat for row in MODEM.read(without_level)] == ["LTE"]


# --- written after the WP77xx and EM75xx AT references: forms that no capture has


@pytest.mark.parametrize(("act", "is_named"), [(7, True), (8, True), (9, True), (2, False)])
def test_lte_for_machines_has_its_network_from_the_operator(act, is_named):
    replies = {
        "AT+COPS?": ([f'+COPS: 0,2,"26203",{act}'], "OK"),
        "AT!GSTATUS?": (LTE[:-1], "OK"),
    }
    rows, _ = run_dialogue(MODEM.poll(), replies)
    (serving,) = (row for row in rows if isinstance(row, CellReading))
    assert (serving.cell is not None) == is_named


def test_the_level_of_another_antenna_or_carrier_replaces_none():
    text = "\n".join(LTE).replace("PCC RxM RSRP:", "RSRP (dBm):")
    text = text.replace("PCC RxD RSRP:", "RSRP (dBm):").replace("SCC RxM RSRP:", "RSRP (dBm):")
    (whole,) = MODEM.read(text.split("\n"))
    damaged = text.replace("RSRP (dBm):  -111", "RSRP (dBm):  -1\x7f1")
    (without,) = MODEM.read(damaged.split("\n"))
    lost = [line for line in text.split("\n") if "-111" not in line]
    (alone,) = MODEM.read(lost)
    assert (whole.rsrp_dbm, without.rsrp_dbm, alone.rsrp_dbm) == (-111.0, None, None)


def test_nr_alone_is_nr():
    rows = MODEM.read(["!GSTATUS: ", "System mode:   NR5G SA    \tPS state:    Attached     ",
        "NR5G band:     n78    \t\tNR5G bw:     100 MHz ", "NR5G Rx chan:  627264\t\t",
        "NR5G RSRP (dBm):  -95\tNR5G RSRQ (dB):  -11", "OK"])  # fmt: skip
    assert [(row.rat, row.arfcn, row.rsrp_dbm) for row in rows] == [("NR", 627264, -95.0)]


def test_without_the_serving_row_no_row_of_its_channel_is_a_neighbour():
    lines = [line for line in LTEINFO if "01234567" not in line]
    assert [row.pci or row.psc for row in MODEM.read(lines)] == [211, 117]


@pytest.mark.parametrize(("tac", "is_unsure"), [("11111", False), ("02567", True)])
def test_an_area_of_the_tables_that_the_status_contradicts_is_unsure(tac, is_unsure):
    # written after the EM75xx AT reference; were the table hexadecimal there, digits would not show
    tables = [line.replace("11111", tac) for line in LTEINFO[:-1]]
    replies = {"AT!GSTATUS?": (LTE[:-1], "OK"), "AT!LTEINFO?": (tables, "OK")}
    rows, _ = run_dialogue(MODEM.poll(), replies)
    (serving,) = (row for row in rows if isinstance(row, CellReading) and row.role == "serving")
    assert (serving.tac, serving.identity_unsure) == (int(tac), is_unsure)
