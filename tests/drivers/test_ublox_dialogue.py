import pytest

from logger.drivers.ublox import Ublox
from tests.kit.drivers import run_dialogue

MODEM = Ublox()

CELLINFO = "+UCELLINFO: 1,     2,  262,   12, 1d2e, 3f4a5b6, 117, 10713, 44, 31"
ENVIRONMENT = ['+CGED: RAT:"UMTS",', "Mcc:262, Mnc:  3, Lac:2d3e, Ci:4a5b6c7, DLF:10713 , ULF:9763"]

SCANNED = "MCC:262, MNC:  3, LAC:2d3e, CI:4a5b, BSIC:24, Arfcn:00594, RXLEV:017"


def test_setup():
    accepted, asked = run_dialogue(MODEM.setup(), {"AT": ((), "OK")})
    assert accepted is True
    assert asked[-2:] == ["AT+UCGED=5", "AT+UCGED=2"]
    assert run_dialogue(MODEM.setup(), {})[0] is False


def test_poll_asks_until_there_are_cells():
    rows, asked = run_dialogue(MODEM.poll(), {"AT+UCELLINFO?": ([CELLINFO], "OK")})
    assert [row.cell for row in rows] == [f"262-12-{0x1D2E}-{0x3F4A5B6}"]
    assert asked == ["AT+COPS?", "AT+CGED=5", "AT+UCELLINFO?"]


@pytest.mark.parametrize(
    ("plmn", "mnc"), [("26203", "03"), ("262003", "003"), ("26202", None), ("26303", None)]
)
def test_poll_restores_the_zeros_of_a_network_code(plmn, mnc):
    answers = {"AT+CGED=5": (ENVIRONMENT, "OK"), "AT+COPS?": ([f'+COPS: 0,2,"{plmn}",2'], "OK")}
    reading = run_dialogue(MODEM.poll(), answers)[0][0]
    assert (reading.mcc, reading.mnc) == ("262", mnc)


def test_poll_of_a_model_with_none_of_the_commands():
    answers = {
        "AT+COPS?": (['+COPS: 0,2,"26202",0'], "OK"),
        "AT+CREG?": (['+CREG: 2,1,"2D3E","4A5B",0'], "OK"),
        "AT+CSQ": (["+CSQ: 20,99"], "OK"),
    }
    reading = run_dialogue(MODEM.poll(), answers)[0][0]
    assert (reading.cell, reading.rssi_dbm) == (f"262-02-{0x2D3E}-{0x4A5B}", -73.0)


def test_poll_without_an_answer_or_a_cell():
    assert run_dialogue(MODEM.poll(), {})[0] is None
    assert run_dialogue(MODEM.poll(), {"AT+CGED=5": ((), None)})[0] is None
    assert run_dialogue(MODEM.poll(), {"AT+CGED=5": ((), "OK")})[0] == ()


@pytest.mark.parametrize(
    ("plmn", "mnc"), [("26203", "03"), ("262003", "003"), ("26202", None), ("26303", None)]
)
def test_scan_restores_the_zeros_of_a_network_code(plmn, mnc):
    answers = {"AT+COPS=5": ([SCANNED], "OK"), "AT+COPS?": ([f'+COPS: 0,2,"{plmn}",0'], "OK")}
    (reading,), asked = run_dialogue(MODEM.survey(MODEM.survey_commands[0]), answers)
    assert (reading.mcc, reading.mnc, reading.cid, reading.rssi_dbm) == ("262", mnc, 0x4A5B, None)
    assert asked == ["AT+COPS=5", "AT+COPS?"]


def test_scan_of_a_modem_that_has_no_network_or_refuses_it():
    answers = {"AT+COPS=5": ([SCANNED], "OK"), "AT+COPS?": (["+COPS: 0"], "OK")}
    assert [
        row.mnc for row in run_dialogue(MODEM.survey(MODEM.survey_commands[0]), answers)[0]
    ] == [None]
    assert (
        run_dialogue(MODEM.survey(MODEM.survey_commands[0]), {"AT+COPS?": (["+COPS: 0"], "OK")})[0]
        is None
    )


def test_scan_only_listens():
    assert [command.text for command in MODEM.survey_commands] == ["AT+COPS=5"]
    assert MODEM.survey_commands[0].timeout_s >= 180
