"""The rerun viewer, in a window or in a browser; it listens on this machine only."""

import base64
import hashlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any

from logger.core.errors import ConfigError, RunFileError
from logger.core.foreign import open_regular

LOOPBACK = "127.0.0.1"
DEAD_PROXY = f"http://{LOOPBACK}:9"
"""The discard port: nothing answers there."""

_ALTERNATIVE = "use --web, or --save RUN.rrd and `postproc view RUN.rrd` on another machine"
_MISSING = "the viewer is missing: install cellwalk[view]"
_TILE_SERVER = "tile.openstreetmap.org"
_GRACE_S = 5.0
"""A viewer that has not ended after this is killed."""


def show(write: Callable[[Path], object], name: str) -> int:
    """Write a recording to a temporary file and show it until the window is closed.

    Returns the exit code 0; raises `ConfigError`.
    """
    _check_screen()
    viewer = binary()
    with TemporaryDirectory(prefix="cellwalk-") as folder:
        path, log_path = Path(folder) / f"{name}.rrd", Path(folder) / "viewer.log"
        write(path)
        environment = offline_environment(viewer, Path(folder))
        with (
            log_path.open("wb") as log,
            child(command(viewer, path), environment, log.fileno()) as process,
        ):
            code = process.wait()
        if code:
            reason = _failure(code, log_path.read_text(errors="replace"))
            raise ConfigError(f"{reason}: {_ALTERNATIVE}")
    return 0


def _check_screen() -> None:
    """Raise `ConfigError` where no window can be opened; only Linux shows that in advance."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, screens)):
        raise ConfigError(f"there is no screen: {_ALTERNATIVE}")


def binary() -> Path:
    """The viewer's own executable; raises `ConfigError`.

    The `rerun` on the path is a script that would leave the viewer running when it is stopped.
    """
    try:
        folder = Path(str(files("rerun_cli")))
    except ImportError as error:
        raise ConfigError(_MISSING) from error
    for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun.exe", "rerun"):
        if (folder / name).is_file():
            return folder / name
    raise ConfigError(_MISSING)


def offline_environment(viewer: Path, folder: Path) -> dict[str, str]:
    """Environment in which the viewer requests nothing but map tiles, once the map is shown.

    Usage statistics are turned off in a folder of settings of its own, since no variable does so
    (rerun 0.41); only Linux respects that folder. The check for a newer version goes to a proxy
    that does not exist.
    """
    environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "settings")}
    for name, value in (("HTTPS_PROXY", DEAD_PROXY), ("NO_PROXY", _TILE_SERVER)):
        environment |= {name: value, name.lower(): value}
    subprocess.run(  # noqa: S603
        [viewer, "analytics", "disable"], env=environment, check=False, capture_output=True
    )
    return environment


def command(viewer: Path, path: Path) -> list[str]:
    """A new viewer, whatever others are open, reachable from this machine only."""
    return [str(viewer), "--bind", LOOPBACK, "--port", "auto", str(path)]


@contextmanager
def child(
    command: Sequence[str], environment: Mapping[str, str], log: int
) -> Iterator[subprocess.Popen[bytes]]:
    """A child process that ends with this context, also on SIGTERM; its output goes to `log`."""
    with terminate_as_interrupt() as interrupt:
        interrupt.is_held = True  # else one that comes now would leave a child that nobody knows
        process = subprocess.Popen(  # noqa: S603
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )
        try:
            interrupt.release()
            yield process
        finally:
            interrupt.is_held = True
            process.terminate()
            try:
                process.wait(_GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


class Interrupt:
    """A signal handler that raises `KeyboardInterrupt`, or waits with it while `is_held`."""

    def __init__(self) -> None:
        self.is_held = False
        self._is_waiting = False

    def __call__(self, *_: object) -> None:
        if not self.is_held:
            raise KeyboardInterrupt
        self._is_waiting = True

    def release(self) -> None:
        """Raise from now on, and at once where a signal has come in the meantime."""
        self.is_held = False
        if self._is_waiting:
            raise KeyboardInterrupt


@contextmanager
def terminate_as_interrupt() -> Iterator[Interrupt]:
    """Let SIGTERM raise `KeyboardInterrupt`, so that contexts are closed in order.

    SIGINT does so, too, even if a shell that put us into the background ignores it.
    """
    interrupt = Interrupt()
    previous = {
        number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield interrupt
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _failure(code: int, log: str) -> str:
    """The last error in the log."""
    error = min((log.rpartition(mark)[2] for mark in ("Error: ", "panicked at ")), key=len)
    if re.search(r"graphics|adapter|gpu|vulkan", error, re.IGNORECASE):
        return "the viewer found no usable graphics adapter"
    if re.search(r"x server|display|wayland", error, re.IGNORECASE):
        return "the viewer could not open the screen"
    return f"the viewer stopped with code {code}"


_MAGIC = b"RRF"
"""Every rerun recording starts with it; its version follows."""


def is_recording(path: Path) -> bool:
    """Whether a file has the name of a recording."""
    return path.suffix.lower() == ".rrd"


def copy_recording(paths: Sequence[Path]) -> Callable[[Path], None]:
    """A function that copies the one recording to where a viewer reads it.

    Raises `ConfigError` or `RunFileError`.
    """
    if len(paths) > 1:
        raise ConfigError("give one recording (.rrd) alone, or runs")
    (source,) = paths
    try:
        with open_regular(source) as file:
            magic = file.read(len(_MAGIC))
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if magic != _MAGIC:
        raise RunFileError(f"{source} is not a rerun recording")
    return lambda target: _copy(source, target)


def _copy(source: Path, target: Path) -> None:
    try:
        copyfile(source, target)
    except OSError as error:
        raise RunFileError(f"{source} cannot be shown: {error.strerror}") from error


# The viewer's own web server listens on all interfaces, and its page requests fonts, releases and
# statistics from other machines. So its page is fetched once and served from here beside the
# recording. A content security policy forbids every other origin, and a script answers such
# requests within the page.

RECORDING = "/run.rrd"
_GUARD = "/guard.js"
_ASSETS = {
    "/": "text/html; charset=utf-8",
    "/re_viewer.js": "text/javascript",
    "/re_viewer_bg.wasm": "application/wasm",
    "/favicon.ico": "image/x-icon",
}
_READY_S = 20.0
"""The viewer's own server starts within a second, on a loaded machine within several."""
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
