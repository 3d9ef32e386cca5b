"""The mode before GSM only is restored after every kind of stop, by the real service."""

import json
import threading
import time
from dataclasses import replace

import pytest

from logger.core.runfile import read_run
from logger.device.clock import Clock
from logger.device.mode_switch import FILE
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.ptys import PtyDevice, answering
from tests.kit import service
from tests.kit.dialects import DIALECTS
from tests.kit.mode_modems import MODELS, ObservedModem
from tests.kit.mode_runs import LIMIT_S, SIM7100, config, file_of, notes, recording, run_once


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


def test_the_status_goes_on_while_the_modem_takes_its_time_for_the_stop(tmp_path):
    """The page would say that the recorder is silent, and its reader restart the Pi."""
    dialect = replace(MODELS["sim7600"], takes_s={"+CNMP=2": 4.0})
    modem = ObservedModem(dialect, tmp_path, time.monotonic)
    states, times_s = [], []
    clock = Clock()
    with PtyDevice(answering(modem)) as port:
        site = config(tmp_path, port.path, "gsm")
        under_way = Service(site, begin_run(site, "", clock), clock, threading.Event())
        under_way.start()
        service.wait_for(lambda: modem.setting("+CNMP") == "13", LIMIT_S)

        def publish():
            times_s.append(time.monotonic())
            states.append(under_way.snapshot().state)

        under_way.stop("end", publish)
    assert times_s[-1] - times_s[0] > 3.0
    assert "error" not in states


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
    assert "cannot be saved" in noted["mode-unchanged"]
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
