import base64
import hashlib
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from logger.core.errors import ConfigError
from postproc.view import viewer
from postproc.view.viewer import content_security_policy, pages, serve, show
from tests.kit.web_server import WebServer

FAKE = """#!/bin/sh
echo "$XDG_CONFIG_HOME $*" >> {folder}/calls
[ "$1" = analytics ] && exit 0
for last; do :; done
test -s "$last" || exit 3
{then}
"""


def fake(folder, then):
    """A stand-in that writes down how it was called, and whether the recording was there."""
    program = folder / "rerun"
    program.write_text(FAKE.format(folder=folder, then=then))
    program.chmod(0o755)
    return program


def write(path):
    path.write_text("a recording")


@pytest.fixture
def screen(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":0")


def test_a_missing_screen_is_an_error_with_alternatives(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match="no screen.*--web.*--save"):
        show(write, "run")


def test_it_runs_in_the_foreground_and_listens_here_only(screen, monkeypatch, tmp_path):
    monkeypatch.setattr(viewer, "binary", lambda: fake(tmp_path, "exit 0"))
    assert show(write, "run") == 0
    settings, opened = (tmp_path / "calls").read_text().splitlines()
    assert settings.endswith(" analytics disable")
    assert "--bind 127.0.0.1" in opened
    assert settings.split()[0] == opened.split()[0] != os.environ.get("XDG_CONFIG_HOME")
    assert not os.path.exists(opened.split()[-1])


NO_GRAPHICS = (
    "echo 'panicked at main: No graphics adapter was found' >&2; exit 102",
    "echo 'Error: app creation: The GPU driver is lacking some abilities' >&2; exit 1",
)
NO_SCREEN = (
    "echo 'Error: Failed to open connection to X server' >&2; exit 1",
    "echo 'WARN no GPU'; echo 'Error: neither WAYLAND_DISPLAY nor DISPLAY is set' >&2; exit 1",
)


@pytest.mark.parametrize(
    ("then", "why"),
    [
        *((script, "no usable graphics") for script in NO_GRAPHICS),
        *((script, "could not open the screen") for script in NO_SCREEN),
        ("exit 7", "code 7"),
    ],
)
def test_a_failure_of_the_viewer_is_one_line(then, why, screen, monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(viewer, "binary", lambda: fake(tmp_path, then))
    with pytest.raises(ConfigError, match=f"{why}.*--web"):
        show(write, "run")
    assert capfd.readouterr() == ("", "")


# a process that a shell started in the background ignores SIGINT, and so would all its children
PROGRAM = """
import signal
import sys
from pathlib import Path
from postproc.view import viewer
signal.signal(signal.SIGINT, signal.default_int_handler)
viewer.binary = lambda: Path(sys.argv[1])
viewer.show(lambda path: path.write_text("a recording"), "run")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_no_viewer_is_left_behind(number, tmp_path):
    program = fake(tmp_path, f"echo $$ > {tmp_path}/pid; exec sleep 60")
    environment = os.environ | {"DISPLAY": ":0"}
    running = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, program], env=environment, stderr=subprocess.DEVNULL
    )
    pid = tmp_path / "pid"
    until = time.monotonic() + 60
    while not (pid.exists() and pid.read_text().strip()):
        assert time.monotonic() < until
        time.sleep(0.02)
    running.send_signal(number)
    assert running.wait(60) != 0
    while Path(f"/proc/{pid.read_text().strip()}").exists():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_viewer_starts_leaves_none_behind(number, tmp_path, monkeypatch):
    """The signal comes when the process exists and its parent does not know it yet."""
    started, start = [], subprocess.Popen

    def start_and_signal(*arguments, **options):
        started.append(start(*arguments, **options))
        os.kill(os.getpid(), number)
        return started[0]

    monkeypatch.setattr(subprocess, "Popen", start_and_signal)
    with (tmp_path / "log").open("wb") as log, pytest.raises(KeyboardInterrupt):
        with viewer.child(["sleep", "60"], os.environ, log.fileno()):
            pytest.fail("the signal was lost")
    assert started[0].poll() is not None


def test_the_real_viewer_is_found():
    assert viewer.binary().is_file()


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("web") / "x.rrd"
    path.write_bytes(b"a recording")
    return path


@pytest.fixture(scope="module")
def web_viewer(recording):
    running = WebServer(recording)
    yield running
    assert running.stop(signal.SIGTERM) == 0
    assert running.errors == ""


def test_it_listens_on_the_loopback_only_without_child_processes(web_viewer):
    process = psutil.Process(web_viewer.process.pid)
    assert process.children(recursive=True) == []
    listening = [one.laddr for one in process.net_connections() if one.status == psutil.CONN_LISTEN]
    assert listening == [("127.0.0.1", web_viewer.port)]


def test_it_serves_the_recording_and_the_viewer(web_viewer):
    assert web_viewer.get("/run.rrd")[2] == b"a recording"
    status, headers, wasm = web_viewer.get("/re_viewer_bg.wasm")
    assert (status, headers["Content-Type"], wasm[:4]) == (200, "application/wasm", b"\0asm")
    status, headers, nothing = web_viewer.get("/re_viewer_bg.wasm", method="HEAD")
    assert (status, headers["Content-Length"], nothing) == (200, str(len(wasm)), b"")
    assert web_viewer.get("/etc/passwd")[0] == 404
    assert web_viewer.get("/../pyproject.toml")[0] == 404


def test_the_page_requests_nothing_from_other_machines(web_viewer):
    _, headers, page = web_viewer.get("/?x=1")
    assert not re.search(rb"<(?:link|script|img)[^>]*(?:href|src)=[\"']?(?:https?:)?//", page)
    assert page.index(b"/guard.js") < page.index(b"re_viewer.js")
    policy = dict(
        part.strip().split(" ", 1) for part in headers["Content-Security-Policy"].split(";")
    )
    assert policy["default-src"] == "'none'"
    assert policy["connect-src"].split()[0] == "'self'"
    assert not any("http" in sources or "*" in sources for sources in policy.values())
    assert "'unsafe-inline'" not in policy["script-src"]


def test_a_request_under_another_host_name_gets_nothing(web_viewer):
    for host in (
        "evil.example",
        f"evil.example:{web_viewer.port}",
        "",
        f"127.0.0.1.evil.example:{web_viewer.port}",
    ):
        status, _, content = web_viewer.get("/run.rrd", host=host or ":")
        assert (status, content) == (421, b"")
    for host in ("localhost", f"localhost:{web_viewer.port}", "127.0.0.1"):
        assert web_viewer.get("/run.rrd", host=host)[0] == 200


def test_a_closed_connection_is_ignored(web_viewer):
    with socket.create_connection(("127.0.0.1", web_viewer.port)) as gone:
        gone.sendall(
            f"GET /re_viewer_bg.wasm HTTP/1.1\r\nHost: localhost:{web_viewer.port}\r\n\r\n".encode()
        )
        gone.recv(100)
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    assert web_viewer.get("/run.rrd")[0] == 200


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_cleanly(number, recording):
    running = WebServer(recording)
    assert running.stop(number) == 0


def test_inline_scripts_are_allowed_by_their_digests():
    script = b"let x = 1;"
    digest = base64.b64encode(hashlib.sha256(script).digest()).decode()
    assert f"'sha256-{digest}'" in content_security_policy(
        b"<p><script>" + script + b"</script><script src='x'></script>"
    )


def test_links_to_other_machines_are_removed():
    external = b'<link\n href="https://fonts.example/x" rel="s">'
    page = b"<head>" + external + b'<link rel="icon" href="favicon.ico"></head>'
    viewer = dict.fromkeys(("/", "/re_viewer.js", "/re_viewer_bg.wasm", "/favicon.ico"), page)
    html = pages(viewer, b"")["/"].content
    assert b"fonts.example" not in html
    assert b"favicon.ico" in html


@pytest.mark.parametrize("port", [-1, 65_536])
def test_an_invalid_port_is_one_line(port):
    with pytest.raises(ConfigError, match="cannot serve"):
        serve(lambda path: None, port, print)


def test_a_port_in_use_is_one_line(taken_port):
    with pytest.raises(ConfigError, match="--port"):
        serve(lambda path: None, taken_port, print)


@pytest.fixture
def taken_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield taken.getsockname()[1]
