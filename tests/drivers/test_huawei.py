import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.dialogue import Reply
from logger.drivers.huawei import Huawei
from logger.drivers.rows import NoCell, Signal, as_json
from tests.kit.corpus import check_entry, entries, lines_of

MODEM = Huawei()

# GSM, LTE and NR are of public logs, the others made by the format strings of the firmware (firmware_notes/huawei.md).
GSM = "^MONSC: GSM,460,00,1,12,49,2D54,57B2,-68,,"
WCDMA = "^MONSC: WCDMA,460,01,10713,77,228FF,143,-79,-62,-7,64,1"
LTE = "^MONSC: LTE,460,11,1750,B26F9B2,DF,5D63,-91,-14,-56"
NR = "^MONSC: NR,460,00,524910,1,C027F5065,114,14225C,-73,-9,24"
NEIGHBOURS = [
    "^MONNC: GSM,2,600,21,2D55,57B2,-80",
    "^MONNC: WCDMA,10713,96,-95,-12",
    "^MONNC: LTE,1850,64,-85,-12,-50",
    "^MONNC: NR,524910,17F,-84,-12,0",
]
SAMPLES = [GSM, WCDMA, LTE, NR, *NEIGHBOURS]
NOBODY = (None, None, None, None)


@pytest.mark.parametrize("dialect", ["huawei_monsc", "huawei_monnc", "huawei_hcsq"])
def test_recorded_replies(corpus, dialect):
    recorded = entries(corpus, dialect)
    assert recorded
    for entry in recorded:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


def one(*lines):
    found = MODEM.cells_in(lines)
    assert len(found) == 1
    return found[0]


def who(reading):
    return reading.mcc, reading.mnc, reading.tac if reading.lac is None else reading.lac, reading.cid


# --- forms


def test_gsm():
    assert one(GSM) == CellReading(
        role="serving",
        rat="GSM",
        mcc="460",
        mnc="00",
        lac=0x57B2,
        cid=0x2D54,
        arfcn=12,
        band=900,
        bsic=49,
        rssi_dbm=-68.0,
    )
    assert (one(GSM.replace("-68,,", "-68,3,7")).rxq, one(GSM.replace("-68,,", "-68,3,7")).ta) == (3, 7)


def test_wcdma():
    cell = one(WCDMA)
    assert (cell.cell, cell.psc, cell.rscp_dbm, cell.rssi_dbm) == ("460-01-323-141567", 77, -79.0, -62.0)
    assert cell.ecio_db == -7.0
    empty = one("^MONSC: WCDMA,460,01,10713,,228FF,143,,,,,")
    assert (empty.cell, empty.psc, empty.rscp_dbm) == ("460-01-323-141567", None, None)


def test_lte_and_nr_have_a_hexadecimal_pci():
    lte, nr = MODEM.cells_in([LTE, NR])
    assert (lte.cell, lte.pci, lte.arfcn) == ("460-11-23907-187103666", 0xDF, 1750)
    assert (lte.rsrp_dbm, lte.rsrq_db, lte.rssi_dbm) == (-91.0, -14.0, -56.0)
    assert (nr.cell, nr.pci, nr.arfcn) == ("460-00-1319516-51581505637", 0x114, 524910)
    assert (nr.rsrp_dbm, nr.rsrq_db, nr.sinr_db) == (-73.0, -9.0, 24.0)


def test_neighbours():
    gsm, wcdma, lte, nr = MODEM.cells_in(NEIGHBOURS)
    assert {cell.role for cell in (gsm, wcdma, lte, nr)} == {"neighbour"}
    assert (who(gsm), gsm.arfcn, gsm.band, gsm.bsic, gsm.rssi_dbm) == (
        (None, None, 0x57B2, 0x2D55),
        600,
        1800,
        21,
        -80.0,
    )
    assert (wcdma.psc, wcdma.rscp_dbm, wcdma.ecio_db) == (96, -95.0, -12.0)
    assert (lte.pci, lte.rsrp_dbm, lte.rsrq_db, lte.rssi_dbm) == (0x64, -85.0, -12.0, -50.0)
    assert (nr.pci, nr.sinr_db) == (0x17F, 0.0)
    assert (who(one("^MONNC: GSM,2,600,,,,-80")), one("^MONNC: GSM,2,600,,,,-80").bsic) == (NOBODY, None)


def test_values_that_are_not_measured_or_unknown():
    nr = one("^MONNC: NR,524910,115,-157,-44,-24")
    assert (nr.pci, nr.rsrp_dbm, nr.rsrq_db, nr.sinr_db) == (0x115, None, None, None)
    assert one("^MONNC: NR,643456,1A,-760,-96,-320").rsrp_dbm is None  # eighths of a dB, on some firmware
    assert who(one(GSM.replace("2D54,57B2", "FFFF,FFFE"))) == ("460", "00", None, None)
    assert who(one(GSM.replace("460,00", "000,00"))) == NOBODY


def test_no_cell():
    assert one("^MONSC: NONE") == NoCell(status="NONE")
    assert MODEM.cells_in(["^MONNC: NONE"]) == ()
    assert one('^HCSQ: "NOSERVICE"') == one("^HCSQ: NOSERVICE") == NoCell(status="NOSERVICE")
    assert MODEM.cells_in(['^HCSQ: "LTE"']) == ()


@pytest.mark.parametrize("text", ['"LTE",30,19,66,0', "LTE,30,19,66,0", ' "LTE", 30,19,66,0', '"lte",30,19,66,0'])
def test_signal_of_lte(text):
    assert one(f"^HCSQ:{text}") == Signal(
        "LTE", rssi_dbm=-91.0, rsrp_dbm=-122.0, sinr_db=-7.0, rsrq_db=None, more={"raw": [30, 19, 66, 0]}
    )


def test_signal_of_others():
    assert one('^HCSQ: "GSM",36,255') == Signal("GSM", rssi_dbm=-85.0, more={"raw": [36, 255]})
    wcdma = one('^HCSQ: "WCDMA",30,255,58')
    assert (wcdma.rssi_dbm, wcdma.rscp_dbm, wcdma.ecio_db) == (-91.0, None, -3.5)
    assert one('^HCSQ: "NR",70,80,60') == Signal("NR", more={"raw": [70, 80, 60]})


def test_cells_of_the_gsm_modules():
    assert one("^SMONC: 460,00,57B2,2D54,49,12,42,30,30").cell == "460-00-22450-11604"


def test_logs_around_a_row():
    for text in (
        f"[17:03:01.250] < {GSM}",
        GSM.lower(),
        f"'\\r\\n{GSM}\\r\\n\\r\\nOK\\r\\n'",
        f'"{GSM}"',
        GSM.replace(",", ", "),
    ):
        assert one(text).cell == "460-00-22450-11604"


def test_unasked_rows():
    assert MODEM.is_row(GSM)
    assert MODEM.opens_block(GSM)
    assert not MODEM.opens_block(NEIGHBOURS[0])
    assert not MODEM.is_row('^HCSQ:"LTE",30,19,66,0')


# --- damage


@pytest.mark.parametrize(
    "row",
    [
        GSM.replace("460,00", "46000"),
        GSM.replace("2D54,57B2", "2D5457B2"),
        GSM.replace("49,2D54", "492D54"),
        GSM.replace(",57B2", ""),
        GSM.replace("GSM", "TD_SCDMA"),
        LTE.replace("DF,5D63", "DF5D63"),
        LTE.replace("1750", "17G0"),
        GSM + ",1,2,3",
        GSM[: GSM.index(",-68")],
    ],
)
def test_damaged_row_names_no_cell(row):
    assert MODEM.cells_in([row]) == ()


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_rows_tell_nothing_else(sample):
    whole = who(one(sample))
    for end in range(len(sample)):
        assert {who(row) for row in MODEM.cells_in([sample[:end]])} <= {whole}


def test_no_mutation_makes_up_an_identity():
    rng = random.Random(6)
    for _ in range(4000):
        text = mutated(rng.choice(SAMPLES), rng)
        numbers = {int(word, 16) for word in re.findall("[0-9A-Fa-f]+", text)}
        for row in MODEM.read(text.split("\n")):
            if isinstance(row, CellReading):
                assert {row.lac, row.cid, row.tac} - {None} <= numbers, text
                assert row.mcc is None or row.mcc in text, text


def mutated(text, rng):
    for _ in range(rng.randint(1, 3)):
        at, to = sorted((rng.randrange(len(text)), rng.randrange(len(text))))
        change = rng.randrange(4)
        if change == 0:
            text = text[:at] + chr(ord(text[at]) ^ 1 << rng.randrange(7)) + text[at + 1 :]
        elif change == 1:
            text = text[:at] + text[at + rng.randint(1, 9) :] or " "
        elif change == 2:
            text = text[:at] + rng.choice('0,"\n :I-^AF9') + text[at:]
        else:
            text = text[:to] + text[at:]
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
    "AT+COPS?": (['+COPS: 0,2,"46000",7'], "OK"),
    "AT+CEREG?": (['+CEREG: 2,1,"24C8","D975244",7'], "OK"),
    "AT^HCSQ?": (['^HCSQ: "LTE",30,51,66,10'], "OK"),
}


def test_setup():
    assert converse(MODEM.setup(), {}, ((), "OK")) is True
    assert converse(MODEM.setup(), {"AT": ((), "OK")}) is True
    assert converse(MODEM.setup(), {}, ((), None)) is False


def test_poll():
    rows = converse(MODEM.poll(), {"AT^MONSC": ([GSM], "OK"), "AT^MONNC": (NEIGHBOURS[:1], "OK"), **COMMON})
    assert [row.role for row in rows if isinstance(row, CellReading)] == ["serving", "neighbour"]
    rows = converse(MODEM.poll(), {"AT^SMOND": (["^SMOND:460,00,57B2,2D54,49,12,68,,,0,,,0"], "OK")})
    assert [row.cell for row in rows if isinstance(row, CellReading)] == ["460-00-22450-11604"]


def test_poll_of_a_modem_that_does_not_know_monsc():
    serving, *_ = converse(MODEM.poll(), COMMON)
    assert (serving.role, serving.cell, serving.rsrp_dbm) == ("serving", "460-00-9416-228020804", -90.0)


@pytest.mark.parametrize("final", [None, "ERROR", "+CME ERROR: 100"])
def test_poll_without_an_answer(final):
    assert converse(MODEM.poll(), {}, ((), final)) is None


def test_rows_before_a_time_out_are_kept():
    assert converse(MODEM.poll(), {"AT^MONSC": ([GSM], None)}, ((), None)) == (one(GSM),)


def test_commands_listen_only():
    for command in (*MODEM.set_up, *MODEM.asked, *MODEM.surveys):
        assert not re.search(r"ATD|COPS=[0124]|CGATT|CFUN|CIMI|CGSN|CCID|CNUM", command.text)


@pytest.mark.parametrize("identity", ["Manufacturer: huawei Model: E3372", "HUAWEI MG323", "TD Tech Ltd MT5700M-CN"])
def test_own_modems(identity):
    assert MODEM.identifies.search(identity)


@pytest.mark.parametrize("identity", ["SIMCOM_SIM800L", "Telit LE910C1", "Quectel EC25", "Sierra Wireless MC7455"])
def test_modems_of_others(identity):
    assert not MODEM.identifies.search(identity)
