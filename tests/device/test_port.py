import errno
import os
import pty
import select
import socket
import threading
import tty
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial
import serial.rfc2217
from serial.urlhandler import protocol_socket

from logger.config import NmeaSettings
from logger.core.errors import ConfigError, DeviceError
from logger.core.types import RawBytes
from logger.device.clock import Clock
from logger.device.gnss_source import NmeaSource
from logger.device.link import Inbox, Link
from logger.device.port import Port, _device_errors, check_url


def _read(port, n):
    """So many bytes, or those that have come when the port falls silent for seconds."""
    data, silent = b"", 0
    while len(data) < n and silent < 50:
        more = port.read()
        data, silent = data + more, 0 if more else silent + 1
    return data


def test_a_numbered_name_that_is_gone_may_have_another_number():
    with pytest.raises(DeviceError, match="/dev/serial/by-id/"):
        Port("/dev/ttyUSB77", 9600, 0.1)
    with pytest.raises(DeviceError, match=r"plugged in\?\Z"):
        Port("/dev/cellwalk-nothing", 9600, 0.1)


def test_reads_and_writes_a_socket_and_hears_it_close():
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with Port(url, 9600, 0.1) as port:
            peer, _ = server.accept()
            with peer:
                peer.sendall(b"$GPGGA" * 500)
                assert _read(port, 3000) == b"$GPGGA" * 500
                port.write(b"AT\r")
                assert peer.recv(10) == b"AT\r"
            with pytest.raises(DeviceError):
                for _ in range(50):
                    port.read()


def _serve_rfc2217(server):
    """A serial port of its own behind the protocol: whatever is written to it comes back."""
    peer, _ = server.accept()
    with peer, serial.serial_for_url("loop://", timeout=0.05) as line:
        manager = serial.rfc2217.PortManager(line, SimpleNamespace(write=peer.sendall))
        peer.settimeout(0.05)
        while True:
            try:
                data = peer.recv(1024)
            except TimeoutError:
                data = None
            if data == b"":
                return
            line.write(b"".join(manager.filter(data or b"")))
            peer.sendall(b"".join(manager.escape(line.read(line.in_waiting))))


# pyserial 3.5 starts its reader thread in the way of Python 2
@pytest.mark.filterwarnings("ignore:set(Daemon|Name)\\(\\):DeprecationWarning")
def test_reads_and_writes_a_port_behind_rfc2217():
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=_serve_rfc2217, args=(server,))
        thread.start()
        with Port(f"rfc2217://127.0.0.1:{server.getsockname()[1]}?timeout=60", 115200, 0.1) as port:
            port.write(b"AT+CENG?\r")
            assert _read(port, 9) == b"AT+CENG?\r"
        thread.join()


def test_what_a_device_sent_before_its_port_was_opened_is_read():
    master, slave = pty.openpty()
    tty.setraw(slave)
    said = bytes(range(256)) * 12
    os.write(master, said)
    with Port(os.ttyname(slave), 115200, 0.1) as port:
        assert _read(port, len(said)) == said
    os.close(master)
    os.close(slave)


def test_what_a_network_port_sends_at_once_is_read(monkeypatch):
    """pyserial's flush comes right after the connection; here it finds what the other end has said
    meanwhile.
    """
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer_first(opened):
            peer, _ = server.accept()
            peer.sendall(b"$GPGGA" * 100)
            peers.append(peer)
            select.select([opened._socket], [], [], 20.0)

        peers = []
        monkeypatch.setattr(protocol_socket.Serial, "_update_rts_state", answer_first)
        with Port(f"socket://127.0.0.1:{server.getsockname()[1]}", 9600, 0.1) as port:
            heard = _read(port, 600)
        peers[0].close()
        assert heard == b"$GPGGA" * 100


@pytest.mark.parametrize(
    "ends", [lambda link: None, lambda link: link.read(), DeviceError("no answer")]
)
def test_what_waits_in_a_port_that_is_left_is_recorded(tmp_path, ends):
    """A session that ends by itself or by an error leaves nothing in the port, which forgets it
    when it is closed.
    """
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.write(master, b"+CENG: 1,1\r\n" * 300)
    inbox, stop = Inbox(), threading.Event()

    class EndingSource(NmeaSource):
        def session(self, link, folder):
            stop.set()
            if isinstance(ends, Exception):
                raise ends
            ends(link)

    source = EndingSource(NmeaSettings(name="gnss", port=os.ttyname(slave)))
    Link(source, Clock(), inbox, stop).run(tmp_path)
    values = []
    while (record := inbox.get(0.0)) is not None:
        values.append(record.value)
    assert b"".join(v.data for v in values if isinstance(v, RawBytes)) == b"+CENG: 1,1\r\n" * 300
    os.close(master)
    os.close(slave)


def test_a_device_that_the_unit_does_not_allow():
    """The kernel refuses it with EPERM, whoever owns it."""
    with (
        pytest.raises(DeviceError, match=r"/dev/rfcomm0: .*DeviceAllow="),
        _device_errors("/dev/rfcomm0"),
    ):
        raise serial.SerialException(errno.EPERM, "could not open port")


def test_a_socket_that_nobody_serves():
    with pytest.raises(DeviceError, match="socket://127.0.0.1:1"):
        Port("socket://127.0.0.1:1", 9600, 0.1)


def test_a_far_end_that_vanishes_is_probed():
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1]
        with Port(f"socket://127.0.0.1:{number}", 9600, 0.1):
            rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()]
            (timer,) = [row[5] for row in rows if row[2] == f"0100007F:{number:04X}"]
    assert timer.startswith("02:")  # keepalive (Linux, networking/proc_net_tcp.rst)


def test_unplugging_is_a_device_error():
    master, slave = pty.openpty()
    with Port(os.ttyname(slave), 9600, 0.1) as port:
        os.close(slave)
        os.write(master, b"hello")
        assert _read(port, 5) == b"hello"
        threading.Timer(0.2, os.close, (master,)).start()
        with pytest.raises(DeviceError):
            while True:
                port.read()
        with pytest.raises(DeviceError):
            port.write(b"x" * 10)


def test_a_port_is_ours_alone_and_can_be_opened_again():
    master, slave = pty.openpty()
    path = os.ttyname(slave)
    with Port(path, 9600, 0.1), pytest.raises(DeviceError, match="in use"):
        Port(path, 9600, 0.1)
    with Port(path, 9600, 0.1) as port:
        assert port.read() == b""
    os.close(master)
    os.close(slave)


def test_a_url_of_an_unknown_kind_is_a_mistake_in_the_configuration():
    check_url("/dev/ttyUSB77")
    check_url("rfc2217://127.0.0.1:4000")
    with pytest.raises(ConfigError, match="smoke"):
        check_url("smoke://signal")


@pytest.mark.parametrize(
    "url", ["gpsd://", "gpsd://somewhere", "gpsd://[::1]:2947/dev/ttyACM0", "gpsd:///dev/ttyACM0"]
)
def test_gpsd_is_named_by_its_own_scheme(url):
    check_url(url)


@pytest.mark.parametrize("url", ["gpsd://localhost:99999", "gpsd://localhost:gps", "gpsd://[::1"])
def test_gpsd_at_an_impossible_place(url):
    with pytest.raises(ConfigError, match="gpsd://"):
        check_url(url)


def test_what_came_before_a_socket_closed_is_not_lost():
    with socket.create_server(("127.0.0.1", 0)) as server:
        with Port(f"gpsd://127.0.0.1:{server.getsockname()[1]}/dev/a", 9600, 0.2) as port:
            peer, _ = server.accept()
            peer.sendall(b"x" * 10_000)
            peer.close()
            assert _read(port, 10_000) == b"x" * 10_000
            with pytest.raises(DeviceError):
                port.read()
