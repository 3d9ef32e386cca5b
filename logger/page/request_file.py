"""The file in which the page asks the recorder for something."""

import errno
import os
import secrets
import stat
from http import HTTPStatus
from pathlib import Path

import msgspec

from logger.device.page_requests import FILE, MOST_AT_ONCE, PageRequest
from logger.page.feed import Feed

_MOST_BYTES = 1 << 18
PATIENCE_S = 10.0
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
            is_recorded = await self._feed.has_recorded(name, PATIENCE_S)
        except OSError:
            return HTTPStatus.INSUFFICIENT_STORAGE
        finally:
            self._n_waiting -= 1
        return HTTPStatus.ACCEPTED if is_recorded else HTTPStatus.SERVICE_UNAVAILABLE

    def _append(self, request: PageRequest) -> None:
        """Append a line in one write; raises OSError.

        A file that has become long, or is none, is replaced where no request in it waits.
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
