"""GSM only is set, with every command that a family has for it, by the real service."""

import json

import pytest

from logger.sim.ptys import PtyDevice, answering
from tests.kit import service
from tests.kit.dialects import DIALECTS
from tests.kit.mode_modems import MODELS, ObservedModem
from tests.kit.mode_runs import LIMIT_S, file_of, notes, recording, run_once

CHOICES = {  # the setting; as it was; what of it is kept; the command for GSM only
    "sim7600": ("+CNMP", "2", "2", "AT+CNMP=13"),
    "sim7000": ("+CNMP", "2", "2", "AT+CNMP=13"),
    "ec25": ("+QCFG", '"NWSCANMODE",0,1', "0", 'AT+QCFG="nwscanmode",1,1'),
    "me909s": ("^SYSCFGEX", '"00"', "00", 'AT^SYSCFGEX="01",40000000,2,4,40000000,,'),
    "e173": ("^SYSCFG", "2,0", "2,0", "AT^SYSCFG=13,1,40000000,2,4"),
    "le910": ("+WS46", "25", "25", "AT+WS46=12"),
    "sara-u201": ("+URAT", "1,2", "1,2", "AT+URAT=0"),
    "ehs6": ("^SXRAT", "1,2", "1,2", "AT^SXRAT=0"),
    "wp7607": ("!SELRAT", "00", "00", "AT!SELRAT=02"),
    "l610": ("+GTRAT", "10,3,0", "10,3,0", "AT+GTRAT=0"),
    "xmm7160": ("+XACT", "6,2,1,101,103", "6,2,1,101,103", "AT+XACT=0"),
}


def test_every_command_is_tried():
    assert set(CHOICES) == set(MODELS)


@pytest.mark.parametrize("name", MODELS)
def test_gsm_only_is_set_and_set_back_at_the_stop(tmp_path, name):
    setting, before, value, sent = CHOICES[name]
    modem = ObservedModem(MODELS[name], tmp_path)
    with PtyDevice(answering(modem)) as port, recording(tmp_path, port.path) as (found, scans):
        service.wait_for(lambda: sent in modem.lines, LIMIT_S)
        since = scans()
        service.wait_for(lambda: scans() > since + 2, LIMIT_S)
    noted = notes(found[0])
    assert sent in noted["mode-set"]
    assert "mode-restored" in noted, noted
    assert modem.setting(setting).startswith(before)  # 40000000 and what follows: as it is
    # it was durable when the modem got the command
    (kept,) = json.loads(modem.file_at_line[sent])
    assert kept["value"] == value
    assert kept["model"] in MODELS[name].identity["+CGMM"][0]
    assert not file_of(tmp_path).exists()
    assert not {"mode-unchanged", "mode-left", "internal"} & set(noted)


@pytest.mark.parametrize("name", ["sim7600", "ec25"])
def test_without_the_setting_nothing_about_it_is_sent(tmp_path, name):
    noted, modem = run_once(tmp_path, MODELS[name], set_mode="")
    assert not [line for line in modem.lines if "CNMP" in line or "nwscanmode" in line]
    assert not [code for code in noted if code.startswith("mode-")]


def test_a_modem_on_gsm_only_is_left_so(tmp_path):
    modem = ObservedModem(MODELS["sim7600"], tmp_path)
    modem.modem.feed(b"AT+CNMP=13\r")
    noted, _ = run_once(tmp_path, None, watched=modem)
    assert "mode-gsm" in noted
    assert not [line for line in modem.lines if line.startswith("AT+CNMP=")]
    assert not file_of(tmp_path).exists()


@pytest.mark.parametrize("name", ["l850", "mc7455"])
def test_a_modem_that_refuses_is_told_of_and_owes_nothing(tmp_path, name):
    noted, _ = run_once(tmp_path, DIALECTS[name])
    assert "refuses" in noted["mode-unchanged"]
    assert not file_of(tmp_path).exists()
    assert not {"mode-set", "mode-left", "mode-restored"} & set(noted)


@pytest.mark.parametrize(
    ("name", "why"),
    [("bgs2", "does not report"), ("plain", "no command for"), ("sim800", "no command for")],
)
def test_what_cannot_be_read_is_not_changed(tmp_path, name, why):
    noted, modem = run_once(tmp_path, DIALECTS[name])
    assert why in noted["mode-unchanged"]
    assert not [line for line in modem.lines if "=0" in line or "=12" in line or "=13" in line]
    assert not file_of(tmp_path).exists()


class Deaf(ObservedModem):
    """A modem that does not hear some questions."""

    lost = 0

    def feed(self, data):
        if b"AT+CNMP?" in data and self.lost < 5:
            self.lost += 1
            return b""
        return super().feed(data)


def test_a_modem_that_is_silent_for_a_while_is_asked_again(tmp_path):
    modem = Deaf(MODELS["sim7600"], tmp_path)
    noted, _ = run_once(
        tmp_path, None, watched=modem, until=lambda one: one.setting("+CNMP") == "13"
    )
    assert "does not report" in noted["mode-unchanged"]
    assert modem.setting("+CNMP") == "2"
    assert not file_of(tmp_path).exists()
