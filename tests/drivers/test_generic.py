import pytest

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


def serving_cell(**lines):
    marks = {"CESQ": "", "CSQ": ""}
    replies = {f"AT+{name}{marks.get(name, '?')}": ([text], "OK") for name, text in lines.items()}
    rows, _ = run_dialogue(Generic().poll(), replies)
    return rows[0]


@pytest.mark.parametrize("act", [",7", ""])
@pytest.mark.parametrize("circuit_switched", ["FFFE", "0A0B"])
def test_the_tracking_area_is_that_of_cereg(circuit_switched, act):
    # +CREG prints the area of circuit-switched service, which FFFE says is missing
    reading = serving_cell(
        COPS=f'+COPS: 0,2,"26201"{act}',
        CREG=f'+CREG: 2,1,"{circuit_switched}","1A2D001"{act}',
        CEREG=f'+CEREG: 2,1,"2AFE","1A2D001"{act}',
        CESQ="+CESQ: 99,99,255,255,20,60",
    )
    assert (reading.lac, reading.cell) == (None, f"262-01-{0x2AFE}-{0x1A2D001}")


def test_the_area_of_gsm_is_that_of_cgreg_where_no_circuit_is_switched():
    reading = serving_cell(
        COPS='+COPS: 0,2,"26201",0',
        CREG='+CREG: 2,3,"FFFE","5449",0',
        CGREG='+CGREG: 2,1,"CE00","5449",0',
        CESQ="+CESQ: 40,0,255,255,255,255",
    )
    assert (reading.cell, reading.tac) == (f"262-01-{0xCE00}-{0x5449}", None)


@pytest.mark.parametrize("stat", [0, 2, 4])
def test_a_modem_that_is_not_registered_has_no_serving_cell(stat):
    # it may print its last cell, beside the level of another one
    lost = f'+CREG: 2,{stat},"CE00","5449",0'
    first = serving_cell(COPS="+COPS: 0", CREG=lost, CSQ="+CSQ: 20,99")
    assert not isinstance(first, CellReading)
    reading = serving_cell(
        COPS='+COPS: 0,2,"26201",7',
        CREG=lost,
        CEREG='+CEREG: 2,1,"2AFE","1A2D001",7',
        CESQ="+CESQ: 99,99,255,255,20,60",
    )
    assert (reading.rat, reading.cid, reading.rsrp_dbm) == ("LTE", 0x1A2D001, -81.0)


def test_the_cell_that_denies_is_recorded():
    reading = serving_cell(COPS="+COPS: 0", CREG='+CREG: 2,3,"CE00","5449",0', CSQ="+CSQ: 20,99")
    assert (reading.cid, reading.rssi_dbm) == (0x5449, -73.0)


@pytest.mark.parametrize(("act", "rat"), [(8, "LTE-M"), (9, "NB-IoT")])
def test_lte_for_things_has_the_level_of_its_reference_signal(act, rat):
    reading = serving_cell(
        COPS=f'+COPS: 0,2,"26201",{act}',
        CREG="+CREG: 2,0",
        CEREG=f'+CEREG: 2,1,"2AFE","1A2D001",{act}',
        CESQ="+CESQ: 99,99,255,255,20,60",
    )
    assert (reading.rat, reading.rsrp_dbm, reading.tac) == (rat, -81.0, 0x2AFE)


def test_a_cell_of_nr_has_the_level_of_its_own_reference_signal():
    reading = serving_cell(
        COPS='+COPS: 0,2,"26201",11',
        CREG="+CREG: 2,0",
        C5GREG='+C5GREG: 2,1,"0002AFE","0012D6870",11',
        CESQ="+CESQ: 99,99,255,255,20,60,65,76,90",
    )
    assert (reading.rat, reading.cid, reading.rsrp_dbm) == ("NR", 0x12D6870, -81.0)
    assert reading.rsrq_db == -11.0


@pytest.mark.parametrize("printed", ["5", "0", "8"])
def test_a_level_far_below_that_of_its_carrier_has_lost_a_digit(printed):
    lines = {"CEREG": '+CEREG: 2,1,"2AFE","1A2D001",7', "CSQ": "+CSQ: 25,99"}
    assert serving_cell(**lines, CESQ="+CESQ: 99,99,255,255,20,58").rsrp_dbm == -83.0
    damaged = serving_cell(**lines, CESQ=f"+CESQ: 99,99,255,255,20,{printed}")
    assert (damaged.cid, damaged.level_dbm) == (0x1A2D001, None)


def test_a_level_below_the_scale_is_none():
    reading = serving_cell(CEREG='+CEREG: 2,1,"2AFE","1A2D001",7', CESQ="+CESQ: 99,99,255,255,20,0")
    assert reading.level_dbm is None


@pytest.mark.parametrize(("act", "rat"), [("", None), (",0", "GSM")])
def test_the_area_of_creg_alone_is_a_location_area(act, rat):
    # written after 3GPP TS 27.007 7.2: modems of GSM print no technology
    reading = serving_cell(
        COPS='+COPS: 0,2,"26201"', CREG=f'+CREG: 2,1,"CE00","5449"{act}', CSQ="+CSQ: 20,0"
    )
    assert (reading.rat, reading.lac, reading.tac, reading.cid) == (rat, 0xCE00, None, 0x5449)
