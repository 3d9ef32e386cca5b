"""The viewer in a browser on this machine: one origin on the loopback, which requests nothing else.

The viewer's own web server listens on all interfaces, and its page requests fonts, releases and
statistics from other machines. So its page is fetched once and served from here beside the
recording. A content security policy forbids every other origin, and a script answers such requests
within the page.
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
from postproc.view.viewer import (
    LOOPBACK,
    binary,
    child,
    offline_environment,
    terminate_as_interrupt,
)

RECORDING = "/run.rrd"
_GUARD = "/guard.js"
_ASSETS = {
    "/": "text/html; charset=utf-8",
    "/re_viewer.js": "text/javascript",
    "/re_viewer_bg.wasm": "application/wasm",
    "/favicon.ico": "image/x-icon",
}
_READY_S = 20.0
"""The viewer's own server starts within a second; on a loaded machine it may take several."""
_POLL_S = 0.05
_HOST_NAMES = {LOOPBACK, "localhost"}
_INLINE_SCRIPT = re.compile(rb"<script>(.*?)</script>", re.DOTALL)
_EXTERNAL_LINK = re.compile(rb"""<link\b[^>]*\bhref=["']https?:[^>]*>""")


@dataclass(frozen=True, slots=True)
class Page:
    """The response to one path: its media type and content."""

    media_type: str
    content: bytes


def serve(write: Callable[[Path], object], port: int, announce: Callable[[str], None]) -> int:
    """Serve a recording until Ctrl-C or SIGTERM; with `port` 0 on any free port.

    Returns the exit code 0; raises `ConfigError`.
    """
    server = _server(port)
    with server, terminate_as_interrupt(), TemporaryDirectory(prefix="cellwalk-") as folder:
        path = Path(folder) / "run.rrd"
        write(path)
        server.pages = pages(fetch_viewer(Path(folder)), path.read_bytes())
        server.policy = content_security_policy(server.pages["/"].content)
        with suppress(KeyboardInterrupt):
            announce(f"http://{LOOPBACK}:{server.server_port}/")
            server.serve_forever()
    return 0


def pages(viewer: Mapping[str, bytes], recording: bytes) -> dict[str, Page]:
    """Every page by its path.

    The viewer's page gets the script `guard.js` and loses its links to other machines.
    """
    assets = {path: Page(media_type, viewer[path]) for path, media_type in _ASSETS.items()}
    guard = f'<script src="{_GUARD}"></script>'.encode()
    html = _EXTERNAL_LINK.sub(b"", viewer["/"]).replace(b"<head>", b"<head>" + guard, 1)
    script = files(__package__).joinpath("guard.js").read_bytes()
    return assets | {
        "/": Page(_ASSETS["/"], html),
        _GUARD: Page("text/javascript", script),
        RECORDING: Page("application/octet-stream", recording),
    }


def content_security_policy(page: bytes) -> str:
    """Policy that allows a page its own origin, and its inline scripts by their digests."""
    digests = (hashlib.sha256(script).digest() for script in _INLINE_SCRIPT.findall(page))
    inline = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
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


def fetch_viewer(folder: Path) -> dict[str, bytes]:
    """The viewer's page and program by path, from its own web server, which is then stopped."""
    viewer, port = binary(), _free_port()
    ports = ["--web-viewer-port", str(port), "--port", str(_free_port())]
    # the viewer opens a browser where it can
    environment = offline_environment(viewer, folder) | {"BROWSER": "true"}
    with (
        (folder / "viewer.log").open("wb") as log,
        child([str(viewer), "--serve-web", "--bind", LOOPBACK, *ports], environment, log.fileno()),
    ):
        _wait_for(port)
        return {path: _get(port, path) for path in _ASSETS}


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, port: int) -> None:
        self.pages: dict[str, Page] = {}
        self.policy = ""
        super().__init__((LOOPBACK, port), _Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a browser that closed the connection; anything else is an error here."""
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
        """Log nothing: requests are private."""

    def _answer(self, *, with_content: bool) -> None:
        page = self.server.pages.get(self.path.partition("?")[0])
        status = HTTPStatus.OK if page else HTTPStatus.NOT_FOUND
        # any other name is a third-party page that tries to read the run (DNS rebinding)
        if self.headers.get("Host", "").partition(":")[0] not in _HOST_NAMES:
            page, status = None, HTTPStatus.MISDIRECTED_REQUEST
        content = page.content if page else b""
        self.send_response(status)
        self.send_header("Content-Type", page.media_type if page else "text/plain")
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
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(
            f"cannot serve on port {port}: {reason}; without --port a free one is used"
        ) from error


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _wait_for(port: int) -> None:
    deadline_s = time.monotonic() + _READY_S
    while time.monotonic() < deadline_s:
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(_POLL_S)
    raise ConfigError(
        "the viewer's web server does not start: use --save RUN.rrd, or reinstall cellwalk[view]"
    )


def _get(port: int, path: str) -> bytes:
    connection = HTTPConnection(LOOPBACK, port, timeout=_READY_S)
    try:
        connection.request("GET", path)
        response = connection.getresponse()
        if response.status != HTTPStatus.OK:
            raise ConfigError(f"the viewer's web page lacks {path}: reinstall cellwalk[view]")
        return response.read()
    except (OSError, HTTPException) as error:
        raise ConfigError(f"the viewer's web page cannot be read: {error}") from error
    finally:
        connection.close()
