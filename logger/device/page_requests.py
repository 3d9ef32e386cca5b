"""What the page on the phone asks of the recorder: follow a cell, mark a place.

The page appends lines to a file in a folder of its own, and the recorder only reads it. So the page
needs no right to write anything of the recorder, and the recorder none to listen on a network.
"""

import os
import stat
from pathlib import Path
from typing import Literal

import msgspec

from logger.core.live_settings import FOLLOW, MARK
from logger.core.printable import printable
from logger.core.types import Note

FILE = "requests"
LONGEST_TEXT = 120
"""Characters of a mark; a cell's name is shorter."""
_LONGEST_LINE = 1024
_MOST_AT_ONCE = 4
"""Requests in a tick; a thumb makes fewer."""


class PageRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One line of the file: "follow" with the name of a cell, or "mark" with a text."""

    do: Literal["follow", "mark"]
    text: str = ""


class PageRequests:
    """New requests in the page's file.

    What stood there before this program started is not for this run. The folder belongs to another
    user: what is there may be a pipe, a link or garbage, and is then counted in a note.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._file_id, self._position = self._end()

    def take(self) -> list[Note]:
        """Notes to be recorded: one for each new request, and one for what is none."""
        lines = self._new_lines()
        requests = [_parse(line) for line in lines[:_MOST_AT_ONCE]]
        notes = [_note(request) for request in requests if request is not None]
        n_bad = len(lines) - len(notes)
        if n_bad:
            notes.append(Note("warning", "page-request", f"{n_bad} requests of the page refused"))
        return notes

    def _end(self) -> tuple[tuple[int, int], int]:
        try:
            status = self._path.lstat()
        except OSError:
            return (0, 0), 0
        return (status.st_dev, status.st_ino), status.st_size

    def _new_lines(self) -> list[bytes]:
        file_id, size = self._end()
        if file_id != self._file_id:  # the page has started again
            self._file_id, self._position = file_id, 0
        if size <= self._position:
            return []
        most = _LONGEST_LINE * _MOST_AT_ONCE
        data = _read(self._path, self._position, most)
        complete = len(data) if len(data) == most else data.rfind(b"\n") + 1
        self._position += complete
        return data[:complete].splitlines()


def page_requests(status: Path | None) -> PageRequests | None:
    """The page's requests where systemd gives the service a folder for its status."""
    return None if status is None else PageRequests(requests_folder(status))


def requests_folder(status: Path) -> Path:
    """The page's RuntimeDirectory=, beside the folder of status.json."""
    return status.with_name(f"{status.name}-page")


def _read(path: Path, position: int, most: int) -> bytes:
    """Part of a regular file, empty for anything else; never blocks."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return b""
    try:
        return os.pread(fd, most, position) if stat.S_ISREG(os.fstat(fd).st_mode) else b""
    except OSError:
        return b""
    finally:
        os.close(fd)


def _parse(line: bytes) -> PageRequest | None:
    try:
        request = msgspec.json.decode(line, type=PageRequest)
    except msgspec.DecodeError:
        return None
    return request if len(request.text) <= LONGEST_TEXT else None


def _note(request: PageRequest) -> Note:
    code = FOLLOW if request.do == "follow" else MARK
    return Note("info", code, printable(request.text))
