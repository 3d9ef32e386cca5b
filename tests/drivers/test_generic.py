from logger.core.types import CellReading
from logger.drivers.generic import Generic
from tests.kit.drivers import run_dialogue


def test_the_serving_cell_is_joined_from_registration_network_and_level():
    rows, _ = run_dialogue(
        Generic().poll(),
        {
            "AT+COPS?": (['+COPS: 0,2,"26201",0'], "OK"),
            "AT+CREG?": (['+CREG: 2,1,"CE00","5449",0'], "OK"),
            "AT+CSQ": (["+CSQ: 20,99"], "OK"),
        },
    )
    assert rows[0] == CellReading("serving", "GSM", "262", "01", 0xCE00, 0x5449, rssi_dbm=-73.0)


def test_of_lte_the_level_is_that_of_the_reference_signal():
    rows, _ = run_dialogue(
        Generic().poll(),
        {
            "AT+CEREG?": (['+CEREG: 2,1,"2AFE","1A2D001",7'], "OK"),
            "AT+CESQ": (["+CESQ: 99,99,255,255,20,60"], "OK"),
        },
    )
    assert (rows[0].rat, rows[0].tac, rows[0].rsrp_dbm, rows[0].rssi_dbm) == (
        "LTE",
        0x2AFE,
        -81.0,
        None,
    )


def test_no_cell_is_no_reading_and_no_answer_is_none():
    rows, _ = run_dialogue(Generic().poll(), {"AT+CREG?": (["+CREG: 2,0"], "OK")})
    assert not any(isinstance(row, CellReading) for row in rows)
    assert run_dialogue(Generic().poll(), {})[0] is None


def test_set_up_fails_only_where_the_modem_does_not_answer():
    assert run_dialogue(Generic().setup(), {"AT": ((), "OK")})[0] is True
    assert run_dialogue(Generic().setup(), {})[0] is False
