"""The server as a separate process, with the real viewer's page."""

import base64
import hashlib
import re
import signal
import socket
import struct

import psutil
import pytest

from logger.core.errors import ConfigError
from postproc.view.viewer import content_security_policy, pages, serve
from tests.kit.web_server import WebServer


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
