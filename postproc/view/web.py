"""The viewer in a browser of this machine: one origin on the loopback, from which nothing leaves.

The viewer's own web server listens for more than that, and its page asks other machines for fonts,
releases and statistics. So its page is fetched from it once, and served by us beside the recording,
with a policy that forbids every other origin and a script that answers such requests before they
are made.
"""

import base64
import hashlib
import re
import socket
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from logger.core.errors import ConfigError
from postproc.view.viewer import LOOPBACK, binary, child, discreet, terminated_as_interrupted

RECORDING = "/run.rrd"
_GUARD = "/guard.js"
_ASSETS = {
    "/": "text/html; charset=utf-8",
    "/re_viewer.js": "text/javascript",
    "/re_viewer_bg.wasm": "application/wasm",
    "/favicon.ico": "image/x-icon",
}
_READY_S = 20.0
_OUR_NAMES = {LOOPBACK, "localhost"}
_INLINE = re.compile(rb"<script>(.*?)</script>", re.DOTALL)
_LINK_OUT = re.compile(rb"""<link\b[^>]*\bhref=["']https?:[^>]*>""")


@dataclass(frozen=True, slots=True)
class Page:
    """What is answered to one path."""

    kind: str
    content: bytes


def serve(write: Callable[[Path], None], port: int, announce: Callable[[str], None]) -> int:
    """Serve a recording until Ctrl-C or SIGTERM; `port` 0 is any that is free.

    Raises `ConfigError`.
    """
    server = _server(port)
    with server, terminated_as_interrupted(), TemporaryDirectory(prefix="cellwalk-") as folder:
        path = Path(folder) / "run.rrd"
        write(path)
        server.pages = pages(fetched(Path(folder)), path.read_bytes())
        server.policy = policy(server.pages["/"].content)
        with suppress(KeyboardInterrupt):
            announce(f"http://{LOOPBACK}:{server.server_port}/")
            server.serve_forever()
    return 0


def pages(viewer: Mapping[str, bytes], recording: bytes) -> dict[str, Page]:
    """Everything there is: the viewer's page with our script and without links to others, and the
    recording.
    """
    found = {path: Page(kind, viewer[path]) for path, kind in _ASSETS.items()}
    guard = f'<script src="{_GUARD}"></script>'.encode()
    head = _LINK_OUT.sub(b"", viewer["/"]).replace(b"<head>", b"<head>" + guard, 1)
    script = files(__package__).joinpath("guard.js").read_bytes()
    return found | {
        "/": Page(_ASSETS["/"], head),
        _GUARD: Page("text/javascript", script),
        RECORDING: Page("application/octet-stream", recording),
    }


def policy(page: bytes) -> str:
    """Content security policy of a page: its own origin, and the scripts that stand in it as they
    are.
    """
    inline = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"
        for script in _INLINE.findall(page)
    )
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src 'self' 'wasm-unsafe-eval' {inline}",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "connect-src 'self' data: blob:",
            "font-src 'self' data:",
            "worker-src 'self' blob:",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    )


def fetched(folder: Path) -> dict[str, bytes]:
    """The viewer's page and program, from its own web server, which is stopped again."""
    viewer, port = binary(), _free_port()
    to = [
        "--serve-web",
        "--bind",
        LOOPBACK,
        "--web-viewer-port",
        str(port),
        "--port",
        str(_free_port()),
    ]
    with (folder / "viewer.log").open("wb") as log:
        environment = discreet(viewer, folder)
        # it opens a browser of its own, where it can
        with child([str(viewer), *to], environment | {"BROWSER": "true"}, log.fileno()):
            _wait_for(port)
            return {path: _get(port, path) for path in _ASSETS}


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, port: int) -> None:
        self.pages: dict[str, Page] = {}
        self.policy = ""
        super().__init__((LOOPBACK, port), _Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Pass over a browser that went away; anything else is a bug of ours."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "cellwalk", ""

    def do_GET(self) -> None:
        self._answer(with_content=True)

    def do_HEAD(self) -> None:
        self._answer(with_content=False)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing: who looks at a run is nobody's business."""

    def _answer(self, *, with_content: bool) -> None:
        page = self.server.pages.get(self.path.partition("?")[0])
        status = HTTPStatus.OK if page else HTTPStatus.NOT_FOUND
        # another name that leads here is a page of somebody else that tries to read the run
        if self.headers.get("Host", "").partition(":")[0] not in _OUR_NAMES:
            page, status = None, HTTPStatus.MISDIRECTED_REQUEST
        content = page.content if page else b""
        self.send_response(status)
        self.send_header("Content-Type", page.kind if page else "text/plain")
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", self.server.policy)
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("Cross-Origin-Opener-Policy", "same-origin")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if with_content:
            self.wfile.write(content)


def _server(port: int) -> _Server:
    try:
        return _Server(port)
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or error
        raise ConfigError(
            f"cannot serve on port {port}: {why}; leave --port out for one that is free"
        ) from error


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _wait_for(port: int) -> None:
    until = time.monotonic() + _READY_S
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.05)
    raise ConfigError(
        "the viewer's web page is not there: use --save RUN.rrd, or install cellwalk[view] again"
    )


def _get(port: int, path: str) -> bytes:
    connection = HTTPConnection(LOOPBACK, port, timeout=_READY_S)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        if answer.status != HTTPStatus.OK:
            raise ConfigError(f"the viewer's web page lacks {path}: install cellwalk[view] again")
        return answer.read()
    except (OSError, HTTPException) as error:
        raise ConfigError(f"the viewer's web page cannot be read: {error}") from error
    finally:
        connection.close()
