"""What all drivers have in common, whatever their modems print."""

import re

import pytest

from logger.drivers.protocols.at import Reply
from logger.drivers.protocols.redaction import redact
from logger.drivers.registry import FAMILIES
from tests.kit.drivers import check_cuts, own_replies, run_dialogue

TRANSMITS_OR_IDENTIFIES = re.compile(
    r"ATD|COPS=[0124]|CGATT|CFUN|CIMI|CGSN|CCID|CNUM|GTACT|GTRAT|ENTERCND"
)
REPEATS_WITHOUT_END = re.compile(r"\^MON[IP]=|\^SMON[IP]=(?!255)")
NEEDS_A_SETTING = {"sim800"}
"""Families whose modems print no cell before a setting is accepted."""


@pytest.mark.parametrize("name", FAMILIES)
def test_commands_listen_only(name):
    family = FAMILIES[name]
    for command in (*family.setup_commands, *family.poll_commands, *family.survey_commands):
        assert not TRANSMITS_OR_IDENTIFIES.search(command.text)
        assert not REPEATS_WITHOUT_END.search(command.text)


@pytest.mark.parametrize("name", FAMILIES)
def test_setup_of_a_modem_that_accepts_all_commands_one_or_none(name):
    """An old modem knows neither AT+CEREG nor AT+COPS=3,2."""
    family = FAMILIES[name]
    assert run_dialogue(family.setup(), {}, ((), "OK"))[0] is True
    only_at = run_dialogue(family.setup(), {"AT": ((), "OK")})[0]
    assert only_at is (name not in NEEDS_A_SETTING)
    assert run_dialogue(family.setup(), {}, ((), None))[0] is False


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("final", [None, "ERROR", "+CME ERROR: 100"])
def test_poll_without_an_answer(name, final):
    assert run_dialogue(FAMILIES[name].poll(), {}, ((), final))[0] is None


@pytest.mark.parametrize("name", FAMILIES)
def test_a_reply_that_is_cut_names_no_other_cell(name):
    for reply in own_replies(name):
        check_cuts(FAMILIES[name], reply)


def as_replies(*texts):
    return [Reply(command, tuple(lines.split("\n")), "OK") for command, lines in texts]


UNREAD = {  # written from the manuals' forms, which newer firmware might change
    "fibocom": ("AT+GTCCINFO?", "+GTCCINFO:\nLTE service cell:\n1,4,262,02,4E5F,2D3C4B5,5A4,12F"),
    "cinterion": ("AT^SMONI", "^SMONI: 5G,627264,78,100,100,TDD,262,02,A0C100,6CE5C2002,385,CONN"),
    "sim7600": ("AT+CPSI?", "+CPSI: CDMA,Online,460-03,0x3600,1234,0,283,BC0,120,5,0,100,200,75"),
    "quectel": ('AT+QENG="servingcell"', '+QENG: "servingcell","NOCONN","CDMA",460,03,138,123,283'),
    "huawei": ("AT^MONSC", "^MONSC: TD_SCDMA,460,00,10055,11,12,A9B8,A809,-73,3,2"),
}  # fmt: skip


@pytest.mark.parametrize("name", UNREAD)
def test_rows_in_an_unknown_form_are_told_of(name):
    command, lines = UNREAD[name]
    others = as_replies(("AT+CREG?", '+CREG: 2,1,"1A2B","3C4D",0'), ("AT+CSQ", "+CSQ: 20,99"))
    assert FAMILIES[name].unread(as_replies((command, lines)) + others) == command
    assert FAMILIES[name].unread(others) is None
    for reply in own_replies(name):  # new firmware may change the rows of one kind only
        readable = as_replies((command, reply))
        assert FAMILIES[name].unread(as_replies((command, f"{reply}\n{lines}"))) == command
        assert FAMILIES[name].unread(as_replies((command, lines)) + readable) == command


MASKED = {  # a letter in no form: redaction masks the row, and its cell is lost
    "ublox": (
        "AT+UCGED?",
        '+UCGED: 2\n6,4,262,01\n1300,3,50,50,1a2b,2d00a0b,135,a1b2c3d4,ffff,ff,46,20,13,1,"IDLE"',
    ),
    "telit": (
        "AT#CSURV=0,62",
        "Network survey started ...\n61,26,-76,0,262,02,23456,34567,CELL_UNKNOWN,0",
    ),
    "fibocom": ("AT+GTCCINFO?", "+GTCCINFO:\n1,4,262,02,4E5F,2D3C4B5,5A4,12F,NONE,100,15,46,46,23"),
}


@pytest.mark.parametrize("name", MASKED)
def test_rows_that_redaction_masks_are_told_of(name):
    command, lines = MASKED[name]
    sent = redact(lines.replace("\n", "\r\n").encode(), command).decode()
    reply = Reply(command, tuple(sent.split("\r\n")), "OK")
    assert FAMILIES[name].read([command, *reply.lines]) == ()
    assert FAMILIES[name].unread([reply]) == command


def test_words_of_a_message_within_a_reply_are_no_unknown_form():
    sent = redact(b"Hi Bob, see you at ten, five, six, seven, eight or so\r\n", "AT+UCGED?")
    assert FAMILIES["ublox"].unread(as_replies(("AT+UCGED?", sent.decode().strip()))) is None


EMPTY = {  # no service, no cell, unknown values
    "sim800": ("AT+CENG?", '+CENG: 1,1\n+CENG: 0,"0000,00,00,000,00,00,0000,00,00,0000,255"'),
    "fibocom": ("AT+GTCCINFO?", "+GTCCINFO:\n0,0,,,,,,,,,,,,"),
    "sim7600": ("AT+CPSI?", "+CPSI: LTE,Online,000-00,0x0000,0,0,EUTRAN-BAND0,65535,0,0,0,0,0,0"),
    "sim7000": (
        "AT+CPSI?",
        "+CPSI: LTE,Online,262-02,0x3C4D,26543210,0,EUTRAN-BAND0,4294967295,0,0,0,0,0,0",
    ),
    "quectel_gsm": ("AT+NUESTATS=CELL", "NUESTATS:CELL,3740,137,1,-32768,-32768,-32768,-32768"),
    "telit": ("AT#MONI", "#MONI: Cc:FFF Nc:FF RSRP:-141 RSRQ:-20 TAC:FFFF Id:FFFFFFF EARFCN:65535"),
    "quectel": ('AT+QENG="servingcell"', '+QENG: "servingcell","LIMSRV"'),
}


@pytest.mark.parametrize("name", EMPTY)
def test_rows_without_a_cell_are_no_unknown_form(name):
    assert FAMILIES[name].unread(as_replies(EMPTY[name])) is None


@pytest.mark.parametrize("name", FAMILIES)
def test_what_a_driver_reads_is_in_no_unknown_form(name):
    driver = FAMILIES[name]
    commands = [command.text for command in (*driver.poll_commands, *driver.survey_commands)]
    for reply in own_replies(name):
        found = {driver.unread(as_replies((command, reply))) for command in commands}
        assert None in found, reply
