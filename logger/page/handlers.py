"""Answers to the phones' requests; everything else is refused before it is read."""

import asyncio
import re
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import BinaryIO

import msgspec
from tornado.http1connection import HTTP1Connection
from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, RequestHandler

from logger.core.foreign import decode_json
from logger.device.page_requests import PageRequest
from logger.page.assets import Asset
from logger.page.feed import Feed
from logger.page.guard import Connection, Limits, Places
from logger.page.request_file import RequestFile
from logger.page.runs import closed_runs, open_run, open_sized
from logger.page.token import is_token

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
    "script-src 'self'",
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
        self.stream: Connection = self.request.connection.stream

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
        if writes if origin is None else origin not in self._origins():
            return HTTPStatus.FORBIDDEN
        return None

    def _origins(self) -> set[str]:
        return {f"http://{host}" for host in self.site.hosts}

    async def send_pieces(self, pieces: AsyncIterator[bytes]) -> None:
        """Send piece by piece, so that a slow phone holds one of them in memory."""
        try:
            async for piece in pieces:
                self.write(piece)
                await asyncio.wait_for(self.flush(), PATIENCE_S)
        except (TimeoutError, StreamClosedError):
            self.detach().close()


class Refused(Guarded):
    """Any other address: it has no token, so the checks refuse it."""


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
    """News as server-sent events; a phone that is slow misses some and gets the newest."""

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
    """A mark, or a cell to follow, for the recorder."""

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
