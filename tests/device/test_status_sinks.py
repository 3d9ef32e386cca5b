"""Every output of the status, and that none of them can stop a recording."""

import os
import socket
from dataclasses import dataclass, field

import msgspec
import pytest

from logger.config import StatusSettings
from logger.device.notify import ServiceManager
from logger.device.status import Status, read_status
from logger.device.status_sinks import StatusFile, status_sinks

STATUS = Status("error", "card full", "run-1.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {})


@dataclass
class Systemd:
    """A systemd that reads its socket when asked."""

    server: socket.socket
    address: str = field(default=f"@cellwalk-sinks-{os.getpid()}")

    def __post_init__(self):
        self.server.bind(self.address.replace("@", "\0", 1))
        self.server.settimeout(0.1)

    def messages(self):
        received = []
        try:
            while True:
                received.append(self.server.recv(4096).decode())
        except TimeoutError:
            return received


@pytest.fixture
def systemd():
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        yield Systemd(server)


def test_all_sinks_show_the_status(tmp_path, systemd):
    manager = ServiceManager(systemd.address)
    with status_sinks(StatusSettings(), manager, {"RUNTIME_DIRECTORY": str(tmp_path)}) as sinks:
        for show in sinks:
            show(STATUS)
    assert read_status(tmp_path) == STATUS
    assert systemd.messages() == ["STATUS=card full"]


def test_systemd_receives_a_line_only_when_it_changes(systemd):
    manager = ServiceManager(systemd.address)
    with status_sinks(StatusSettings(), manager, {}) as sinks:
        for text in ("a", "a", "b"):
            for show in sinks:
                show(msgspec.structs.replace(STATUS, text=text))
    assert systemd.messages() == ["STATUS=a", "STATUS=b"]


def test_a_folder_that_vanishes_is_logged_once_and_used_when_it_is_there_again(tmp_path, caplog):
    sink = StatusFile(tmp_path / "gone")
    sink.publish(STATUS)
    sink.publish(STATUS)
    assert len(caplog.records) == 1
    (tmp_path / "gone").mkdir()
    sink.publish(STATUS)
    assert read_status(tmp_path / "gone") == STATUS


def test_the_watchdog_is_fed_only_while_the_recorder_counts(systemd):
    manager = ServiceManager(systemd.address)
    for count in (5, 5, 6, 0, 0):
        manager.heartbeat(count)
    assert systemd.messages() == ["READY=1", "WATCHDOG=1"]
