"""The main thread: what may stand in its way, and what happens without it."""

import signal
import sys
import time

import pytest

from logger.core.runfile import read_run
from logger.device.page_requests import FILE, requests_folder
from logger.device.status import SILENT_S, read_status, status_age_s
from tests.kit import service
from tests.kit.simulated_devices import simulated_devices

PROGRAM = """
import sys, threading, time
from logger import cli
from logger.device import battery, estimator, link, page_requests, service
{defect}
sys.exit(cli.main(sys.argv[1:]))
"""
MARK = b'{"do":"mark","text":"still here"}'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    status = tmp_path / "cellwalk"
    for one in (status, requests_folder(status)):
        one.mkdir()
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(status))
    return tmp_path


def _start_service(folder, modem, gnss):
    page = '[page]\nlisten = "127.0.0.1:1"\n'
    return service.running_service(service.site_toml(folder, modem.path, gnss.path, page))


def _run(folder):
    (path,) = (folder / "runs").glob("*.h5")
    return read_run(path)


def _journal(folder):
    (path,) = (folder / "runs").glob("*.journal")
    return read_run(path)


def _notes(run, code):
    return [row["text"].decode() for row in run.tables["notes"] if row["code"] == code.encode()]


def test_nothing_in_the_page_s_file_stops_the_recorder(folder, monkeypatch):
    lines = (
        *(b"\xff", b'{"do":"mark","text":"\xff"}', b'{"do":"\xc3\x28"}', b"\0" * 900),
        *(b'{"do":"mark","text":"\\ud800"}', b'{"do":"mark","x":%s}' % (b"[" * 900)),
        *(b"9" * 400, b"x" * 100_000),
    )
    with (
        service.systemd(monkeypatch, folder) as said,
        simulated_devices() as (modem, gnss, _),
        _start_service(folder, modem, gnss) as logger,
    ):
        service.wait_for(lambda: read_status(folder / "cellwalk") is not None)
        path = requests_folder(folder / "cellwalk") / FILE
        for line in (*lines, MARK):
            with path.open("ab") as file:
                file.write(line + b"\n")
            time.sleep(0.6)
        service.wait_for(lambda: b"mark" in _journal(folder).tables["notes"]["code"])
        fed, status = said().count("WATCHDOG=1"), read_status(folder / "cellwalk")
        service.wait_for(lambda: said().count("WATCHDOG=1") > fed + 1, 10.0)
        service.wait_for(lambda: read_status(folder / "cellwalk").now_ns > status.now_ns, 10.0)
        service.stop_service(logger)
    run = _run(folder)
    assert run.end.reason == "signal SIGTERM"
    assert _notes(run, "mark") == ["still here"]
    refused = sum(int(text.split()[0]) for text in _notes(run, "page-request"))
    assert refused >= len(lines)


@pytest.mark.parametrize(
    "defect",
    [
        "def fail(*_): raise ValueError\nservice.Service.snapshot = fail",
        "def fail(*_): raise ValueError\npage_requests.PageRequests.take = fail",
        "def fail(*_): raise ValueError\nbattery.BatteryWatch.look = fail",
        "def fail(*_): raise ValueError\nservice.Service._check_ports = fail",
    ],
)
def test_a_bug_in_one_part_of_a_tick_is_counted_and_the_rest_goes_on(folder, monkeypatch, defect):
    program = (sys.executable, "-c", PROGRAM.format(defect=defect))
    monkeypatch.setattr(service, "FIELDLOGGER", program)
    with (
        service.systemd(monkeypatch, folder) as said,
        simulated_devices() as (modem, gnss, _),
        _start_service(folder, modem, gnss) as logger,
    ):
        service.wait_for(lambda: said().count("WATCHDOG=1") > 12)
        logger.send_signal(signal.SIGTERM)
        _, errors = logger.communicate(timeout=service.LIMIT_S)
        assert logger.returncode == 0, errors
    assert errors.splitlines().count("ValueError") == 1
    run = _run(folder)
    assert run.end.reason == "signal SIGTERM"
    assert any("ValueError" in text for text in _notes(run, "internal"))


@pytest.mark.parametrize(
    "defect",
    [
        "def fail(*_, **__): raise MemoryError\nservice.Service.wait = fail",
        "def fail(*_): raise ValueError\nservice.Service._attempt = fail",
        "def fail(*_): raise SystemExit(3)\nservice.Service.snapshot = fail",
        "def fail(*_): raise ValueError\nlink.Link.read = link.Redactor.flush = fail",
        "def fail(*_): raise SystemExit\nlink.Link.read = fail",
    ],
)
def test_a_thread_that_ends_ends_the_service_with_its_run_sealed(folder, monkeypatch, defect):
    """systemd then starts it again."""
    program = (sys.executable, "-c", PROGRAM.format(defect=defect))
    monkeypatch.setattr(service, "FIELDLOGGER", program)
    with simulated_devices() as (modem, gnss, _), _start_service(folder, modem, gnss) as logger:
        logger.communicate(timeout=30.0)
    assert logger.returncode not in {0, None}
    run = _run(folder)
    assert run.end.reason == "internal error of the logger"


SLOW_END = """
finish = estimator.Estimator.finish
def late(self, patience_s):
    time.sleep(8.0)
    return finish(self, patience_s)
estimator.Estimator.finish = late
"""


def test_a_run_that_is_being_closed_is_no_trouble(folder, monkeypatch):
    # a live estimate that is behind takes 20 s to its end, and nobody should pull the plug
    program = (sys.executable, "-c", PROGRAM.format(defect=SLOW_END))
    monkeypatch.setattr(service, "FIELDLOGGER", program)
    silences_s, signs = [], set()
    with simulated_devices() as (modem, gnss, _), _start_service(folder, modem, gnss) as logger:
        service.wait_for(lambda: service.n_recorded(folder / "runs", "fixes") > 5)
        service.wait_for(lambda: read_status(folder / "cellwalk").state == "recording")
        logger.send_signal(signal.SIGTERM)
        while not _journal(folder).end:
            time.sleep(0.2)
            status = read_status(folder / "cellwalk")
            silences_s.append(status_age_s(status))
            signs.add(status.state)
        logger.communicate(timeout=service.LIMIT_S)
    assert max(silences_s) < SILENT_S
    assert signs == {"recording"}


SLOW_HDF5 = """
from logger.core import runfile
finish = runfile.finish_journal
def late(journal):
    time.sleep(5.0)
    return finish(journal)
runfile.finish_journal = late
"""


def test_the_status_says_that_the_hdf5_file_is_being_made_and_systemd_waits(folder, monkeypatch):
    # a Pi Zero takes minutes for a long run, and TimeoutStopSec= is 60 s
    program = (sys.executable, "-c", PROGRAM.format(defect=SLOW_HDF5))
    monkeypatch.setattr(service, "FIELDLOGGER", program)
    silences_s, texts, unsynced_s = [], [], []
    with (
        service.systemd(monkeypatch, folder) as said,
        simulated_devices() as (modem, gnss, _),
        _start_service(folder, modem, gnss) as logger,
    ):
        service.wait_for(lambda: said() and service.n_recorded(folder / "runs", "fixes") > 5)
        logger.send_signal(signal.SIGTERM)
        service.wait_for(lambda: said() and _journal(folder).end)

        def is_made():
            said()  # or its socket is full
            status = read_status(folder / "cellwalk")
            silences_s.append(status_age_s(status))
            unsynced_s.append((status.now_ns - status.synced_ns) / 1e9)
            texts.append(status.text if status.is_over else "")
            return list((folder / "runs").glob("*.h5"))

        service.wait_for(is_made)
        logger.communicate(timeout=service.LIMIT_S)
    assert max(silences_s) < SILENT_S
    assert texts[-1] == "the run is closed; its HDF5 file is being made of run-000001.journal"
    assert unsynced_s[-1] == 0.0
    (asked,) = [text for text in said() if text.startswith("EXTEND_TIMEOUT_USEC=")]
    assert int(asked.partition("=")[2]) > 30_000_000


def test_a_main_thread_that_hangs_is_not_fed(folder, monkeypatch):
    defect = "service.Service.snapshot = lambda self: time.sleep(1000)"
    program = (sys.executable, "-c", PROGRAM.format(defect=defect))
    monkeypatch.setattr(service, "FIELDLOGGER", program)
    with (
        service.systemd(monkeypatch, folder) as said,
        simulated_devices() as (modem, gnss, _),
        _start_service(folder, modem, gnss),
    ):
        service.wait_for(lambda: service.n_recorded(folder / "runs", "fixes") > 0)
        time.sleep(2.0)
        fed, n_fixes = said().count("WATCHDOG=1"), service.n_recorded(folder / "runs", "fixes")
        time.sleep(3.0)
        assert service.n_recorded(folder / "runs", "fixes") > n_fixes
        assert said().count("WATCHDOG=1") == fed
