import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.dialogue import Reply
from logger.drivers.fibocom import Fibocom
from logger.drivers.rows import NoCell, as_json
from tests.kit.corpus import check_entry, entries, lines_of

MODEM = Fibocom()

# HEADED of 4IceG/luci-app-3ginfo-lite 32, BARE as in QModem issue 260 (an FM350), the others in the manual's forms.
HEADED = [
    "AT+GTCCINFO?",
    "+GTCCINFO:",
    "LTE service cell:",
    "1,4,262,02,BFD3,2D4201,189C,30,120,50,16,42,42,26",
    "LTE neighbor cell:",
    "2,4,,,,,189C,190,,24,24,2",
    "2,4,,,,,64,EA,,12,12,10",
    "",
    "OK",
]
BARE = [
    "+GTCCINFO:",
    "1,4,250,02,81B3,004E31009,1424,280,103,75,-1,33,33,17",
    "",
    "2,4,,,FFFF,00FFFFFFF,3048,454,,25,25,14",
]
EN_DC = [
    "+GTCCINFO:",
    "LTE-NR EN-DC service cell:",
    "1,4,460,11,4F50,52BF337,672,1E4,103,100,44,63,63,24",
    "1,9,460,11,B018,E62AE91,9D8F0,0F6,5078,100,60,78,78,65",
]
UMTS = ["+GTCCINFO:", "UMTS service cell:", "1,2,262,02,143,228FF,2944,60,1,37,41,1,30"]
GSM = ["+GTCCINFO:", "GSM service cell:", "1,1,460,00,57B2,2D54,12,31,900,5,20,33"]
SAMPLES = ["\n".join(sample) for sample in (HEADED, BARE, EN_DC, UMTS, GSM)]


def test_recorded_replies(corpus):
    recorded = entries(corpus, "fibocom")
    assert recorded
    for entry in recorded:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


def who(reading):
    return reading.mcc, reading.mnc, reading.tac if reading.lac is None else reading.lac, reading.cid


# --- forms


def test_modem_with_headings_prints_channel_and_pci_in_hexadecimal():
    serving, first, second = MODEM.cells_in(HEADED)
    assert serving == CellReading(
        role="serving",
        rat="LTE",
        mcc="262",
        mnc="02",
        tac=0xBFD3,
        cid=0x2D4201,
        arfcn=6300,
        band=20,
        pci=48,
        rsrp_dbm=-99.0,
        rsrq_db=-7.0,
        more={"sinr_raw": 16, "rsrp_raw": 42, "rsrq_raw": 26},
    )
    assert (first.role, who(first), first.arfcn, first.pci) == ("neighbour", (None, None, None, None), 6300, 400)
    assert (first.rsrp_dbm, first.rsrq_db, second.arfcn, second.pci) == (-117.0, -19.0, 100, 234)


def test_fm350_prints_them_in_decimal():
    serving, neighbour = MODEM.cells_in(BARE)
    assert (serving.cell, serving.arfcn, serving.pci, serving.band) == ("250-02-33203-81989641", 1424, 280, 3)
    assert (who(neighbour), neighbour.arfcn, neighbour.pci) == ((None, None, None, None), 3048, 454)


def test_the_rows_decide_against_the_headings():
    serving, neighbour = MODEM.cells_in([BARE[0], "LTE service cell:", *BARE[1:]])
    assert (serving.arfcn, neighbour.pci) == (1424, 454)
    serving, *_ = MODEM.cells_in([line for line in HEADED if "cell:" not in line])
    assert (serving.arfcn, serving.pci) == (6300, 48)


def test_where_no_base_fits_the_channel_is_unknown():
    reading, _ = MODEM.cells_in([line.replace("1424", "9999") for line in BARE])
    assert (reading.cell, reading.arfcn, reading.pci) == ("250-02-33203-81989641", None, None)


def test_5g_beside_lte():
    lte, nr = MODEM.cells_in(EN_DC)
    assert (lte.cell, lte.arfcn, lte.pci) == ("460-11-20304-86766391", 1650, 484)
    assert (nr.cell, nr.rat, nr.arfcn, nr.band, nr.pci) == ("460-11-45080-241348241", "NR", 645360, 78, 246)
    assert (nr.rsrp_dbm, nr.rsrq_db) == (-79.0, -11.0)
    filler = MODEM.cells_in([*BARE[:2], "1,9,,,FFFFFFF,00FFFFFFF,645312,130,5078,400,2,49,49,69"])[1]
    assert (who(filler), filler.arfcn, filler.pci) == ((None, None, None, None), 645312, 130)


def test_wcdma_and_gsm():
    (wcdma,), (gsm,) = MODEM.cells_in(UMTS), MODEM.cells_in(GSM)
    assert (wcdma.rat, wcdma.cell, wcdma.arfcn, wcdma.psc) == ("WCDMA", "262-02-323-141567", 10564, 96)
    assert (wcdma.rscp_dbm, wcdma.ecio_db) == (-80.0, -6.0)
    assert (gsm.rat, gsm.cell, gsm.arfcn, gsm.level_dbm) == ("GSM", "460-00-22450-11604", None, None)


def test_no_cell():
    assert MODEM.cells_in(["AT+GTCCINFO?", "+GTCCINFO:", "2,0,0,00,FFFF,0,0,,127,,,,,,,,,", "OK"]) == (NoCell(),)
    assert MODEM.cells_in(["+GTCCINFO:", "OK"]) == ()


def test_network_code_of_one_digit_is_no_network():
    serving, _ = MODEM.cells_in([line.replace("250,02", "250,2") for line in BARE])
    assert who(serving) == (None, None, 0x81B3, 0x4E31009)


def test_logs_around_a_reply():
    whole = MODEM.cells_in(HEADED)
    assert MODEM.cells_in([f"[17:03:01] {line}" for line in HEADED]) == whole
    assert MODEM.cells_in(["\\r\\n".join(HEADED)]) == whole
    assert MODEM.cells_in([line.lower() for line in HEADED]) == whole
    assert MODEM.cells_in([line for line in HEADED if line != "+GTCCINFO:"]) == whole
    assert MODEM.cells_in([*HEADED, "AT+GTCAINFO?", "PCC: 120,48,6300,50,0,1,0,0,42"]) == whole
    assert MODEM.cells_in(HEADED[2:]) == ()


# --- damage


@pytest.mark.parametrize(
    ("good", "bad"), [("262,02", "26202"), ("BFD3,2D4201", "BFD32D4201"), ("BFD3", "BFG3"), (",42,26", "")]
)
def test_damaged_row_names_no_cell(good, bad):
    assert not any(row.cid for row in MODEM.cells_in([line.replace(good, bad) for line in HEADED]))


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_replies_tell_nothing_else(sample):
    identities = {who(row) for row in MODEM.cells_in(sample.split("\n"))}
    for end in range(len(sample)):
        assert {who(row) for row in MODEM.cells_in(sample[:end].split("\n"))} <= identities


def test_no_mutation_makes_up_an_identity():
    rng = random.Random(8)
    for _ in range(4000):
        text = mutated(rng.choice(SAMPLES), rng)
        numbers = {int(word, 16) for word in re.findall("[0-9A-Fa-f]+", text)}
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
            text = text[:at] + rng.choice('0,"\n :I-^AF9') + text[at:]
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


COMMON = {
    "AT+COPS?": (['+COPS: 0,2,"26202",0'], "OK"),
    "AT+CREG?": (['+CREG: 2,1,"0143","83BA",0'], "OK"),
    "AT+CSQ": (["+CSQ: 20,99"], "OK"),
}


def test_setup():
    assert converse(MODEM.setup(), {}, ((), "OK")) is True
    assert converse(MODEM.setup(), {"AT": ((), "OK")}) is True
    assert converse(MODEM.setup(), {}, ((), None)) is False


def test_poll():
    rows = converse(MODEM.poll(), {"AT+GTCCINFO?": (HEADED[1:-1], "OK"), **COMMON})
    assert [row.role for row in rows if isinstance(row, CellReading)] == ["serving", "neighbour", "neighbour"]


def test_poll_where_the_reply_tells_of_no_serving_cell():
    serving, *_ = converse(MODEM.poll(), {"AT+GTCCINFO?": (["+GTCCINFO:"], "OK"), **COMMON})
    assert (serving.cell, serving.rssi_dbm) == ("262-02-323-33722", -73.0)


@pytest.mark.parametrize("final", [None, "ERROR", "+CME ERROR: 100"])
def test_poll_without_an_answer(final):
    assert converse(MODEM.poll(), {}, ((), final)) is None


def test_commands_listen_only():
    for command in (*MODEM.set_up, *MODEM.asked, *MODEM.surveys):
        assert not re.search(r"ATD|COPS=[0124]|CGATT|CFUN|CIMI|CGSN|CCID|CNUM|GTACT|GTRAT", command.text)


@pytest.mark.parametrize("identity", ["Manufacturer: Fibocom Wireless Inc. Model: FM350-GL", "L850-GL"])
def test_own_modems(identity):
    assert MODEM.identifies.search(identity)


@pytest.mark.parametrize("identity", ["SIMCOM_SIM800L", "Telit LE910C1", "Quectel EC25", "u-blox SARA-L850"])
def test_modems_of_others(identity):
    assert not MODEM.identifies.search(identity)
