import fcntl
import json
import logging
import re
from pathlib import Path

import pytest

from logger.cli import main
from logger.device.link import Line
from logger.device.mode_switch import SavedMode, SavedModes
from logger.doctor.examination import examine, overall
from logger.doctor.single_tests import open_journal
from logger.sim.ptys import PtyDevice, answering
from tests.kit import runs, service
from tests.kit.dialects import DIALECTS
from tests.kit.mode_modems import ObservedModem
from tests.kit.simulated_devices import simulated_devices


def _trial(site, capsys, *ok, seconds=(3, 12, 60)):
    """Exit code and lines of a trial; of a longer one where a busy machine has not come so far."""
    for lasts_s in seconds:
        code = main(["doctor", "--config", str(site), "--seconds", str(lasts_s), "--json"])
        found = json.loads(capsys.readouterr().out)
        lines = {line["what"]: line for line in found}
        if all(lines[what]["state"] == "ok" for what in ok):
            break
    return code, lines


def test_a_trial_on_real_ports_passes(tmp_path, capsys):
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        code, lines = _trial(site, capsys, "modem", "readings", "gnss", "SIM")
    assert code == 0, lines
    assert [lines[what]["state"] for what in ("disk", "modem", "readings", "gnss", "SIM")] == [
        "ok"
    ] * 5, lines
    assert "SIM not inserted" in lines["SIM"]["text"]
    assert not list((tmp_path / "runs").iterdir())
    assert next(iter(lines)) == "overall"
    assert lines["overall"]["text"].startswith("ready to walk")


def test_a_silent_modem_is_reported_with_advice(tmp_path, capsys):
    with simulated_devices() as (_, gnss, silent):
        site = service.site_toml(tmp_path, silent.path, gnss.path)
        code, lines = _trial(site, capsys, "gnss")
    assert code == 2
    assert lines["modem"]["text"].startswith("no scan")
    text = "not ready to walk: modem: gives no answer to AT: powered?"
    assert (lines["overall"]["state"], lines["overall"]["text"].startswith(text)) == ("fail", True)


def test_a_run_in_progress_is_tested_without_disturbing_it(tmp_path, capsys):
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running_service(site) as logger:
            service.wait_for(lambda: open_journal(tmp_path / "runs") is not None)
            service.wait_for(lambda: "usable" in _doctor(site, capsys))
            service.stop_service(logger)
    assert open_journal(tmp_path / "empty") is None


def test_of_a_long_run_in_progress_its_end_is_read(tmp_path):
    site = service.site_toml(tmp_path, "/dev/ttyUSB77", "/dev/ttyUSB78")
    (tmp_path / "runs").mkdir()
    runs.write_journal(tmp_path / "runs" / "run-000001.journal", runs.records(5000), close=False)
    with (tmp_path / "runs" / "run-000001.journal").open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # as its writer does
        examination = examine(site)
    states = {line.what: line.state for line in examination.lines}
    assert (states["recording"], states["gnss"], states["readings"]) == ("ok", "ok", "ok")
    assert 600 <= len(examination.run.tables["fixes"]) < 1000
    assert len(examination.run.tables["notes"]) == 500


def test_the_status_of_a_running_service_is_used(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running_service(site) as logger:
            service.wait_for(lambda: "ok    status: recording:" in _doctor(site, capsys))
            out = _doctor(site, capsys)
            assert "ok    card: all records up to" in out
            assert "ok    queue: " in out
            gnss.unplug()
            service.wait_for(lambda: "fail  status: error:" in _doctor(site, capsys))
            service.stop_service(logger)


def _doctor(site, capsys):
    main(["doctor", "--config", str(site)])
    out = capsys.readouterr().out
    return out if "is being written" in out else ""


def test_who_may_not_ask_the_service_is_told_so_first(tmp_path, capsys, monkeypatch):
    # a trial would find the service's ports in use, and doctor would blame the modem
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    (tmp_path / "status.json").mkdir()
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "gnss"))
    main(["doctor", "--config", str(site), "--seconds", "1"])
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("fail  overall: not ready to walk: status: ")
    assert "run this with sudo" in first


def test_a_journal_of_another_user_ends_no_examination(tmp_path, monkeypatch):
    (tmp_path / "run-000001.journal").touch()
    monkeypatch.setattr(Path, "open", _deny)
    assert open_journal(tmp_path) is None


def _deny(path, *_):
    raise PermissionError(path)


def test_a_missing_configuration_is_one_line(capsys):
    assert main(["doctor", "--config", str(Path("nowhere.toml"))]) == 2
    assert capsys.readouterr().err.startswith("fieldlogger: nowhere.toml")


def test_a_missing_configuration_is_reported_with_advice(tmp_path, capsys):
    site = tmp_path / "site.toml"
    for command in ("doctor", "check"):
        assert main([command, "--config", str(site)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"`fieldlogger probe --write {site}`" in line


def test_a_report_for_asking_others_names_nobody(tmp_path, capsys):
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        note = "# at 52.51234 13.41234, call +491701234567"
        site.write_text(f'{site.read_text()}\n{note}\n[live]\ntarget = "262-01-4711-17"\n')
        report = tmp_path / "report.txt"
        command = ["doctor", "--config", str(site), "--seconds", "5", "--report", str(report)]
        main(command)
    first = capsys.readouterr().out.splitlines()[0]
    text = report.read_text()
    assert first in text
    assert 'target = "[cell]"' in text
    for part in ("versions", "cellwalk", "kernel", "modem-ready"):
        assert part in text
    assert not re.search(r"\d{6,}|\d\.\d{4,}|4711|1701234567", text)


def test_a_report_to_nowhere_is_one_line(tmp_path, capsys):
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "gnss"))
    report = str(tmp_path / "no/report.txt")
    assert main(["doctor", "--config", str(site), "--seconds", "1", "--report", report]) == 2
    out, err = capsys.readouterr()
    assert "no/report.txt: No such file or directory" in err
    assert "overall: not " in out  # seconds of tests are not lost


def test_the_level_of_the_log_is_restored(tmp_path, capsys):
    level = logging.getLogger().level
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "gnss"))
    main(["doctor", "--config", str(site), "--seconds", "1"])
    capsys.readouterr()
    assert logging.getLogger().level == level


def test_missing_ports_are_reported_with_advice(tmp_path, capsys):
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "gnss"))
    assert main(["doctor", "--config", str(site), "--seconds", "1"]) == 2
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("fail  overall: not ready to walk: modem: ")
    assert "`fieldlogger probe --write site.toml`" in first


@pytest.mark.parametrize(
    ("lines", "state", "text"),
    [
        ([], "ok", "ready to walk"),
        ([("ok", "modem", "")], "ok", "ready to walk"),
        (
            [("warn", "disk", "little"), ("warn", "service", "off")],
            "ok",
            "ready to walk; check also: disk, service",
        ),
        ([("warn", "gnss", "no position")], "warn", "not yet ready to walk: gnss: no position"),
        (
            [("warn", "disk", ""), ("warn", "readings", "only LTE")],
            "warn",
            "not yet ready to walk: readings: only LTE",
        ),
        (
            [("warn", "gnss", ""), ("fail", "disk", "full")],
            "fail",
            "not ready to walk: disk: full (and 1 more below)",
        ),
        (
            [("fail", "modem", "/dev/ttyUSB0 is held by gpsd: sudo kill 7")],
            "fail",
            "not ready to walk: modem: /dev/ttyUSB0 is held by gpsd: sudo kill 7",
        ),
        (
            [("fail", "modem", "/dev/null is no serial port")],
            "fail",
            (
                "not ready to walk: modem: /dev/null is no serial port; "
                "`fieldlogger probe --write site.toml` finds the ports"
            ),
        ),
    ],
)
def test_the_first_line_sums_up(lines, state, text):
    assert overall(Line(*line) for line in lines) == Line(state, "overall", text)


def _lte(tmp_path, set_mode=""):
    """A configuration, and a SIM7600 that its owner has set to LTE only."""
    modem = ObservedModem(DIALECTS["sim7600"], tmp_path)
    modem.modem.feed(b"AT+CNMP=38\r")
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "none"))
    mode = f'set_mode = "{set_mode}"\n' if set_mode else ""
    site.write_text(site.read_text().replace('driver = "sim800"\n', mode))
    return modem, site


def test_without_gsm_no_2g_catcher_would_be_recorded(tmp_path, capsys):
    modem, site = _lte(tmp_path)
    with PtyDevice(answering(modem), tmp_path / "modem"):
        _, lines = _trial(site, capsys, "modem")
    assert lines["readings"]["state"] == "warn"
    text = 'only LTE: a 2G catcher would not be recorded; set_mode = "gsm" (AT+CNMP=13)'
    assert lines["readings"]["text"].endswith(text)
    assert next(iter(lines)) == "overall"
    assert lines["overall"]["state"] != "ok"


def test_the_trial_leaves_the_modem_as_it_is(tmp_path, capsys):
    modem, site = _lte(tmp_path, "gsm")
    with PtyDevice(answering(modem), tmp_path / "modem"):
        _, lines = _trial(site, capsys, "readings")
    assert lines["readings"]["state"] == "ok"
    assert "`fieldlogger run` sets it to GSM only" in lines["readings"]["text"]
    assert modem.setting("+CNMP") == "38"
    assert not [line for line in modem.lines if line.startswith("AT+CNMP")]


def test_a_modem_left_on_gsm_only_is_reported(tmp_path, capsys):
    modem, site = _lte(tmp_path)
    saved = SavedMode("sim7600", "SIMCOM_SIM7600E-H", "AT+CNMP?", "2")
    (tmp_path / "runs").mkdir()
    SavedModes(tmp_path / "runs").save(saved)
    with PtyDevice(answering(modem), tmp_path / "modem"):
        main(["doctor", "--config", str(site), "--seconds", "1"])
    assert "warn  mode: SIMCOM_SIM7600E-H is still on GSM only" in capsys.readouterr().out
    assert SavedModes(tmp_path / "runs").all() == (saved,)
