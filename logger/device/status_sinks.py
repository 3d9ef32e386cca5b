"""Outputs of the recording's status: the light, `status.json`, `systemctl status`, the feed.

The feed goes to alarms, Home Assistant or a broker, a JSON line a second to every connected reader.
It has the state, the counts, the machine's ports and the cells that are unusual; it has no
position, no time of day and no file. Identities of cells tell others about where the walker is:
therefore the socket is local.
"""

import logging
import os
import selectors
import socket
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import msgspec

from logger.config import StatusSettings
from logger.device.leds import StatusLight
from logger.device.notify import ServiceManager
from logger.device.status import Status, status_folder, write_status

log = logging.getLogger(__name__)

_LOOPBACK = "127.0.0.1"
_MOST_READERS = 16
_BACKLOG = 4
_GROUP_MAY_CONNECT = 0o660


class StatusFile:
    """`status.json` in a folder; a failure is logged once, and writing is tried again."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._fails = False

    def publish(self, status: Status) -> None:
        if self._folder is None:
            return
        try:
            write_status(self._folder, status)
        except OSError as error:
            if not self._fails:
                log.warning("status.json cannot be written: %s", error)
            self._fails = True
        else:
            self._fails = False


@contextmanager
def status_sinks(
    settings: StatusSettings, manager: ServiceManager, environ: Mapping[str, str] = os.environ
) -> Iterator[list[Callable[[Status], None]]]:
    """Outputs of a status, called once a second; what they hold is released at the end.

    All that the configuration and the environment name. None raises: no output may stop a
    recording.
    """
    light, feed = StatusLight(settings.led), StatusFeed(settings.feed)
    file = StatusFile(status_folder(environ))

    def show_line(status: Status) -> None:
        manager.status(status.text)

    with closing(feed), closing(light):
        yield [light.publish, file.publish, show_line, feed.publish]


class StatusFeed:
    """A listening socket and its readers; a reader that does not keep up is disconnected.

    `address` is a path of a Unix socket or the number of a TCP port on this machine, empty for no
    feed. An address that cannot be opened is logged.
    """

    def __init__(self, address: str) -> None:
        self._readers: list[socket.socket] = []
        self._selector = selectors.DefaultSelector()
        self._server: socket.socket | None = None
        self._path: Path | None = None
        try:
            self._server = self._listen(address) if address else None
        except OSError as error:
            log.warning("no feed on %s: %s", address, error)
        if self._server is not None:
            self._selector.register(self._server, selectors.EVENT_READ)

    def publish(self, status: Status) -> None:
        """Send the status as one line to every reader."""
        if self._server is None:
            return
        self._accept()
        if not self._readers:
            return
        line = msgspec.json.encode(feed_line(status)) + b"\n"
        self._readers = [reader for reader in self._readers if _takes(reader, line)]

    def close(self) -> None:
        """Disconnect all readers and remove the socket."""
        for one in (*self._readers, *([self._server] if self._server else [])):
            one.close()
        self._selector.close()
        self._readers, self._server = [], None
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._path = None

    def _listen(self, address: str) -> socket.socket:
        if address.isdecimal():
            server = socket.create_server((_LOOPBACK, int(address)), backlog=_BACKLOG)
        else:
            server = self._listen_on_path(Path(address))
        server.setblocking(False)
        return server

    def _listen_on_path(self, path: Path) -> socket.socket:
        with suppress(FileNotFoundError):
            if stat.S_ISSOCK(path.stat().st_mode):  # left by a service that was killed
                path.unlink()
        server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            server.bind(str(path))
            path.chmod(_GROUP_MAY_CONNECT)
            server.listen(_BACKLOG)
        except OSError:
            server.close()
            raise
        self._path = path
        return server

    def _accept(self) -> None:
        assert self._server is not None
        while self._selector.select(timeout=0):
            try:
                reader, _ = self._server.accept()
            except OSError:
                return
            if len(self._readers) >= _MOST_READERS:
                reader.close()
                continue
            reader.setblocking(False)
            self._readers.append(reader)


def feed_line(status: Status) -> dict[str, Any]:
    """What the feed tells of a status: no position, no time of day and no file."""
    return {
        "state": status.state,
        "uptime_s": round((status.now_ns - status.since_ns) / 1e9),
        "has_fix": status.has_fix,
        "satellites": status.fix.sats_used if status.fix else None,
        "fixes": status.fixes,
        "scans": status.scans,
        "readings": status.readings,
        "waiting": status.waiting,
        "ports": {name: port.is_open for name, port in status.ports.items()},
        "cells": len(status.cells),
        "unusual": [
            {"cell": one.cell, "word": one.word, "reasons": list(one.reasons)}
            for one in status.suspicions
        ],
    }


def _takes(reader: socket.socket, line: bytes) -> bool:
    """False where a part was sent: the rest cannot be sent later."""
    try:
        if reader.send(line) == len(line):
            return True
    except OSError:
        pass
    reader.close()
    return False
