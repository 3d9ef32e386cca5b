import os
import pty
import socket
import threading
from types import SimpleNamespace

import pytest
import serial
import serial.rfc2217

from logger.core.errors import ConfigError, DeviceError
from logger.device.port import Port, check_url


def _read(port, n):
    data = b""
    while len(data) < n:
        data += port.read()
    return data


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
        with Port(f"rfc2217://127.0.0.1:{server.getsockname()[1]}", 115200, 0.1) as port:
            port.write(b"AT+CENG?\r")
            assert _read(port, 9) == b"AT+CENG?\r"
        thread.join()


def test_a_socket_that_nobody_serves():
    with pytest.raises(DeviceError, match="socket://127.0.0.1:1"):
        Port("socket://127.0.0.1:1", 9600, 0.1)


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


@pytest.mark.parametrize("url", ["gpsd://", "gpsd://somewhere", "gpsd://[::1]:2947/dev/ttyACM0", "gpsd:///dev/ttyACM0"])
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
