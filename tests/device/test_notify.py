import os
import signal
import socket
import time
from pathlib import Path

import pytest

from logger.core.runfile import read_run
from logger.device import notify
from logger.device.notify import ServiceManager
from tests.kit import service
from tests.kit.simulated_devices import simulated_devices


@pytest.fixture(params=["path", "abstract"])
def notifications(request, tmp_path):
    """A systemd that listens, by either kind of address."""
    name = str(tmp_path / "notify") if request.param == "path" else f"@cellwalk-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(name.replace("@", "\0", 1))
        server.settimeout(service.LIMIT_S)
        yield name, lambda: server.recv(4096).decode().splitlines()


def test_the_first_word_says_that_it_has_started_and_all_feed_the_watchdog(notifications):
    address, next_word = notifications
    manager = ServiceManager.of({"NOTIFY_SOCKET": address})
    assert manager.is_present
    manager.alive()
    manager.alive()
    manager.status("12 fixes\nREADY=0")
    manager.stopping()
    said = [next_word() for _ in range(5)]
    assert said == [
        ["READY=1"],
        ["WATCHDOG=1"],
        ["WATCHDOG=1"],
        ["STATUS=12 fixes READY=0"],
        ["STOPPING=1"],
    ]


def test_no_watchdog_ends_a_long_stop(notifications):
    # systemd 252 killed a slow board that made an HDF5 file, 30 s after its last durable write
    address, next_word = notifications
    manager = ServiceManager.of({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "30000000"})
    manager.alive()
    manager.stopping()
    for count in (5, 6):
        manager.heartbeat(count)
    manager.status("end")
    said = [next_word()[0] for _ in range(7)]
    assert said[3:] == ["STOPPING=1", "WATCHDOG_USEC=86400000000", "WATCHDOG=1", "STATUS=end"]


def test_a_slow_start_has_a_longer_watchdog(notifications):
    """The unit's own is back with the second durable write that the main thread has seen."""
    address, next_word = notifications
    manager = ServiceManager.of({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "30000000"})
    manager.alive()
    for count in (5, 6, 7):
        manager.heartbeat(count)
    said = [next_word()[0] for _ in range(6)]
    assert said == [
        "READY=1",
        "WATCHDOG_USEC=180000000",
        "WATCHDOG=1",
        "WATCHDOG=1",
        "WATCHDOG_USEC=30000000",
        "WATCHDOG=1",
    ]


def test_without_systemd_nobody_is_told(tmp_path):
    nobody = ServiceManager.of({})
    assert not nobody.is_present
    nobody.alive()
    ServiceManager(str(tmp_path / "gone")).alive()


def test_a_systemd_that_does_not_read_holds_nobody_up(notifications, monkeypatch):
    monkeypatch.setattr(notify, "SEND_TIMEOUT_S", 0.001)
    manager = ServiceManager(notifications[0])
    queue = int(Path("/proc/sys/net/unix/max_dgram_qlen").read_text())

    def tell():
        for _ in range(queue + 100):  # until its queue is full, and beyond
            manager.alive()

    service.assert_ends(tell)


def test_systemd_is_told_of_the_start_the_durable_ticks_and_the_stop(tmp_path, monkeypatch):
    with service.systemd(monkeypatch, tmp_path) as said, simulated_devices() as (modem, gnss, _):
        with service.running_service(service.site_toml(tmp_path, modem.path, gnss.path)) as logger:
            service.wait_for(lambda: "READY=1" in said())
            assert read_run(next((tmp_path / "runs").glob("*.journal"))).meta.origin == "walk"
            service.wait_for(lambda: said().count("WATCHDOG=1") >= 3)
            logger.send_signal(signal.SIGSTOP)
            service.wait_for(
                lambda: (
                    Path(f"/proc/{logger.pid}/stat").read_text().rpartition(")")[2].split()[0]
                    == "T"
                )
            )
            fed = said().count("WATCHDOG=1")
            time.sleep(2.5)  # more than two periods of the watchdog
            assert said().count("WATCHDOG=1") == fed
            logger.send_signal(signal.SIGCONT)
            service.wait_for(lambda: said().count("WATCHDOG=1") >= fed + 3)
            service.stop_service(logger)
        words = said()
    assert words.index("READY=1") < words.index("STOPPING=1")
    assert any(word.startswith("STATUS=") and "fixes" in word for word in words)


def test_earlier_runs_are_recovered_by_the_service_itself_only_without_systemd(
    tmp_path, monkeypatch
):
    """Under systemd that is a unit of its own."""
    with simulated_devices() as (modem, gnss, _):
        site = service.site_toml(tmp_path, modem.path, gnss.path)
        first, second = (tmp_path / f"runs/run-00000{n}.h5" for n in (1, 2))
        with service.systemd(monkeypatch, tmp_path) as said:
            with service.running_service(site) as logger:
                service.wait_for(lambda: "READY=1" in said())
                logger.kill()
            with service.running_service(site) as logger:
                service.wait_for(lambda: said().count("READY=1") == 2)
                service.stop_service(logger)
        assert (first.exists(), second.exists()) == (False, True)
        monkeypatch.delenv("NOTIFY_SOCKET")
        with service.running_service(site, "--duration", "1") as logger:
            logger.communicate(timeout=service.LIMIT_S)
    assert read_run(first).end is None
