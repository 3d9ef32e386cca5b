"""The web server of the page: Tornado, one process, one thread, bounded in every direction."""

import asyncio
import errno
import logging
import os
import re
import secrets
import signal
import socket
import stat
import time
import traceback
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import BinaryIO

import msgspec
from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream, StreamClosedError
from tornado.web import Application, HTTPError, RequestHandler

from logger.config import SiteConfig, page_address
from logger.core.errors import ConfigError
from logger.core.foreign import decode_json, open_regular
from logger.core.latest import Latest
from logger.core.runfile.run_names import NUMBERED, by_number
from logger.device.page_requests import FILE, MOST_AT_ONCE, PageRequest
from logger.page.assets import Asset, assets
from logger.page.feed import Feed
from logger.page.token import is_token, make_token, state_folder

_MOST_BYTES = 1 << 18
RECORDED_WITHIN_S = 10.0
"""The recorder looks twice a second and writes each second; a slow card takes some seconds."""


class RequestFile:
    """Appends requests, and waits until the recorder's status names them as recorded."""

    def __init__(self, folder: Path, feed: Feed) -> None:
        self._path = folder / FILE
        self._feed = feed
        self._n_waiting = 0

    async def ask(self, request: PageRequest) -> HTTPStatus:
        """What became of a request: 202 only if it is on the card."""
        if self._n_waiting >= MOST_AT_ONCE:
            return HTTPStatus.TOO_MANY_REQUESTS
        if self._feed.is_silent:
            return HTTPStatus.SERVICE_UNAVAILABLE
        name = secrets.token_hex(8)
        self._n_waiting += 1
        try:
            self._append(msgspec.structs.replace(request, id=name))
            is_recorded = await self._feed.has_recorded(name, RECORDED_WITHIN_S)
        except OSError:
            return HTTPStatus.INSUFFICIENT_STORAGE
        finally:
            self._n_waiting -= 1
        return HTTPStatus.ACCEPTED if is_recorded else HTTPStatus.SERVICE_UNAVAILABLE

    def _append(self, request: PageRequest) -> None:
        """Append a line in one write; raises OSError.

        A file that has become long, or is none, is replaced where no request waits in it.
        """
        line = msgspec.json.encode(request) + b"\n"
        if not self._has_room() and self._n_waiting == 1:
            new = self._path.with_suffix(".new")
            new.unlink(missing_ok=True)
            _write(new, line, os.O_EXCL)
            new.replace(self._path)
        else:
            _write(self._path, line, 0)

    def _has_room(self) -> bool:
        try:
            status = self._path.lstat()
        except FileNotFoundError:
            return True
        return stat.S_ISREG(status.st_mode) and status.st_size < _MOST_BYTES


def _write(path: Path, line: bytes, more_flags: int) -> None:
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    fd = os.open(path, flags | more_flags, 0o640)
    try:
        status = os.fstat(fd)
        if not stat.S_ISREG(status.st_mode) or status.st_size > 2 * _MOST_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        if os.write(fd, line) != len(line):
            os.ftruncate(fd, status.st_size)  # half a line would spoil the next one
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    finally:
        os.close(fd)


PER_S, BURST = 20.0, 160.0  # an impatient person opens it several times
"""Requests of one phone: the page makes two a second, and about twenty when it is opened."""
ALL_PER_S, ALL_BURST = 100.0, 300.0
WRITES_PER_S, WRITE_BURST = 1.0, 5.0
"""Marks and cells to follow."""
_MOST_ADDRESSES = 256
TOKEN_S = 1.0
"""A phone's request arrives in a fraction of this, also over a poor Wi-Fi."""


class Bucket:
    """Holds `burst` tokens at most and gains `per_s`; each request takes one."""

    def __init__(self, per_s: float, burst: float, now_s: float) -> None:
        self._per_s, self._burst = per_s, burst
        self._left, self._at_s = burst, now_s

    def take(self, now_s: float) -> bool:
        """Whether one more is allowed."""
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Limits:
    """Limits of requests for each address and for all together."""

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._all = Bucket(ALL_PER_S, ALL_BURST, clock_s())
        self._reads: Latest[Bucket] = Latest(_MOST_ADDRESSES)
        self._writes: Latest[Bucket] = Latest(_MOST_ADDRESSES)

    def allows(self, address: str, *, write: bool) -> bool:
        """Whether this request may be answered; no address uses up the limit of all."""
        now_s = self._clock_s()
        one = self._reads.get(address) or Bucket(PER_S, BURST, now_s)
        self._reads.put(address, one)
        if not one.take(now_s) or not self._all.take(now_s):
            return False
        if not write:
            return True
        bucket = self._writes.get(address) or Bucket(WRITES_PER_S, WRITE_BURST, now_s)
        self._writes.put(address, bucket)
        return bucket.take(now_s)


@dataclass
class _Holder:
    """`is_known` after a request with the token, `is_busy` during one."""

    address: str
    since_s: float
    is_known: bool = False
    is_busy: bool = False


class Places:
    """The places of connections, at most so many and so many of one address.

    Where they are taken, one gives way to a newcomer: a connection that could have brought the
    token by now and has not, else one that waits for its next request, else one that is new, else
    one of an address that has two more than the newcomer's. Among these it is the oldest of the
    address that has the most.
    """

    def __init__(
        self, most: int, most_of_one: int, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._most, self._most_of_one = most, most_of_one
        self._clock_s = clock_s
        self._holders: dict[IOStream, _Holder] = {}

    def admit(self, connection: IOStream, address: str) -> bool:
        """Give a place, if need be that of another, which is closed; False without one."""
        self._holders = {one: who for one, who in self._holders.items() if not one.closed()}
        n_held = Counter(who.address for who in self._holders.values())
        is_full = len(self._holders) >= self._most
        if is_full or n_held[address] >= self._most_of_one:
            leaves = self._one_to_leave(n_held, address)
            if leaves is None:
                return False
            leaves.close()
            del self._holders[leaves]
        self._holders[connection] = _Holder(address, self._clock_s())
        return True

    def begin(self, connection: IOStream) -> None:
        """Note that a connection has brought a complete request with the token."""
        if holder := self._holders.get(connection):
            holder.is_known = holder.is_busy = True

    def end(self, connection: IOStream) -> None:
        """Note that its request is answered; what is written may still be under way."""
        if holder := self._holders.get(connection):
            holder.is_busy = False

    def _one_to_leave(self, n_held: Counter[str], address: str) -> IOStream | None:
        has_all_of_one = n_held[address] >= self._most_of_one
        holders = [
            (one, who)
            for one, who in self._holders.items()
            if who.address == address or not has_all_of_one
        ]
        strangers = [pair for pair in holders if not pair[1].is_known]
        idle = [
            (one, who)
            for one, who in holders
            if who.is_known and not who.is_busy and not one.writing()
        ]
        greedy = [pair for pair in holders if n_held[pair[1].address] > n_held[address] + 1]
        late = [pair for pair in strangers if self._clock_s() - pair[1].since_s > TOKEN_S]
        pool = late or idle or strangers or greedy
        n_of_pool = Counter(who.address for _, who in pool)
        oldest = max(pool, key=lambda pair: n_of_pool[pair[1].address], default=None)
        return None if oldest is None else oldest[0]


def host_names(address: str, port: int) -> frozenset[str]:
    """Values of Host that name this page: only the address, since DNS may name any machine."""
    host = f"[{address}]" if ":" in address else address
    return frozenset({f"{host}:{port}"} | ({host} if port == 80 else set()))


_CLOSED = re.compile(rf"{NUMBERED}\.h5", re.ASCII)
MOST_SHOWN = 20


def closed_runs(folder: Path) -> list[tuple[str, int]]:
    """Names and sizes, the newest first."""
    try:
        names = [file.name for file in folder.iterdir() if is_run(file.name)]
        names.sort(key=by_number, reverse=True)
        return [(name, (folder / name).lstat().st_size) for name in names[:MOST_SHOWN]]
    except OSError:
        return []


def is_run(name: str) -> bool:
    """Whether a name is that of a closed run; none leads to another folder."""
    return _CLOSED.fullmatch(name) is not None


def open_run(folder: Path, name: str) -> tuple[BinaryIO, int] | None:
    """The file and its size; None where it is no closed run or cannot be read."""
    return open_sized(folder / name) if is_run(name) else None


def open_sized(path: Path) -> tuple[BinaryIO, int] | None:
    """A regular file and its size; None for a link, a pipe, or what cannot be read."""
    try:
        file = open_regular(path, follow_links=False)
    except OSError:
        return None
    return file, os.fstat(file.fileno()).st_size


_WHY = {
    HTTPStatus.TOO_MANY_REQUESTS: "too many at once",
    HTTPStatus.SERVICE_UNAVAILABLE: "the recorder did not take it",
    HTTPStatus.INSUFFICIENT_STORAGE: "the Pi has no room",
}
"""What the phone shows of a request that is refused."""
CHUNK = 1 << 15
MOST_OF_MAP = 1 << 20
"""Bytes of one request for the map: tiles are smaller."""
_RANGE = re.compile(r"bytes=(\d{1,15})-(\d{1,15})", re.ASCII)
PATIENCE_S = 20.0
"""A phone that takes no data for this long is gone."""

_POLICY = (
    "default-src 'none'",
    # and the script within index.html
    "script-src 'self' 'sha256-c/XGFgiutA3SwkB6FDeAhHQQzXjaq0sU8ENO//Nr2VI='",
    "style-src 'self'",
    "img-src 'self' blob:",
    "connect-src 'self'",
    "media-src 'self'",
    "worker-src 'self'",
    "base-uri 'none'",
    "form-action 'none'",
    "frame-ancestors 'none'",
)
_HEADERS = {
    "Server": "cellwalk",
    "Content-Security-Policy": "; ".join(_POLICY),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


@dataclass
class Site:
    """What the handlers share."""

    token: str
    hosts: frozenset[str]
    feed: Feed
    runs: Path
    requests: RequestFile
    assets: Mapping[str, Asset]
    limits: Limits
    connections: Places
    streams: Places
    map_file: Path | None = None


class Guarded(RequestHandler):
    """Checks of every request: rate, host, token, origin."""

    def initialize(self, site: Site) -> None:
        self.site = site
        assert isinstance(self.request.connection, HTTP1Connection)
        self.stream = self.request.connection.stream

    def set_default_headers(self) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Refuse with 429, 421 or 403."""
        refused = self._refusal()
        if refused is not None:
            raise HTTPError(refused)
        self.site.connections.begin(self.stream)

    def on_finish(self) -> None:
        self.site.connections.end(self.stream)

    def write_error(self, status_code: int, **_kwargs: object) -> None:
        """One plain line; never what was asked, nor why it failed."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        if status_code in {HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE}:
            self.set_header("Retry-After", "2")
            self.set_header("Refresh", "2")  # browsers load a page again by this one alone
        status = HTTPStatus(status_code)
        self.finish(f"{status_code} {_WHY.get(status, status.phrase)}\n")

    def _refusal(self) -> HTTPStatus | None:
        request, site = self.request, self.site
        writes = request.method not in {"GET", "HEAD"}
        if not site.limits.allows(request.remote_ip or "", write=writes):
            return HTTPStatus.TOO_MANY_REQUESTS
        if request.headers.get("Host", "") not in site.hosts:  # another name: DNS rebinding
            return HTTPStatus.MISDIRECTED_REQUEST
        if not self.path_args or not is_token(self.path_args[0] or "", site.token):
            return HTTPStatus.FORBIDDEN
        origin = request.headers.get("Origin")
        if writes if origin is None else origin not in {f"http://{host}" for host in site.hosts}:
            return HTTPStatus.FORBIDDEN
        return None

    async def send_pieces(self, pieces: AsyncIterator[bytes]) -> None:
        """Send piece by piece, so that a slow phone holds one of them in memory."""
        try:
            async for piece in pieces:
                self.write(piece)
                await asyncio.wait_for(self.flush(), PATIENCE_S)
        except (TimeoutError, StreamClosedError, asyncio.CancelledError):  # or the server ends
            self.detach().close()


class AssetHandler(Guarded):
    """The page itself, its styles and scripts."""

    async def get(self, _token: str, name: str) -> None:
        asset = self.site.assets.get(name or "index.html")
        if asset is None:
            raise HTTPError(HTTPStatus.NOT_FOUND)
        self.set_header("Content-Type", asset.media_type)
        self.set_header("Cache-Control", "no-cache")
        self.set_header("ETag", asset.etag)
        if self.check_etag_header():
            self.set_status(HTTPStatus.NOT_MODIFIED)
            return
        self.set_header("Content-Length", str(len(asset.content)))
        await self.send_pieces(_slices(asset.content))

    head = get


class LiveHandler(Guarded):
    """News as server-sent events; a slow phone misses some and gets the newest."""

    async def get(self, _token: str) -> None:
        if not self.site.streams.admit(self.stream, self.request.remote_ip or ""):
            raise HTTPError(HTTPStatus.SERVICE_UNAVAILABLE)
        self.site.streams.begin(self.stream)
        self.set_header("Content-Type", "text/event-stream")
        await self.send_pieces(_events(self.site.feed))


class TrackHandler(Guarded):
    """Points and levels that the plan does not have yet."""

    async def get(self, _token: str) -> None:
        start = [self._number(name) for name in ("point", "level")]
        self.set_header("Content-Type", "application/json")
        text = msgspec.json.encode(self.site.feed.track(*start))
        self.set_header("Content-Length", str(len(text)))
        await self.send_pieces(_slices(text))

    def _number(self, name: str) -> int:
        text = self.get_query_argument(name, "0")
        if not (text.isascii() and text.isdecimal() and len(text) < 9):
            raise HTTPError(HTTPStatus.BAD_REQUEST)
        return int(text)


class RunsHandler(Guarded):
    """Names and sizes of closed runs."""

    async def get(self, _token: str) -> None:
        self.set_header("Content-Type", "application/json")
        self.finish(msgspec.json.encode(closed_runs(self.site.runs)))


class RunHandler(Guarded):
    """The download of a closed run."""

    async def get(self, _token: str, name: str) -> None:
        found = open_run(self.site.runs, name)
        if found is None:
            raise HTTPError(HTTPStatus.NOT_FOUND)
        file, size = found
        with file:
            self.set_header("Content-Type", "application/x-hdf5")
            self.set_header("Content-Disposition", f'attachment; filename="{name}"')
            self.set_header("Content-Length", str(size))
            await self.send_pieces(_file_pieces(file, size))


class MapHandler(Guarded):
    """Part of the map's file, which has its tiles and their directory."""

    async def get(self, _token: str) -> None:
        span = _RANGE.fullmatch(self.request.headers.get("Range", ""))
        found = open_sized(self.site.map_file) if span and self.site.map_file else None
        if span is None or found is None:
            raise HTTPError(HTTPStatus.NOT_FOUND)
        file, size = found
        with file:
            start, last = int(span[1]), min(int(span[2]), size - 1)
            if not start <= last < start + MOST_OF_MAP:
                raise HTTPError(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE)
            file.seek(start)
            self.set_status(HTTPStatus.PARTIAL_CONTENT)
            self.set_header("Content-Type", "application/octet-stream")
            self.set_header("Content-Range", f"bytes {start}-{last}/{size}")
            self.set_header("Content-Length", str(last - start + 1))
            await self.send_pieces(_file_pieces(file, last - start + 1))


class RequestHandlerOf(Guarded):
    """A mark, a cell to follow, or where to look for it, for the recorder."""

    async def post(self, _token: str, do: str) -> None:
        if self.request.headers.get("Content-Type") != "application/json":
            raise HTTPError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        try:
            text = decode_json(self.request.body, str)
            request = msgspec.convert({"do": do, "text": text}, PageRequest)
        except msgspec.DecodeError:
            raise HTTPError(HTTPStatus.BAD_REQUEST) from None
        outcome = await self.site.requests.ask(request)
        if outcome != HTTPStatus.ACCEPTED:
            raise HTTPError(outcome)
        self.set_status(outcome)


async def _slices(content: bytes) -> AsyncIterator[bytes]:
    for at in range(0, len(content), CHUNK):
        yield content[at : at + CHUNK]


async def _file_pieces(file: BinaryIO, size: int) -> AsyncIterator[bytes]:
    """Exactly `size` bytes, even if the file shrinks meanwhile."""
    while size > 0:
        piece = file.read(min(CHUNK, size))
        if not piece:
            raise StreamClosedError
        size -= len(piece)
        yield piece


async def _events(feed: Feed) -> AsyncIterator[bytes]:
    sent = b""
    while True:
        if feed.text is sent:
            await feed.changed()
        sent = feed.text
        yield b"data: " + sent + b"\n\n"


log = logging.getLogger(__name__)

RUNTIME = Path("/run/cellwalk-page")
"""RuntimeDirectory= of the unit; the requests are there."""
MAP_PROGRAM = "maplibre-gl.mjs"
MOST_CONNECTIONS = 64
MOST_OF_ONE = 12
"""Connections of one address: a browser opens six."""
MOST_STREAMS = 10
"""Phones that are sent news."""
HEADER_BYTES = 8192
BODY_BYTES = 1024
HEADER_S = 10.0
"""Time for a whole request, and that a connection may be idle."""
_PATIENCE_MS = int(PATIENCE_S * 1000)
BIND_AGAIN_S = 2.0
"""The hotspot may come up after this program."""


class BoundedServer(HTTPServer):
    """Gives places to connections; closes those for which there is none at once.

    `HTTPServer` makes itself without its constructor, so `places` is set afterwards.
    """

    places: Places

    def handle_stream(self, stream: IOStream, address: tuple[str, int]) -> None:
        """Accept a connection, or close it."""
        if self.places.admit(stream, address[0]):
            super().handle_stream(stream, address)
        else:
            stream.close()


class WithoutRequests(logging.Filter):
    """Leaves out what tornado and asyncio say of requests, whose addresses contain the token.

    Of an error only its kind and the lines of the program remain.
    """

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a record is written; changes one of a library."""
        if record.name.partition(".")[0] == __name__.partition(".")[0]:
            return True
        kind, _, trace = record.exc_info or (None, None, None)
        lines = "".join(traceback.format_tb(trace))
        what = kind.__name__ if kind else "message"
        record.msg = f"{record.name}: {what} at {record.filename}:{record.lineno}\n{lines}".rstrip()
        record.args, record.exc_info, record.exc_text, record.stack_info = (), None, None, None
        return record.levelno >= logging.ERROR


def serve(config: SiteConfig, environ: Mapping[str, str] = os.environ) -> int:
    """Serve the page until SIGTERM or SIGINT; returns the exit code 0, raises `ConfigError`."""
    address, port = page_address(config.page.listen)
    runtime = Path(environ.get("RUNTIME_DIRECTORY", RUNTIME))
    for log_handler in logging.getLogger().handlers:
        log_handler.addFilter(WithoutRequests())
    status = runtime.with_name(runtime.name.removesuffix("-page"))
    runs = Path(config.run.directory).expanduser()
    files_by_name = assets(with_map=bool(config.page.map))
    feed = Feed(status, runs, has_map=MAP_PROGRAM in files_by_name)
    site = Site(
        token=make_token(state_folder(environ)),
        hosts=host_names(address, port),
        feed=feed,
        runs=runs,
        requests=RequestFile(runtime, feed),
        assets=files_by_name,
        map_file=Path(config.page.map) if config.page.map else None,
        limits=Limits(),
        connections=Places(MOST_CONNECTIONS, MOST_OF_ONE),
        streams=Places(MOST_STREAMS, MOST_STREAMS),
    )
    asyncio.run(_serve(site, address, port))
    return 0


async def _serve(site: Site, address: str, port: int) -> None:
    ended = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    listener = await _listen(address, port, ended)
    if listener is None:
        return
    server = BoundedServer(
        application(site),
        max_header_size=HEADER_BYTES,
        max_body_size=BODY_BYTES,
        idle_connection_timeout=HEADER_S,
        body_timeout=HEADER_S,
        chunk_size=4096,
    )
    server.places = site.connections
    site.feed.look()
    server.add_socket(listener)
    log.info("the page is on; its address: sudo fieldlogger page --show")
    news = asyncio.create_task(site.feed.run())
    done, _ = await asyncio.wait(
        (news, asyncio.create_task(ended.wait())), return_when=asyncio.FIRST_COMPLETED
    )
    server.stop()
    if news in done:
        news.result()


def application(site: Site) -> Application:
    """All addresses of the page."""
    one = {"site": site}
    return Application(
        [
            (r"/([^/]+)/live", LiveHandler, one),
            (r"/([^/]+)/track", TrackHandler, one),
            (r"/([^/]+)/map", MapHandler, one),
            (r"/([^/]+)/runs", RunsHandler, one),
            (r"/([^/]+)/runs/([^/]+)", RunHandler, one),
            (r"/([^/]+)/(follow|mark|within)", RequestHandlerOf, one),
            (r"/([^/]+)/([a-z0-9.-]*)", AssetHandler, one),
        ],
        default_handler_class=Guarded,  # any other address has no token
        default_handler_args=one,
        log_function=lambda _handler: None,  # addresses contain the token
    )


async def _listen(address: str, port: int, ended: asyncio.Event) -> socket.socket | None:
    """Waits until the machine has the address; None where the end comes first."""
    has_complained = False
    while not ended.is_set():
        try:
            family = socket.AF_INET6 if ":" in address else socket.AF_INET
            listener = socket.create_server((address, port), family=family)
        except OSError as error:
            if error.errno != errno.EADDRNOTAVAIL:
                raise ConfigError(f"[page] listen {address}:{port}: {error.strerror}") from error
        else:
            listener.setblocking(False)
            # a phone that left the Wi-Fi would keep its connection for a quarter of an hour
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _PATIENCE_MS)
            return listener
        if not has_complained:
            has_complained = True
            log.info("no network has the address %s yet: is the hotspot on?", address)
        await asyncio.wait([asyncio.create_task(ended.wait())], timeout=BIND_AGAIN_S)
    return None
