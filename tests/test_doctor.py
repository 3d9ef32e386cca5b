import json
import os
from pathlib import Path

import msgspec
import pytest

from logger import doctor
from logger.cli import main
from logger.core.runfile import read_run
from logger.core.types import Fix, Note, Record, Scan
from logger.device.clock import SystemClock
from logger.device.status import PortStatus, Status
from tests.kit import runs, service
from tests.kit.sim import devices

S = 10**9


def _of(tmp_path, records):
    path = tmp_path / "a.journal"
    path.unlink(missing_ok=True)
    runs.write_journal(path, records)
    return {line.what: line for line in doctor.of_run(read_run(path))}


def test_a_trial_on_real_ports_finds_all_well(tmp_path, capsys):
    with devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        code = main(["doctor", "--config", str(site), "--seconds", "6", "--json"])
    lines = {line["what"]: line for line in json.loads(capsys.readouterr().out)}
    assert code == 0, lines
    assert [lines[what]["state"] for what in ("disk", "modem", "readings", "gnss", "SIM")] == ["ok"] * 5, lines
    assert "SIM not inserted" in lines["SIM"]["text"]
    assert not list((tmp_path / "runs").iterdir())


def test_a_silent_modem_is_told_with_what_to_do(tmp_path, capsys):
    with devices() as (_, gnss, silent):
        site = service.site_toml(tmp_path, silent.path, gnss.path)
        assert main(["doctor", "--config", str(site), "--seconds", "3"]) == 2
    out = capsys.readouterr().out
    assert "fail  modem: gives no answer to AT: powered?" in out
    assert "fail  modem: no scan" in out
    assert "ok    gnss" in out


def test_a_run_under_way_is_looked_at_and_not_disturbed(tmp_path, capsys):
    with devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running(site) as logger:
            service.wait_for(lambda: doctor.recording(tmp_path / "runs") is not None)
            service.wait_for(lambda: "usable" in _doctor(site, capsys))
            service.stopped(logger)
    assert doctor.recording(tmp_path / "empty") is None


def test_a_running_service_is_asked_and_not_guessed_at(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    with devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running(site) as logger:
            service.wait_for(lambda: "ok    status: recording:" in _doctor(site, capsys))
            out = _doctor(site, capsys)
            assert "ok    card: has taken everything up to" in out
            assert "ok    queue: " in out
            gnss.unplug()
            service.wait_for(lambda: "fail  status: error:" in _doctor(site, capsys))
            service.stopped(logger)


def test_what_a_service_says_of_itself_is_judged():
    now_ns = SystemClock().now_ns()
    port = PortStatus("/dev/x", event="no such port; is the device plugged in?")
    well = Status("recording", "", "run-1", 1, now_ns, 0, now_ns, 3, 2, 1, 0, 10, None, None, {})

    def states(**changes):
        return {line.what: line.state for line in doctor.of_status(msgspec.structs.replace(well, **changes))}

    assert set(states().values()) == {"ok"}
    assert states(state="no fix")["status"] == "warn"
    assert states(state="error", ports={"modem": port}) == states() | {"status": "fail", "modem": "fail"}
    assert states(synced_ns=now_ns - 60 * S)["card"] == "fail"
    assert states(synced_ns=None, since_ns=now_ns - S)["card"] == "ok"
    assert states(waiting=6)["queue"] == "warn"
    assert states(now_ns=now_ns - 60 * S) == {"status": "fail"}


def _doctor(site, capsys):
    main(["doctor", "--config", str(site)])
    out = capsys.readouterr().out
    return out if "is being written" in out else ""


@pytest.mark.parametrize(
    ("bits", "state"), [("0", "ok"), ("50005", "fail"), ("50000", "warn"), ("junk", "ok"), (None, "ok")]
)
def test_undervoltage_as_the_firmware_tells_it(tmp_path, bits, state):
    if bits is not None:
        file = tmp_path / "devices/platform/soc/soc:firmware/get_throttled"
        file.parent.mkdir(parents=True)
        file.write_text(bits + "\n")
    assert doctor.power(tmp_path).state == state


def test_who_else_holds_the_port_is_named():
    with devices() as (modem, _, _):
        held = os.open(modem.path, os.O_RDWR | os.O_NOCTTY)
        child = os.fork()
        if child == 0:
            os.read(os.open("/dev/zero", os.O_RDONLY), 1)
            import time

            time.sleep(30)
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
        [Record(S, "modem", Note("warning", "port-lost", "no such port")), Record(2 * S, "gnss", Fix(False))],
    )
    assert [bad[what].state for what in ("modem", "readings", "gnss")] == ["fail", "warn", "warn"]
    assert "no such port" in bad["modem"].text
    assert _of(tmp_path, [Record(S, "modem", Scan(0, ()))])["gnss"].state == "fail"


def test_a_missing_configuration_is_one_line(capsys):
    assert main(["doctor", "--config", str(Path("nowhere.toml"))]) == 2
    assert capsys.readouterr().err.startswith("fieldlogger: nowhere.toml")
