"""Readers of the feed on real sockets, what a line contains, and that no reader can block."""

import json
import socket
import stat
from contextlib import suppress

import pytest
from msgspec.structs import replace

from logger.device.live_view import SuspicionStatus
from logger.device.status import FixStatus, Status
from logger.device.status_sinks import StatusFeed, feed_line
from tests.kit import service
from tests.kit.simulated_devices import simulated_devices

S = 10**9
FIX = FixStatus(99 * S, True, "2026-05-01T10:00:00Z", 52.51234, 13.41234, 3.0, 0.9, 9)
STATUS = Status(
    "suspicious", "see text", "/var/lib/cellwalk/run-000017.journal", 4711, 100 * S, 5 * S, 99 * S,
    90, 40, 280, 1, 20_000, FIX, {},
    suspicions=(SuspicionStatus("262-01-4711-17", "suspicious", 7.1, ("no neighbours",)),),
)  # fmt: skip


def _reader(address):
    if address.isdecimal():
        return socket.create_connection(("127.0.0.1", int(address)), timeout=5)
    reader = socket.socket(socket.AF_UNIX)
    reader.settimeout(5)
    reader.connect(address)
    return reader


def _listens(path):
    """The file is there a moment before the socket listens."""
    with socket.socket(socket.AF_UNIX) as reader, suppress(OSError):
        reader.connect(str(path))
        return True
    return False


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return str(server.getsockname()[1])


@pytest.fixture(params=["unix", "tcp"])
def address(request, tmp_path):
    return str(tmp_path / "feed.sock") if request.param == "unix" else _free_port()


def test_every_reader_receives_every_line(address):
    feed = StatusFeed(address)
    with _reader(address) as one, _reader(address) as two:
        for _ in range(3):
            feed.publish(STATUS)
        for reader in (one, two):
            lines = [reader.makefile("rb").readline() for _ in range(1)]
            assert json.loads(lines[0]) == feed_line(STATUS)
    feed.close()


def test_a_line_has_no_position_no_time_and_no_file():
    line = feed_line(STATUS)
    assert line["unusual"] == [
        {"cell": "262-01-4711-17", "word": "suspicious", "reasons": ["no neighbours"]}
    ]
    assert (line["uptime_s"], line["has_fix"], line["satellites"]) == (95, True, 9)
    silent = replace(STATUS, fix=replace(FIX, t_ns=90 * S))  # the receiver says nothing any more
    assert not feed_line(silent)["has_fix"]
    text = json.dumps(line)
    for private in ("52.5", "13.4", "2026", "run-0", "4711,", "/var"):
        assert private not in text


def test_a_reader_that_does_not_read_is_disconnected_and_others_go_on(address):
    feed = StatusFeed(address)
    long = [SuspicionStatus(f"262-01-1-{i}", "unusual", 1.0, ("x" * 900,)) for i in range(99)]
    status = replace(STATUS, suspicions=tuple(long))
    with _reader(address), _reader(address) as awake:
        for _ in range(99):
            feed.publish(status)
            if len(feed._readers) < 2:
                break
            awake.settimeout(0.2)
            received = b""
            while not received.endswith(b"\n"):
                received += awake.recv(1 << 20)
        assert len(feed._readers) == 1
    feed.close()


def test_a_reader_that_leaves_is_forgotten(address):
    feed = StatusFeed(address)
    _reader(address).close()
    for _ in range(3):
        feed.publish(STATUS)
    assert feed._readers == []
    feed.close()


def test_a_unix_socket_is_for_the_group_and_goes_with_the_service(tmp_path):
    path = tmp_path / "feed.sock"
    first = StatusFeed(str(path))
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
    StatusFeed(str(path)).close()  # after a service that was killed
    assert not path.exists()
    first.close()


@pytest.mark.parametrize("address", ["", "/nowhere/feed.sock"])
def test_without_a_usable_address_the_recording_goes_on(address, caplog):
    feed = StatusFeed(address)
    feed.publish(STATUS)
    feed.close()
    assert ("no feed on" in caplog.text) == bool(address)


def test_a_file_that_is_no_socket_is_kept(tmp_path, caplog):
    (tmp_path / "precious").write_text("x")
    StatusFeed(str(tmp_path / "precious")).close()
    assert (tmp_path / "precious").read_text() == "x"
    assert "no feed on" in caplog.text


def test_the_feed_of_a_running_service(tmp_path):
    path = tmp_path / "feed.sock"
    with simulated_devices() as (modem, gnss, _):
        settings = f'[status]\nfeed = "{path}"\n'
        site = service.site_toml(tmp_path, modem.path, gnss.path, settings)
        with service.running_service(site) as logger:
            service.wait_for(lambda: _listens(path))
            with _reader(str(path)) as reader:
                lines = reader.makefile("rb")
                service.wait_for(lambda: json.loads(lines.readline())["readings"] > 0)
            service.stop_service(logger)
    assert not path.exists()


@pytest.mark.parametrize("address", ["relative.sock", "80", "host:5557", "/" + "x" * 200])
def test_an_address_that_cannot_be_is_a_configuration_error(tmp_path, address, capsys):
    from logger.cli import main

    site = service.site_toml(tmp_path, "/dev/a", "/dev/b", f'[status]\nfeed = "{address}"\n')
    assert main(["check", "--config", str(site)]) == 2
    assert "feed" in capsys.readouterr().err
