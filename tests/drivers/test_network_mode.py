"""The choice of technologies in the forms that modems print it, and dialogues about it."""

import pytest

from logger.drivers import network_mode
from logger.drivers.protocols.at import Reply
from tests.kit.drivers import run_dialogue, run_exchange


@pytest.mark.parametrize(
    ("command", "line", "value", "back"),
    [
        (network_mode.CNMP[0], "+CNMP: 2", "2", "AT+CNMP=2"),
        (network_mode.CNMP[0], "+CNMP:51", "51", "AT+CNMP=51"),
        (network_mode.NWSCANMODE[0], '+QCFG: "nwscanmode",0', "0", 'AT+QCFG="nwscanmode",0,1'),
        (network_mode.NWSCANMODE[0], '+QCFG: "NWSCANMODE",3,1', "3", 'AT+QCFG="nwscanmode",3,1'),
        (network_mode.URAT[0], "+URAT: 1,2", "1,2", "AT+URAT=1,2"),
        (network_mode.URAT[0], "+URAT: 3", "3", "AT+URAT=3"),
        (network_mode.WS46[0], "+WS46: 25", "25", "AT+WS46=25"),
        (network_mode.WS46[0], "28", "28", "AT+WS46=28"),
        (network_mode.SXRAT[0], "^SXRAT: 1, 2", "1,2", "AT^SXRAT=1,2"),
        (network_mode.SELRAT[0], "!SELRAT: 00, Automatic", "00", "AT!SELRAT=00"),
        (network_mode.SELRAT[0], "!SELRAT: 0A, WCDMA and LTE Only", "0A", "AT!SELRAT=0A"),
        (
            network_mode.SYSCFG[0],
            '^SYSCFGEX:"030201",3FFFFFFF,1,2,7FFFFFFFFFFFFFFF',
            "030201",
            'AT^SYSCFGEX="030201",40000000,2,4,40000000,,',
        ),
        (network_mode.SYSCFG[1], "^SYSCFG:2,2,3FFFFFFF,1,2", "2,2", "AT^SYSCFG=2,2,40000000,2,4"),
        (network_mode.GTRAT[0], "+GTRAT: 10,3,2", "10,3,2", "AT+GTRAT=10,3,2"),
        (
            network_mode.GTRAT[1],
            "+XACT: 4,2,1,101,,103",
            "4,2,1,101,,103",
            "AT+XACT=4,2,1,101,,103",
        ),
    ],
)
def test_what_a_modem_reports_can_be_set_again(command, line, value, back):
    assert command.value_in(Reply(command.query, (line,), "OK")) == value
    assert command.is_value(value)
    assert command.set_to(value) == back
    assert not command.is_gsm(value)
    for lines, final in (
        ((line,), None),
        ((line,), "ERROR"),
        ((), "OK"),
        ((line, line), "OK"),
        (("+CSQ: 9,9",), "OK"),
    ):
        assert command.value_in(Reply(command.query, lines, final)) is None


@pytest.mark.parametrize(
    "line", ["+CNMP: ", "+CNMP: x", "+CNMP: 2,", "+CNMP: 2;+CFUN=0", "!SELRAT: Unknown RAT mode"]
)
def test_what_is_no_value_is_none(line):
    assert network_mode.CNMP[0].value_in(Reply("AT+CNMP?", (line,), "OK")) is None
    assert network_mode.SELRAT[0].value_in(Reply("AT!SELRAT?", (line,), "OK")) is None


def test_a_value_counts_that_is_reported_twice_in_a_row():
    asked = "AT+CNMP?"
    once = [
        (asked, ("+CNMP: 38",), "OK"),
        (asked, ("+CNMP: 3",), "OK"),
        (asked, ("+CNMP: 38",), "OK"),
    ]
    assert run_exchange(network_mode.read_mode(network_mode.CNMP), [*once, once[0]]) == (
        network_mode.CNMP[0],
        "38",
    )
    assert (
        run_exchange(network_mode.read_mode(network_mode.CNMP), [*once, (asked, (), None)]) is None
    )


def test_the_command_that_the_modem_has_is_taken():
    answers = {"AT^SYSCFG?": (("^SYSCFG:2,0,3FFFFFFF,1,2",), "OK")}
    found, asked = run_dialogue(network_mode.read_mode(network_mode.SYSCFG), answers)
    assert found == (network_mode.SYSCFG[1], "2,0")
    assert asked == ["AT^SYSCFGEX?", "AT^SYSCFG?", "AT^SYSCFG?"]
    assert run_dialogue(network_mode.read_mode(network_mode.SYSCFG), {})[0] is None


def test_the_technologies_alone_are_set_where_the_preferred_ones_are_refused():
    command, mode_query = network_mode.SXRAT[0], "AT^SXRAT?"
    replies = [
        ("AT^SXRAT=2,2", (), "+CME ERROR: 21"),
        (mode_query, ("^SXRAT: 0, 0",), "OK"),
        ("AT^SXRAT=2", (), "OK"),
        (mode_query, ("^SXRAT: 2, 2",), "OK"),
    ]
    assert run_exchange(network_mode.set_mode(command, "2,2"), replies) == "2,2"


def test_what_a_modem_has_afterwards_is_asked_and_not_believed():
    answers = {"AT+CNMP=13": ((), "OK"), "AT+CNMP?": (("+CNMP: 2",), "OK")}
    assert run_dialogue(network_mode.set_mode(network_mode.CNMP[0], "13"), answers)[0] == "2"
    assert run_dialogue(network_mode.set_mode(network_mode.CNMP[0], "13"), {})[0] is None


def test_the_model_is_asked_and_no_number():
    assert run_dialogue(network_mode.ask_model(), {"AT+CGMM": (("SIM7600E-H",), "OK")}) == (
        "SIM7600E-H",
        ["AT+CGMM"],
    )
    assert run_dialogue(network_mode.ask_model(), {"AT+CGMM": ((), "OK")})[0] is None
    assert run_dialogue(network_mode.ask_model(), {})[0] is None
