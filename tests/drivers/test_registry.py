"""Each driver by its name, and each modem by what it says of itself."""

import math
import re

import pytest

from logger.core.errors import ConfigError
from logger.drivers.registry import AUTO, FAMILIES, driver_of, family_of, identify, reader_of
from tests.kit.drivers import run_dialogue

# Answers to ATI, AT+CGMI, AT+CGMM and AT+CGMR as the vendors' manuals and public logs show them.
MODEMS = {
    "sim800": [
        "SIM800 R14.18",
        "SIMCOM_Ltd SIMCOM_SIM800L Revision:1418B05SIM800L24",
        "SIMCOM_SIM900 1137B13SIM900M64",
    ],
    "sim7000": [
        "SIM7000E R1529 SIMCOM_Ltd SIMCOM_SIM7000E",
        "SIM7070 R1951.02 SIMCOM_SIM7070",
        "SIMCOM_SIM7080",
    ],
    "sim7600": [
        "Manufacturer: SIMCOM INCORPORATED Model: SIMCOM_SIM5360E Revision: SIM5360E_V3.5",
        "Manufacturer: SIMCOM INCORPORATED Model: SIMCOM_SIM7600E-H",
        "Manufacturer: SIMCOM INCORPORATED Model: A7670E-FASE Revision: A011B07A7670M7_F",
        "Model: SIMCOM_SIM8202G-M2",
    ],
    "quectel": [
        "Quectel EC25 Revision: EC25EFAR06A06M4G",
        "Quectel EG25 Revision: EG25GGBR07A08M2G",
        "Quectel BG96 Revision: BG96MAR02A07M1G",
        "Quectel RM500Q-GL Revision: RM500QGLABR11A06M4G",
        "Quectel EP06 Revision: EP06ELAR03A08M4G",
    ],
    "quectel_gsm": [
        "Quectel_Ltd Quectel_M95 Revision: M95FAR02A08",
        "Quectel_Ltd Quectel_M66 Revision: M66FAR01A12BT",
        "Quectel_Ltd Quectel_BC26 Revision: BC26NAR01A07",
    ],
    "telit": [
        "Telit GL865-DUAL 16.01.150",
        "Telit LE910-EUG 17.00.523",
        "Telit GT864-QUAD 10.00.006",
    ],
    "ublox": [
        "u-blox SARA-G350-02S-01 08.90",
        "u-blox SARA-R510S-01B 03.15",
        "u-blox LARA-R6001-00B",
    ],
    "cinterion": [
        "SIEMENS TC35 REVISION 04.00",
        "Cinterion BGS2-W REVISION 02.000",
        "SIEMENS MC55 REVISION 04.00",
        "Cinterion PLS8-E REVISION 03.011",
    ],
    "sierra": [
        "Sierra Wireless, Incorporated MC7455 SWI9X30C_02.24.05.06",
        "Sierra Wireless, Incorporated EM7565",
    ],
    "huawei": ["huawei E3372 21.180.01.00.00", "Huawei Technologies Co., Ltd. ME909s-120"],
    "fibocom": ["Fibocom Wireless Inc. L860-GL", "Fibocom FM350-GL 81600.0000.00.29.17.01"],
    "generic": ["", "ACME 2000", "ERROR"],
}


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_each_driver_by_its_name(name):
    driver = driver_of(name)
    assert driver is not None
    assert driver.name == name


def test_an_unknown_driver_is_told_with_the_names_there_are():
    with pytest.raises(ConfigError, match=r"'nokia'; known are: auto, sim800.*generic"):
        driver_of("nokia")
    assert driver_of(AUTO) is None


@pytest.mark.parametrize(
    ("name", "text"), [(name, text) for name, texts in MODEMS.items() for text in texts]
)
def test_a_modem_is_known_by_what_it_says(name, text):
    assert family_of(text).name == name


def test_the_dialogue_that_asks():
    said = {"AT": (), "ATE0": (), "ATI": ("SIM800 R14.18",), "AT+CGMM": ("SIMCOM_SIM800L",)}
    (driver, text), asked = run_dialogue(
        identify(), {command: (lines, "OK") for command, lines in said.items()}
    )
    assert (driver.name, text) == ("sim800", "SIM800 R14.18 SIMCOM_SIM800L")
    assert not any("CGSN" in text or "CIMI" in text for text in asked)


def test_a_silent_modem_is_nobody():
    assert run_dialogue(identify(), {}, ((), None))[0] is None


def test_a_transcript_is_read_by_the_driver_that_finds_most():
    lines = ['+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"', "+CSQ: 19,99"]
    assert reader_of(lines).name == "sim800"
    assert reader_of(["+CSQ: 19,99"]).read(["+CSQ: 19,99"])


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
def test_a_full_scan_is_asked_after_before_its_time_is_over(driver):
    """By what is documented, or not at all; no other command is."""
    assert all(c.silence_s < c.timeout_s or c.silence_s == math.inf for c in driver.survey_commands)
    assert {
        c.silence_s
        for c in (*driver.setup_commands, *driver.poll_commands, *driver.gnss_poll_commands)
    } <= {math.inf}
