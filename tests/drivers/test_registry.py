"""Each driver by its name, and each modem by what it says of itself."""

import math
import re

import pytest

from logger.core.errors import ConfigError
from logger.drivers.registry import AUTO, FAMILIES, driver_of, identify, reader_of
from tests.kit.drivers import run_dialogue


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_each_driver_by_its_name(name):
    driver = driver_of(name)
    assert driver is not None
    assert driver.name == name


def test_an_unknown_driver_is_an_error_that_lists_the_known_ones():
    with pytest.raises(ConfigError, match=r"'nokia'; known are: auto, .*cinterion.*ublox"):
        driver_of("nokia")
    assert driver_of(AUTO) is None


def test_the_dialogue_that_asks():
    said = {"AT": (), "ATE0": (), "ATI": ("SIM800 R14.18",), "AT+CGMM": ("SIMCOM_SIM800L",)}
    (driver, text), asked = run_dialogue(
        identify(), {command: (lines, "OK") for command, lines in said.items()}
    )
    assert (driver.name, text) == ("sim800", "SIM800 R14.18 SIMCOM_SIM800L")
    assert not any("CGSN" in text or "CIMI" in text for text in asked)


def test_a_silent_modem_has_no_driver():
    assert run_dialogue(identify(), {}, ((), None))[0] is None


def test_a_transcript_is_read_by_the_driver_that_finds_most():
    lines = ['+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"', "+CSQ: 19,99"]
    assert reader_of(lines).name == "sim800"
    assert reader_of(["+CSQ: 19,99"]).read(["+CSQ: 19,99"])


def test_a_transcript_without_a_row_of_any_vendor_is_read_by_the_generic_driver():
    assert reader_of([]).name == reader_of(["+CSQ: 19,99"]).name == "generic"


def test_of_drivers_that_read_the_same_it_is_the_first_by_name():
    lines = ["+CPSI: GSM,Online,502-12,0x1054,62168,512 DCS 1800,-71,0,32-32"]
    rows = FAMILIES["sim7600"].rows_in(lines)
    alike = [name for name, driver in FAMILIES.items() if driver.rows_in(lines) == rows]
    assert len(alike) > 1
    assert reader_of(lines).name == min(alike)


FORBIDDEN = (
    "CIMI",
    "CGSN",
    "CCID",
    "CNUM",
    "ATD",
    "CGATT=",
    "CFUN=",
    "COPS=0",
    "COPS=1",
    "COPS=2",
    "COPS=4",
    "CMGS",
)
CHOOSES_TECHNOLOGIES = re.compile(
    r"CNMP=|CNMB=|NWSCAN|IOTOPMODE|URAT=|WS46=|SXRAT=|SELRAT=|SYSCFG|GTRAT=|G?T?X?ACT=\d"
)
GSM_ONLY = {
    "sim7000": ["AT+CNMP=13"],
    "sim7600": ["AT+CNMP=13"],
    "quectel": ['AT+QCFG="nwscanmode",1,1'],
    "telit": ["AT+WS46=12"],
    "ublox": ["AT+URAT=0"],
    "cinterion": ["AT^SXRAT=0"],
    "sierra": ["AT!SELRAT=02"],
    "huawei": ['AT^SYSCFGEX="01",40000000,2,4,40000000,,', "AT^SYSCFG=13,1,40000000,2,4"],
    "fibocom": ["AT+GTRAT=0", "AT+XACT=0"],
}
"""The one exception, and only where `[modem] set_mode` asks for it: the modem may register anew."""


@pytest.mark.parametrize("driver", FAMILIES.values(), ids=FAMILIES)
def test_no_driver_asks_who_the_subscriber_is_or_transmits(driver):
    for command in (
        *driver.setup_commands,
        *driver.poll_commands,
        *driver.survey_commands,
        *driver.gnss_start_commands,
        *driver.gnss_poll_commands,
    ):
        assert not any(word in command.text.upper() for word in FORBIDDEN), command
        assert not CHOOSES_TECHNOLOGIES.search(command.text.upper()), command


@pytest.mark.parametrize("driver", FAMILIES.values(), ids=FAMILIES)
def test_the_one_exception_is_the_choice_of_gsm_only(driver):
    sent = [command.set_to(command.gsm_only) for command in driver.mode_commands]
    assert sent == GSM_ONLY.get(driver.name, [])
    for text in (*sent, *(command.query for command in driver.mode_commands)):
        assert not any(word in text.upper() for word in FORBIDDEN), text
    # what is asked sets nothing
    assert all(command.query.endswith(("?", '="nwscanmode"')) for command in driver.mode_commands)
    assert all(
        command.is_gsm(command.gsm_only) and command.is_value(command.gsm_only)
        for command in driver.mode_commands
    )


@pytest.mark.parametrize("driver", FAMILIES.values(), ids=FAMILIES)
def test_a_full_scan_is_followed_by_at_before_its_time_is_over(driver):
    """By what is documented, or not at all; no other command is."""
    assert all(c.silence_s < c.timeout_s or c.silence_s == math.inf for c in driver.survey_commands)
    assert {
        c.silence_s
        for c in (*driver.setup_commands, *driver.poll_commands, *driver.gnss_poll_commands)
    } <= {math.inf}
