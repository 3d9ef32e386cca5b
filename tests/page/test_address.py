"""Where the page listens: at one address of the Pi, or nowhere."""

import socket
import subprocess

import pytest

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
