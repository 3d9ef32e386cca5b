import pytest

from logger.drivers.dialogue import Reply
from logger.drivers.ublox import Ublox

MODEM = Ublox()

CELLINFO = "+UCELLINFO: 1,     2,  310,  410, 7f05, 57b14e2, 395, 1032, 46, 42"
ENVIRONMENT = ['+CGED: RAT:"UMTS",', "Mcc:262, Mnc:  2, Lac:1c96, Ci:bcf4e8d, DLF:10612 , ULF:9662"]


def converse(dialogue, answers):
    """Result of a dialogue with a modem of these answers, and what it was asked; others are refused."""
    asked = []
    try:
        command = next(dialogue)
        while True:
            asked.append(command.text)
            lines, final = answers.get(command.text, ((), "ERROR"))
            command = dialogue.send(Reply(command.text, tuple(lines), final))
    except StopIteration as done:
        return done.value, asked


def test_setup():
    accepted, asked = converse(MODEM.setup(), {"AT": ((), "OK")})
    assert accepted is True
    assert asked[-2:] == ["AT+UCGED=5", "AT+UCGED=2"]
    assert converse(MODEM.setup(), {})[0] is False


def test_poll_asks_until_there_are_cells():
    rows, asked = converse(MODEM.poll(), {"AT+UCELLINFO?": ([CELLINFO], "OK")})
    assert [row.cell for row in rows] == [f"310-410-{0x7F05}-{0x57B14E2}"]
    assert asked == ["AT+COPS?", "AT+CGED=5", "AT+UCELLINFO?"]


@pytest.mark.parametrize(("plmn", "mnc"), [("26202", "02"), ("262002", "002"), ("26203", None), ("26302", None)])
def test_poll_restores_the_zeros_of_a_network_code(plmn, mnc):
    answers = {"AT+CGED=5": (ENVIRONMENT, "OK"), "AT+COPS?": ([f'+COPS: 0,2,"{plmn}",2'], "OK")}
    reading = converse(MODEM.poll(), answers)[0][0]
    assert (reading.mcc, reading.mnc) == ("262", mnc)


def test_poll_of_a_model_with_none_of_the_commands():
    answers = {
        "AT+COPS?": (['+COPS: 0,2,"26202",0'], "OK"),
        "AT+CREG?": (['+CREG: 2,1,"1C96","BCF4",0'], "OK"),
        "AT+CSQ": (["+CSQ: 20,99"], "OK"),
    }
    reading = converse(MODEM.poll(), answers)[0][0]
    assert (reading.cell, reading.rssi_dbm) == (f"262-02-{0x1C96}-{0xBCF4}", -73.0)


def test_poll_without_an_answer_or_a_cell():
    assert converse(MODEM.poll(), {})[0] is None
    assert converse(MODEM.poll(), {"AT+CGED=5": ((), None)})[0] is None
    assert converse(MODEM.poll(), {"AT+CGED=5": ((), "OK")})[0] == ()


def test_scan_only_listens():
    assert [command.text for command in MODEM.surveys] == ["AT+COPS=5"]
    assert MODEM.surveys[0].timeout_s >= 180


@pytest.mark.parametrize(
    "text", ["u-blox SARA-U201 23.60", "SARA-G350-02S-01", "LISA-U200", "u-blox TOBY-L210", "LARA-R6001"]
)
def test_modems_of_this_family(text):
    assert MODEM.identifies.search(text)


@pytest.mark.parametrize("text", ["Quectel EC25", "Telit HE910", "SIMCOM_SIM800L", "Cinterion BGS2-W", "huawei ME909s"])
def test_modems_of_other_families(text):
    assert not MODEM.identifies.search(text)
