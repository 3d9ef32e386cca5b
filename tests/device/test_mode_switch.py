"""GSM only, and back: the real service on real ptys, with every command that a family has for
it.
"""

import json
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import pytest

from logger.config import parse_config
from logger.core.runfile import read_run
from logger.device.clock import SystemClock
from logger.device.saved_modes import FILE
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.dialects import DIALECTS
from logger.sim.dialects.dialect import identity_replies
from logger.sim.ptys import PtyDevice, answering
from tests.kit import service
from tests.kit.mode_modems import MODELS, ObservedModem

LIMIT_S = 60.0
SIM7100 = replace(
    DIALECTS["sim7600"], identity=identity_replies(["SIM7100"], "SIMCOM", "SIMCOM_SIM7100E", "1.0")
)
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


def _config(folder, port, set_mode="gsm", more=""):
    mode = f'set_mode = "{set_mode}"\n' if set_mode else ""
    text = (
        f'[run]\ndirectory = "{folder}"\n[modem]\nport = "{port}"\n'
        f"poll_interval_s = 0.05\n{mode}{more}"
        f'[gnss]\nport = "{folder / "none"}"\n'
    )
    return parse_config(text, "site.toml")


@contextmanager
def recording(folder, port, set_mode="gsm"):
    """A run under way; it is stopped at the end, and read into the list that this gives."""
    found = []
    config, clock = _config(folder, port, set_mode), SystemClock()
    under_way = Service(config, begin_run(config, "", clock), clock, threading.Event())
    under_way.start()
    scans = under_way.recorder.counts
    try:
        yield found, lambda: scans["Scan"]
    finally:
        found.append(read_run(under_way.stop("end")))


def notes(run):
    return {
        row["code"].decode(): row["text"].decode()
        for row in run.tables["notes"]
        if row["source"] == b"modem"
    }


def run_once(folder, dialect, set_mode="gsm", until=None, watched=None):
    """A run with a modem until a condition holds or it has scanned; its notes, and the modem."""
    modem = watched or ObservedModem(dialect, folder)
    with (
        PtyDevice(answering(modem)) as port,
        recording(folder, port.path, set_mode) as (found, scans),
    ):
        service.wait_for(lambda: until(modem) if until else scans() > 2, LIMIT_S)
    return notes(found[0]), modem


def file_of(folder):
    return folder / FILE


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
    [("bgs2", "does not tell"), ("plain", "no command for"), ("sim800", "no command for")],
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
    assert "does not tell" in noted["mode-unchanged"]
    assert modem.setting("+CNMP") == "2"
    assert not file_of(tmp_path).exists()


def _site(tmp_path, port, set_mode):
    path = service.site_toml(tmp_path, port, str(tmp_path / "none"))
    mode = f'set_mode = "{set_mode}"\n' if set_mode else ""
    path.write_text(path.read_text().replace('driver = "sim800"\n', f'driver = "sim7600"\n{mode}'))
    return path


def test_sigterm_sets_it_back(tmp_path):
    modem = ObservedModem(MODELS["sim7600"], tmp_path / "runs")
    with PtyDevice(answering(modem)) as port:
        with service.running_service(_site(tmp_path, port.path, "gsm")) as logger:
            service.wait_for(lambda: modem.setting("+CNMP") == "13", LIMIT_S)
            service.stop_service(logger)
    assert modem.setting("+CNMP") == "2"
    (run,) = (tmp_path / "runs").glob("run-*.h5")
    assert "mode-restored" in notes(read_run(run))


def test_a_stop_in_the_middle_of_the_change(tmp_path):
    """The modem takes its time for the command and hears nothing meanwhile."""
    dialect = replace(MODELS["sim7600"], takes_s={"+CNMP=13": 3.0})
    modem = ObservedModem(dialect, tmp_path, time.monotonic)
    with PtyDevice(answering(modem)) as port, recording(tmp_path, port.path) as (found, _):
        service.wait_for(lambda: "AT+CNMP=13" in modem.lines, LIMIT_S)
    assert modem.setting("+CNMP") == "2"
    assert "mode-restored" in notes(found[0])
    assert not file_of(tmp_path).exists()


@pytest.mark.parametrize("set_mode", ["", "gsm"])
def test_after_kill_9_the_next_start_sets_it_back(tmp_path, set_mode):
    folder = tmp_path / "runs"
    modem = ObservedModem(MODELS["sim7600"], folder)
    with PtyDevice(answering(modem)) as port:
        with service.running_service(_site(tmp_path, port.path, "gsm")) as logger:
            service.wait_for(lambda: modem.setting("+CNMP") == "13", LIMIT_S)
            logger.kill()
            logger.communicate()
        assert modem.setting("+CNMP") == "13"
        (kept,) = json.loads(file_of(folder).read_text())
        assert (kept["asks"], kept["value"]) == ("AT+CNMP?", "2")
        modem.modem.restart()
        sent = len(modem.lines)
        with service.running_service(_site(tmp_path, port.path, set_mode)) as logger:
            if set_mode:
                service.wait_for(lambda: modem.lines[sent:].count("AT+CPSI?") > 1, LIMIT_S)
            else:
                service.wait_for(lambda: modem.setting("+CNMP") == "2", LIMIT_S)
            service.stop_service(logger)
    assert modem.setting("+CNMP") == "2"
    assert not file_of(folder).exists()
    last = notes(read_run(max(folder.glob("run-*.h5"))))
    assert "mode-restored" in last
    assert ("it was 2" in last.get("mode-gsm", "")) == bool(set_mode)


def test_a_modem_pulled_out_is_set_back_when_it_is_there_again(tmp_path):
    modem = ObservedModem(MODELS["sim7600"], tmp_path)
    with PtyDevice(answering(modem), tmp_path / "modem") as port:
        with recording(tmp_path, port.path) as (found, _):
            service.wait_for(lambda: modem.setting("+CNMP") == "13", LIMIT_S)
            port.unplug()
            modem.modem.restart()
        noted = notes(found[0])
        assert "AT+CNMP=2" in noted["mode-left"]
        assert "mode-restored" not in noted
        assert file_of(tmp_path).exists()
        port.plug()
        with recording(tmp_path, port.path, set_mode="") as (found, _):
            service.wait_for(lambda: modem.setting("+CNMP") == "2", LIMIT_S)
    assert "mode-restored" in notes(found[0])
    assert not file_of(tmp_path).exists()


@pytest.mark.parametrize(
    "other", [DIALECTS["ec25"], SIM7100], ids=["another family", "another model"]
)
def test_another_modem_is_not_given_what_was_of_the_first(tmp_path, other):
    first = ObservedModem(MODELS["sim7600"], tmp_path)
    with PtyDevice(answering(first), tmp_path / "modem") as port, recording(tmp_path, port.path):
        service.wait_for(lambda: first.setting("+CNMP") == "13", LIMIT_S)
        port.unplug()
    noted, second = run_once(tmp_path, other, set_mode="")
    assert "SIMCOM_SIM7600E-H" in noted["mode-kept"]
    assert not [line for line in second.lines if "CNMP" in line or "nwscanmode" in line]
    # nor is it lost where the other one is set and set back
    run_once(
        tmp_path,
        other,
        until=lambda modem: any("=13" in one or ",1,1" in one for one in modem.lines),
    )
    (kept,) = json.loads(file_of(tmp_path).read_text())
    assert kept["model"] == "SIMCOM_SIM7600E-H"
    run_once(
        tmp_path,
        None,
        set_mode="",
        until=lambda modem: modem.setting("+CNMP") == "2",
        watched=first,
    )
    assert not file_of(tmp_path).exists()


def test_what_the_owner_has_changed_since_is_left_so(tmp_path):
    modem = ObservedModem(MODELS["sim7600"], tmp_path)
    file_of(tmp_path).write_text(
        json.dumps(
            [{"driver": "sim7600", "model": "SIMCOM_SIM7600E-H", "asks": "AT+CNMP?", "value": "2"}]
        )
    )
    modem.modem.feed(b"AT+CNMP=38\r")
    noted, _ = run_once(tmp_path, None, set_mode="", watched=modem)
    assert "left so" in noted["mode-restored"]
    assert modem.setting("+CNMP") == "38"
    assert not file_of(tmp_path).exists()


@pytest.mark.parametrize("value", ["2;+CFUN=0", "", "1,1"])
def test_a_value_that_is_none_is_not_sent(tmp_path, value):
    modem = ObservedModem(MODELS["sim7600"], tmp_path)
    modem.modem.feed(b"AT+CNMP=13\r")
    file_of(tmp_path).write_text(
        json.dumps(
            [
                {
                    "driver": "sim7600",
                    "model": "SIMCOM_SIM7600E-H",
                    "asks": "AT+CNMP?",
                    "value": value,
                }
            ]
        )
    )
    noted, _ = run_once(tmp_path, None, set_mode="", watched=modem)
    assert "mode-left" in noted
    assert not [line for line in modem.lines if line.startswith(("AT+CNMP=", "AT+CFUN"))]


def test_a_card_that_keeps_nothing_leaves_the_modem_alone(tmp_path):
    (tmp_path / f"{FILE}.part").mkdir()
    noted, modem = run_once(tmp_path, MODELS["sim7600"])
    assert "cannot be kept" in noted["mode-unchanged"]
    assert not [line for line in modem.lines if line.startswith("AT+CNMP=")]


def test_a_damaged_file_is_neither_obeyed_nor_lost(tmp_path):
    file_of(tmp_path).write_text("[{")
    noted, modem = run_once(tmp_path, MODELS["sim7600"])
    assert "is damaged" in noted["mode-unchanged"]
    assert file_of(tmp_path).read_text() == "[{"
    assert not [line for line in modem.lines if line.startswith("AT+CNMP=")]


def test_a_modem_that_forgets_is_set_again(tmp_path):
    """One whose choice does not outlast the power."""
    dialect = MODELS["sim7600"]
    forgets = {**dialect.settings, "+CNMP": replace(dialect.settings["+CNMP"], stored=False)}
    modem = ObservedModem(replace(dialect, settings=forgets), tmp_path)
    with PtyDevice(answering(modem)) as port, recording(tmp_path, port.path):
        service.wait_for(lambda: modem.setting("+CNMP") == "13", LIMIT_S)
        modem.modem.restart()
        service.wait_for(lambda: modem.lines.count("AT+CNMP=13") == 2, LIMIT_S)
    assert modem.setting("+CNMP") == "2"
    assert not file_of(tmp_path).exists()
