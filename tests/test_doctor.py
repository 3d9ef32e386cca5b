import json
import os
from pathlib import Path

import msgspec
import pytest

from logger import doctor
from logger.check import Line
from logger.cli import main
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from logger.device.clock import SystemClock
from logger.device.saved_modes import KeptMode, KeptModes
from logger.device.status import PortStatus, Status
from logger.drivers.registry import FAMILIES
from logger.sim.dialects import DIALECTS
from logger.sim.ptys import PtyDevice, answering
from tests.kit import runs, service
from tests.kit.mode_modems import ObservedModem
from tests.kit.simulated_devices import simulated_devices

S = 10**9


def _of(tmp_path, records):
    path = tmp_path / "a.journal"
    path.unlink(missing_ok=True)
    runs.write_journal(path, records)
    return {line.what: line for line in doctor.of_run(read_run(path))}


def _trial(site, capsys, *ok, seconds=(3, 12, 60)):
    """Exit code and lines of a trial; of a longer one where a busy machine has not come so far."""
    for lasts_s in seconds:
        code = main(["doctor", "--config", str(site), "--seconds", str(lasts_s), "--json"])
        found = json.loads(capsys.readouterr().out)
        lines = {line["what"]: line for line in found}
        if all(lines[what]["state"] == "ok" for what in ok):
            break
    return code, lines


def test_a_trial_on_real_ports_finds_all_well(tmp_path, capsys):
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        code, lines = _trial(site, capsys, "modem", "readings", "gnss", "SIM")
    assert code == 0, lines
    assert [lines[what]["state"] for what in ("disk", "modem", "readings", "gnss", "SIM")] == [
        "ok"
    ] * 5, lines
    assert "SIM not inserted" in lines["SIM"]["text"]
    assert not list((tmp_path / "runs").iterdir())
    assert list(lines)[-1] == "overall"
    assert lines["overall"]["text"].startswith("ready to walk")


def test_a_silent_modem_is_told_with_what_to_do(tmp_path, capsys):
    with simulated_devices() as (_, gnss, silent):
        site = service.site_toml(tmp_path, silent.path, gnss.path)
        code, lines = _trial(site, capsys, "gnss")
    assert code == 2
    assert lines["modem"]["text"].startswith("no scan")
    says = "not ready to walk: modem: gives no answer to AT: powered?"
    assert (lines["overall"]["state"], lines["overall"]["text"].startswith(says)) == ("fail", True)


def test_a_run_under_way_is_looked_at_and_not_disturbed(tmp_path, capsys):
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running_service(site) as logger:
            service.wait_for(lambda: doctor.recording(tmp_path / "runs") is not None)
            service.wait_for(lambda: "usable" in _doctor(site, capsys))
            service.stop_service(logger)
    assert doctor.recording(tmp_path / "empty") is None


def test_a_running_service_is_asked_and_not_guessed_at(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running_service(site) as logger:
            service.wait_for(lambda: "ok    status: recording:" in _doctor(site, capsys))
            out = _doctor(site, capsys)
            assert "ok    card: has taken everything up to" in out
            assert "ok    queue: " in out
            gnss.unplug()
            service.wait_for(lambda: "fail  status: error:" in _doctor(site, capsys))
            service.stop_service(logger)


def test_what_a_service_says_of_itself_is_judged():
    now_ns = SystemClock().now_ns()
    port = PortStatus("/dev/x", event="no such port; is the device plugged in?")
    well = Status("recording", "", "run-1", 1, now_ns, 0, now_ns, 3, 2, 1, 0, 10, None, None, {})

    def states(**changes):
        return {
            line.what: line.state
            for line in doctor.of_status(msgspec.structs.replace(well, **changes))
        }

    assert set(states().values()) == {"ok"}
    assert states(state="no fix")["status"] == "warn"
    assert states(state="error", ports={"modem": port}) == states() | {
        "status": "fail",
        "modem": "fail",
    }
    assert states(synced_ns=now_ns - 60 * S)["card"] == "fail"
    assert states(synced_ns=None, since_ns=now_ns - S)["card"] == "ok"
    assert states(waiting=6)["queue"] == "warn"
    assert states(now_ns=now_ns - 60 * S) == {"status": "fail"}


def _doctor(site, capsys):
    main(["doctor", "--config", str(site)])
    out = capsys.readouterr().out
    return out if "is being written" in out else ""


@pytest.mark.parametrize(
    ("bits", "state"),
    [("0", "ok"), ("50005", "fail"), ("50000", "warn"), ("junk", "ok"), (None, "ok")],
)
def test_undervoltage_as_the_firmware_tells_it(tmp_path, bits, state):
    if bits is not None:
        file = tmp_path / "devices/platform/soc/soc:firmware/get_throttled"
        file.parent.mkdir(parents=True)
        file.write_text(bits + "\n")
    assert doctor.power(tmp_path).state == state


def test_who_else_holds_the_port_is_named():
    with simulated_devices() as (modem, _, _):
        held = os.open(modem.path, os.O_RDWR | os.O_NOCTTY)
        child = os.fork()
        if child == 0:
            os.read(os.open("/dev/zero", os.O_RDONLY), 1)
            import time

            time.sleep(3600)
            os._exit(0)
        try:
            os.close(held)
            (line,) = doctor.holders("modem", modem.path)
        finally:
            os.kill(child, 9)
            os.waitpid(child, 0)
    assert line.state == "fail"
    assert f"process {child}" in line.text


def test_what_the_end_of_a_run_tells(tmp_path):
    fix = [Record(t * S, "gnss", Fix(True, None, 52.0, 13.0, hdop=1.0)) for t in range(1, 61)]
    scan = [Record(t * S, "modem", Scan(t * S, (runs.reading(1, -70.0),))) for t in range(1, 61, 2)]
    good = _of(tmp_path, sorted(fix + scan, key=lambda record: record.t_ns))
    assert {line.state for line in good.values()} == {"ok"}
    assert "of 1 cells" in good["readings"].text
    bad = _of(
        tmp_path,
        [
            Record(S, "modem", Note("warning", "port-lost", "no such port")),
            Record(2 * S, "gnss", Fix(False)),
        ],
    )
    assert [bad[what].state for what in ("modem", "readings", "gnss")] == ["fail", "warn", "warn"]
    assert "no such port" in bad["modem"].text
    assert _of(tmp_path, [Record(S, "modem", Scan(0, ()))])["gnss"].state == "fail"


def test_a_missing_configuration_is_one_line(capsys):
    assert main(["doctor", "--config", str(Path("nowhere.toml"))]) == 2
    assert capsys.readouterr().err.startswith("fieldlogger: nowhere.toml")


def test_no_configuration_is_told_with_how_to_come_by_one(tmp_path, capsys):
    site = tmp_path / "site.toml"
    for command in ("doctor", "check"):
        assert main([command, "--config", str(site)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"`fieldlogger probe --write {site}`" in line


def test_ports_that_do_not_exist_are_told_with_how_to_find_them(tmp_path, capsys):
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "gnss"))
    assert main(["doctor", "--config", str(site), "--seconds", "1"]) == 2
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("fail  overall: not ready to walk: modem: ")
    assert "`fieldlogger probe --write site.toml`" in last


@pytest.mark.parametrize(
    ("lines", "state", "says"),
    [
        ([], "ok", "ready to walk"),
        ([("ok", "modem", "")], "ok", "ready to walk"),
        (
            [("warn", "disk", "little"), ("warn", "service", "off")],
            "ok",
            "ready to walk; to be seen to: disk, service",
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
            "not ready to walk: disk: full (and 1 more above)",
        ),
        (
            [("fail", "modem", "silent")],
            "fail",
            "not ready to walk: modem: silent; `fieldlogger probe --write site.toml` finds the ports",
        ),
    ],
)
def test_the_last_line_is_the_verdict_on_all(lines, state, says):
    assert doctor.overall(Line(*line) for line in lines) == Line(state, "overall", says)


def _lte(tmp_path, set_mode=""):
    """A configuration, and a SIM7600 that its owner has set to LTE only."""
    modem = ObservedModem(DIALECTS["sim7600"], tmp_path)
    modem.modem.feed(b"AT+CNMP=38\r")
    site = service.site_toml(tmp_path, str(tmp_path / "modem"), str(tmp_path / "none"))
    mode = f'set_mode = "{set_mode}"\n' if set_mode else ""
    site.write_text(site.read_text().replace('driver = "sim800"\n', mode))
    return modem, site


def test_where_only_lte_is_heard_no_2g_catcher_would_be_recorded(tmp_path, capsys):
    modem, site = _lte(tmp_path)
    with PtyDevice(answering(modem), tmp_path / "modem"):
        _, lines = _trial(site, capsys, "modem")
    assert lines["readings"]["state"] == "warn"
    says = 'only LTE: a 2G catcher would not be recorded; set_mode = "gsm" (AT+CNMP=13)'
    assert lines["readings"]["text"].endswith(says)
    assert list(lines)[-1] == "overall"
    assert lines["overall"]["state"] != "ok"


def test_the_trial_leaves_the_modem_as_it_is(tmp_path, capsys):
    modem, site = _lte(tmp_path, "gsm")
    with PtyDevice(answering(modem), tmp_path / "modem"):
        _, lines = _trial(site, capsys, "readings")
    assert lines["readings"]["state"] == "ok"
    assert "`fieldlogger run` sets it to GSM only" in lines["readings"]["text"]
    assert modem.setting("+CNMP") == "38"
    assert not [line for line in modem.lines if line.startswith("AT+CNMP")]


def test_a_modem_left_on_gsm_only_is_told_of(tmp_path, capsys):
    modem, site = _lte(tmp_path)
    kept = KeptMode("sim7600", "SIMCOM_SIM7600E-H", "AT+CNMP?", "2")
    (tmp_path / "runs").mkdir()
    KeptModes(tmp_path / "runs").keep(kept)
    with PtyDevice(answering(modem), tmp_path / "modem"):
        main(["doctor", "--config", str(site), "--seconds", "1"])
    assert "warn  mode: SIMCOM_SIM7600E-H is still on GSM only" in capsys.readouterr().out
    assert KeptModes(tmp_path / "runs").all() == (kept,)


def _heard(rats, driver, *notes):
    ready = Note("info", "modem-ready", f"modem set up by driver {driver}")
    cells = [
        CellReading("serving", rat, "262", "01", 1, 1, arfcn=1, rssi_dbm=-70.0) for rat in rats
    ]
    scans = [Record(t * S, "modem", Scan(t * S, tuple(cells))) for t in range(2, 30)]
    return [Record(S, "modem", note) for note in (ready, *notes)] + scans


@pytest.mark.parametrize("driver", FAMILIES)
def test_the_advice_names_the_command_of_the_family(tmp_path, driver):
    line = _of(tmp_path, _heard(["LTE"], driver))["readings"]
    commands = [command.set_to(command.gsm_only) for command in FAMILIES[driver].mode_commands]
    assert line.state == "warn"
    assert "only LTE: a 2G catcher would not be recorded; " in line.text
    assert ('set_mode = "gsm"' in line.text) == bool(commands)
    assert all(command in line.text for command in commands)


@pytest.mark.parametrize(
    ("rats", "says"),
    [
        (["GSM"], None),
        (["LTE", "GSM"], None),
        ([None], None),
        (["LTE", "WCDMA"], "only LTE and WCDMA"),
        (["NR"], "only NR"),
    ],
)
def test_what_is_heard_beside_gsm_is_no_matter(tmp_path, rats, says):
    line = _of(tmp_path, _heard(rats, "sim7600"))["readings"]
    assert (line.state, says is None or says in line.text) == ("warn" if says else "ok", True)
    assert ("2G catcher" in line.text) == (says is not None)


def test_a_modem_that_refused_gsm_only_is_not_advised_of_it_again(tmp_path):
    refused = Note(
        "warning",
        "mode-unchanged",
        "what the modem hears is not changed: the modem refuses AT+CNMP=13",
    )
    line = _of(tmp_path, _heard(["LTE"], "sim7600", refused))["readings"]
    assert line.text.endswith("the modem refuses AT+CNMP=13")
