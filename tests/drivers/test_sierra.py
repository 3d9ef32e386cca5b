import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.dialogue import Reply
from logger.drivers.rows import NoCell, Operator, as_json
from logger.drivers.sierra import Sierra
from tests.kit.corpus import check_entry, entries, lines_of

MODEM = Sierra()

# In the forms of MC7700, MC7304, MC7455, WP7607 and EM7565 as public logs have them; the numbers are our own.
LTE = [
    "!GSTATUS: ",
    "Current Time:  444231\t\tTemperature: 32",
    "System mode:   LTE        \tPS state:    Attached     ",
    "LTE band:      B7     \t\tLTE bw:      20 MHz  ",
    "LTE Rx chan:   3110\t\tLTE Tx chan: 21110",
    "EMM state:     Registered     \tNormal Service ",
    "",
    "PCC RxM RSSI:  -89\t\tPCC RxM RSRP:  -117",
    "PCC RxD RSSI:  -80\t\tPCC RxD RSRP:  -110",
    "SCC RxM RSSI:  -70\t\tSCC RxM RSRP:  -100",
    "Tx Power:      --\t\tTAC:         1389 (5001)",
    "RSRQ (dB):     -8.0\t\tCell ID:     00005101 (20737)",
    "SINR (dB):      8.6",
    "OK",
]
WCDMA = [
    "AT!GSTATUS?",
    "!GSTATUS: ",
    "System mode:   WCDMA            PS state:    Attached     ",
    "WCDMA band:    WCDMA 2100 ",
    "WCDMA channel: 10662",
    "RX level C0:   -68              LAC:         1389 (5001)",
    "RX level C1:   -106             Cell ID:     01F5C481 (32883841)",
    "OK",
]
GSM = [
    "!GSTATUS:",
    "System mode: GSM PS state: Not attached",
    "GSM band: GSM900",
    "GSM channel: 1003",
    "RX level (dBm):-57 LAC: 1389 (5001)",
    "Serving Cell: 3 Cell ID: 0000C481 (50305)",
    "OK",
]
LTEINFO = [
    "!LTEINFO: ",
    "Serving:   EARFCN MCC MNC   TAC      CID Bd D U SNR PCI  RSRQ   RSRP   RSSI RXLV",
    "              800 310 410  5001 0A14666A  2 5 5  22 404 -14.1  -79.6  -45.5 --",
    "",
    "IntraFreq:                                          PCI  RSRQ   RSRP   RSSI RXLV",
    "                                                    404 -14.1  -79.6  -45.5 --",
    "                                                    402 -20.0  -89.3  -57.6 --",
    "",
    "InterFreq: EARFCN ThresholdLow ThresholdHi Priority PCI  RSRQ   RSRP   RSSI RXLV",
    "             5110            0           0        0 272 -12.1  -80.9  -50.6   0",
    "WCDMA:     UARFCN ThreshL ThreshH Prio PSC   RSCP   ECN0 RXLV",
    "            10662       0       0    0  77  -95.0  -12.5 --",
    "GSM:       ThreshL ThreshH Prio NCC ARFCN 1900 valid BSIC RSSI RXLV",
    "OK",
]
SAMPLES = ["\n".join(sample) for sample in (LTE, WCDMA, GSM, LTEINFO)]


@pytest.mark.parametrize("dialect", ["sierra_gstatus", "sierra_lteinfo"])
def test_recorded_replies(corpus, dialect):
    recorded = entries(corpus, dialect)
    assert recorded
    for entry in recorded:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


def one(lines):
    found = MODEM.cells_in(lines)
    assert len(found) == 1
    return found[0]


def who(reading):
    return reading.mcc, reading.mnc, reading.tac if reading.lac is None else reading.lac, reading.cid


# --- forms


def test_lte():
    assert one(LTE) == CellReading(
        role="serving",
        rat="LTE",
        tac=5001,
        cid=20737,
        arfcn=3110,
        band="B7",
        rssi_dbm=-89.0,
        rsrp_dbm=-117.0,
        rsrq_db=-8.0,
        sinr_db=8.6,
    )


def test_wcdma_and_gsm():
    wcdma, gsm = MODEM.cells_in([*WCDMA, *GSM])
    assert (wcdma.rat, wcdma.lac, wcdma.cid, wcdma.arfcn) == ("WCDMA", 5001, 32883841, 10662)
    assert (wcdma.rssi_dbm, wcdma.band) == (-68.0, "WCDMA 2100")
    assert (gsm.rat, gsm.lac, gsm.cid, gsm.arfcn) == ("GSM", 5001, 50305, 1003)
    assert (gsm.rssi_dbm, gsm.band) == (-57.0, "GSM900")


@pytest.mark.parametrize(
    "lines",
    [
        [re.sub(r"\s+", " ", line) for line in LTE],
        [f"{number}:[{' '.join(line.split())}]" for number, line in enumerate(["AT!GSTATUS?", *LTE[1:]])],
        [f"2022-03-15 17:03:01 {line}" for line in LTE],
        [line.replace("\t", "        ").upper() for line in LTE],
        ["\\r\\n".join(line.replace("\t", "\\t") for line in LTE)],
        LTE[1:],
        LTE[:-1],
        ["AT!GSTATUS?", *LTE, "AT+CREG?", '+CREG: 2,1,"FFFE","5101",7', "OK"],
    ],
)
def test_logs_write_it_in_many_ways(lines):
    assert one(lines) == one(LTE)


def test_levels_of_older_and_newer_labels():
    older = [
        re.sub("PCC RxM RSSI:  -89", "RSSI (dBm):    -89", line).replace("PCC RxM RSRP", "RSRP (dBm)") for line in LTE
    ]
    mixed = [line.replace("PCC RxM RSRP", "RSRP (dBm)").replace("CC RxD RSRP", "CC RSRP (dBm)") for line in LTE]
    for lines in (older, mixed):
        assert (one(lines).rssi_dbm, one(lines).rsrp_dbm) == (-89.0, -117.0)
    absent = [line.replace("-117", "--") for line in mixed]
    assert one(absent).rsrp_dbm is None


def test_unknown_values():
    row = one(
        [line.replace("1389 (5001)", "FFFF (65535)").replace("3110", "65535").replace("B7", "--") for line in LTE]
    )
    assert (row.tac, row.cid, row.arfcn, row.band) == (None, 20737, None, None)
    assert one([*WCDMA[:3], "WCDMA band: Unknown", *WCDMA[4:]]).band is None


def test_no_service():
    assert one(["!GSTATUS:", "System mode:   NO SERVICE       PS state:    Not attached"]) == NoCell(
        status="NO SERVICE"
    )
    assert one(["!GSTATUS:", "System mode:   LTE              PS state:    Not attached"]) == NoCell(
        "LTE", status="LTE"
    )
    assert MODEM.cells_in(["!GSTATUS:", "Temperature: 32", "OK"]) == ()


def test_table():
    serving, intra, inter, wcdma = MODEM.cells_in(LTEINFO)
    assert (serving.cell, serving.arfcn, serving.band, serving.pci) == ("310-410-5001-169109098", 800, 2, 404)
    assert (serving.rsrp_dbm, serving.rsrq_db, serving.rssi_dbm, serving.sinr_db) == (-79.6, -14.1, -45.5, 22.0)
    assert (intra.role, intra.pci, intra.arfcn, intra.rsrp_dbm) == ("neighbour", 402, 800, -89.3)
    assert (inter.pci, inter.arfcn, inter.more["srxlev"]) == (272, 5110, 0)
    assert (wcdma.rat, wcdma.psc, wcdma.arfcn, wcdma.rscp_dbm, wcdma.ecio_db) == ("WCDMA", 77, 10662, -95.0, -12.5)
    assert MODEM.cells_in([f"17:03:01.250 {line}" for line in LTEINFO]) == (serving, intra, inter, wcdma)


# --- damage


@pytest.mark.parametrize(("good", "bad"), [("00005101 (20737)", "00005101 (20737"), ("(20737)", "")])
def test_place_without_its_number_in_brackets_is_no_place(good, bad):
    assert who(one([line.replace(good, bad) for line in LTE]))[3] is None


@pytest.mark.parametrize(
    ("good", "bad"), [("310 410", "310410"), ("0A14666A", "0A1466A"), ("800 310", "800 0 310"), ("5001", "5-01")]
)
def test_damaged_row_of_a_table_is_no_cell(good, bad):
    assert not any(row.cell for row in MODEM.cells_in([line.replace(good, bad) for line in LTEINFO]))


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_replies_tell_nothing_else(sample):
    nobody = (None, None, None, None)
    identities = {nobody, *(who(row) for row in MODEM.cells_in(sample.split("\n")))}
    for end in range(len(sample)):
        for row in MODEM.cells_in(sample[:end].split("\n")):
            assert isinstance(row, NoCell) or who(row) in identities, sample[:end]


def test_no_mutation_makes_up_an_identity():
    rng = random.Random(7)
    for _ in range(3000):
        text = mutated(rng.choice(SAMPLES), rng)
        numbers = {int(word, 16) for word in re.findall("[0-9A-Fa-f]+", text)} | set(
            map(int, re.findall("[0-9]+", text))
        )
        for row in MODEM.read(text.split("\n")):
            if isinstance(row, CellReading):
                assert {row.lac, row.cid, row.tac} - {None} <= numbers, text
                assert row.mcc is None or row.mcc in text, text


def mutated(text, rng):
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(text))
        change = rng.randrange(4)
        if change == 0:
            text = text[:at] + chr(ord(text[at]) ^ 1 << rng.randrange(7)) + text[at + 1 :]
        elif change == 1:
            text = text[:at] + text[at + rng.randint(1, 9) :] or " "
        elif change == 2:
            text = text[:at] + rng.choice('0,"\n :I-^AF9()') + text[at:]
        else:
            text = text[: at + 30] + text[at:]
    return text


# --- conversation


def converse(dialogue, replies, default=((), "ERROR")):
    """Result of a dialogue; `replies` is (lines, final) by command."""
    try:
        command = next(dialogue)
        while True:
            lines, final = replies.get(command.text, default)
            command = dialogue.send(Reply(command.text, tuple(lines), final))
    except StopIteration as stop:
        return stop.value


def cops(act):
    return {"AT+COPS?": ([f'+COPS: 0,2,"25501",{act}'], "OK")}


def test_setup():
    assert converse(MODEM.setup(), {}, ((), "OK")) is True
    assert converse(MODEM.setup(), {"AT": ((), "OK")}) is True
    assert converse(MODEM.setup(), {}, ((), None)) is False


def test_poll_takes_the_network_from_the_operator_of_that_technology():
    operator, cell = converse(MODEM.poll(), {"AT!GSTATUS?": (GSM, "OK"), **cops(0)})[::-1]
    assert (cell.cell, operator) == ("255-01-5001-50305", Operator("GSM", plmn="25501", act=0))
    assert converse(MODEM.poll(), {"AT!GSTATUS?": (GSM, "OK"), **cops(7)})[0].mcc is None
    assert converse(MODEM.poll(), {"AT!GSTATUS?": (GSM, "OK")})[0].mcc is None


def test_poll_tells_the_serving_cell_once():
    rows = converse(MODEM.poll(), {"AT!GSTATUS?": (LTE, "OK"), "AT!LTEINFO?": (LTEINFO, "OK"), **cops(7)})
    assert [row.cell for row in rows if isinstance(row, CellReading) and row.role == "serving"] == [
        "310-410-5001-169109098"
    ]


@pytest.mark.parametrize("final", [None, "ERROR", "+CME ERROR: 100"])
def test_poll_without_an_answer(final):
    assert converse(MODEM.poll(), {}, ((), final)) is None


def test_commands_listen_only():
    for command in (*MODEM.set_up, *MODEM.asked, *MODEM.surveys):
        assert not re.search(r"ATD|COPS=[0124]|CGATT|CFUN|CIMI|CGSN|CCID|CNUM|ENTERCND", command.text)


@pytest.mark.parametrize("identity", ["Manufacturer: Sierra Wireless, Incorporated Model: MC7455", "AirPrime MC8790"])
def test_own_modems(identity):
    assert MODEM.identifies.search(identity)


@pytest.mark.parametrize(
    "identity", ["HL8548 Sierra Wireless", "Sierra Wireless SL8082T", "Telit LE910C1", "SIMCOM_SIM800L"]
)
def test_modems_of_others(identity):
    assert not MODEM.identifies.search(identity)
