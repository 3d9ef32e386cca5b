"""Where the page listens: at one address of the Pi, or nowhere."""

import asyncio
import socket
import subprocess

import pytest

from logger.page.server import PATIENCE_S, _listen
from tests.kit import page as kit
from tests.kit import service


def test_without_a_setting_it_ends_and_listens_nowhere(tmp_path):
    kit.folders(tmp_path)
    config = service.site_toml(tmp_path, "/dev/a", "/dev/b")
    command = [*service.FIELDLOGGER, "page", "--config", str(config)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, "the page is off" in done.stdout) == (0, True)
    assert not (tmp_path / "state/token").exists()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", kit.free_port()))


@pytest.mark.parametrize("listen", ["0.0.0.0:8080", "[::]:8080", "8080", "pi:80", "10.42.0.1:0"])
def test_an_address_that_would_serve_every_network_is_an_error(tmp_path, listen):
    config = service.site_toml(tmp_path, "/dev/a", "/dev/b", f'[page]\nlisten = "{listen}"\n')
    command = [*service.FIELDLOGGER, "page", "--config", str(config)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "is not one address of the Pi" in done.stderr


def test_a_phone_that_has_left_does_not_keep_its_connection():
    async def timeout_ms():
        listener = await _listen("127.0.0.1", 0, asyncio.Event())
        with (
            listener,
            socket.create_connection(listener.getsockname()),
            listener.accept()[0] as one,
        ):
            return one.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)

    assert asyncio.run(timeout_ms()) == 1000 * PATIENCE_S
