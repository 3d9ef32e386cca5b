"""The web server of the page: Tornado, one process, one thread, bounded in every direction."""

import asyncio
import errno
import logging
import os
import signal
import socket
import traceback
from collections.abc import Mapping
from pathlib import Path

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.web import Application

from logger.config import SiteConfig, page_address
from logger.core.errors import ConfigError
from logger.page.assets import assets
from logger.page.feed import Feed
from logger.page.guard import Limits, Places, host_names
from logger.page.handlers import (
    PATIENCE_S,
    AssetHandler,
    LiveHandler,
    MapHandler,
    Refused,
    RequestHandlerOf,
    RunHandler,
    RunsHandler,
    Site,
    TrackHandler,
)
from logger.page.request_file import RequestFile
from logger.page.token import make_token, state_folder

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

    Of an error only its kind and the lines of the program remain; all else of a stranger's request
    is of no use in a log either.
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
            (r"/([^/]+)/(follow|mark)", RequestHandlerOf, one),
            (r"/([^/]+)/([a-z0-9.-]*)", AssetHandler, one),
        ],
        default_handler_class=Refused,
        default_handler_args=one,
        log_function=lambda _handler: None,  # addresses contain the token
    )


async def _listen(address: str, port: int, ended: asyncio.Event) -> socket.socket | None:
    """Bind, as soon as the machine has the address; None where the end comes first."""
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
