import pytest

from logger.drivers.family import AUTOBAUD_TRIES
from logger.drivers.sim800 import Sim800
from tests.kit.drivers import run_exchange
from tests.kit.scaling import check_growth

MODEM = Sim800()

SERVING = '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"'

NEIGHBOUR = '+CENG: 1,"1688,16,25,a53f,310,260,0113"'

SCAN = 'Operator:"T, Mobile",MCC:310,MNC:260,Rxlev:53,Cellid:CF00,Arfcn:1709,Lac:0113,Bsic:2C'


def one(line, header=None):
    readings = MODEM.read([line] if header is None else [header, line])
    assert len(readings) <= 1
    return readings[0] if readings else None


QUIET = [(text, [], "OK") for text in ("AT", "ATE0", "ATV1", "AT+CMEE=1")]


def test_setup():
    setup = [*QUIET, ("AT+CNETSCAN=1", [], "OK"), ("AT+CENG=1,1", [], "OK")]
    assert run_exchange(MODEM.setup(), setup) is True
    assert run_exchange(MODEM.setup(), [("AT", [], None), ("AT", ["A"], None), *setup]) is True


def test_setup_of_a_modem_that_is_not_there_or_not_able():
    assert run_exchange(MODEM.setup(), [("AT", [], None)] * AUTOBAUD_TRIES) is False
    start = [("AT", [], "OK"), ("ATE0", [], None), ("ATV1", [], None), ("AT+CMEE=1", [], "ERROR")]
    refusing = [*start, ("AT+CNETSCAN=1", [], "OK"), ("AT+CENG=1,1", [], "+CME ERROR: 4")]
    assert run_exchange(MODEM.setup(), refusing) is False


def test_a_modem_without_the_long_form_of_the_scan_is_polled():
    setup = [*QUIET, ("AT+CNETSCAN=1", [], "ERROR"), ("AT+CENG=1,1", [], "OK")]
    assert run_exchange(MODEM.setup(), setup) is True


def test_poll():
    assert run_exchange(MODEM.poll(), [("AT+CENG?", ["+CENG: 1,1", SERVING, NEIGHBOUR], "OK")]) == (
        one(SERVING),
        one(NEIGHBOUR),
    )


@pytest.mark.parametrize(
    ("lines", "final"),
    [
        ([], None),
        (["+CENG: 1,1"], None),
        ([SERVING], "ERROR"),
        ([], "ERROR"),
        ([], "+CME ERROR: 100"),
        (["+CENG: 0,0"], "OK"),
        ([], "OK"),
        (["hello"], "OK"),
    ],
)
def test_poll_without_an_answer(lines, final):
    assert run_exchange(MODEM.poll(), [("AT+CENG?", lines, final)]) is None


def test_rows_that_came_before_a_time_out_are_kept():
    assert run_exchange(MODEM.poll(), [("AT+CENG?", ["+CENG: 1,1", SERVING], None)]) == (
        one(SERVING),
    )


@pytest.mark.parametrize(
    "lines", [["+CENG: 1,1"], ["+CENG: 3,1", '+CENG: 2,",,0000,0000,00,00"'], ['+CENG: 0,""']]
)
def test_poll_where_there_is_no_cell(lines):
    assert run_exchange(MODEM.poll(), [("AT+CENG?", lines, "OK")]) == ()


def test_rows_that_are_unsolicited():
    roles = ["serving", "serving", "serving", "neighbour", "scan"]
    assert [
        MODEM.role_of(line) for line in (SERVING, '+CENG:0,"06', '+CENG:0,"', NEIGHBOUR, SCAN)
    ] == roles
    assert [
        MODEM.role_of(line) for line in ("+CENG: 1,1", "+CENG: 0,1", "OK", "+CREG: 0,1", "", "RDY")
    ] == [None] * 6


@pytest.mark.parametrize(
    "line",
    [
        "RDY",
        "+CFUN: 1",
        "*ATREADY: 1",
        "UNDER-VOLTAGE POWER DOWN",
        "OVER-VOLTAGE POWER DOWN",
        "NORMAL POWER DOWN",
        " RDY ",
    ],
)
def test_signs_of_a_restart(line):
    assert MODEM.is_restart(line)


@pytest.mark.parametrize(
    "line",
    [
        "UNDER-VOLTAGE WARNNING",
        "UNDER-VOLTAGE WARNING",
        "+CFUN: 0",
        "+CPIN: READY",
        "OK",
        "",
        SERVING,
        "RDY?",
    ],
)
def test_no_signs_of_a_restart(line):
    assert not MODEM.is_restart(line)


def test_time_grows_with_the_rows_and_no_faster():
    lines = [SERVING, NEIGHBOUR, '+CENG: 2,"0233,26,00,,,0000"', SCAN]
    check_growth(lambda replies: MODEM.read(lines * replies), 100, 800)
