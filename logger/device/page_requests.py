"""What the page on the phone asks of the recorder: follow a cell, mark a place.

The page appends lines to a file in a folder of its own, and the recorder only reads it: the page
needs no right to write anything of the recorder, the recorder none to listen on a network. The
recorder's status names the requests that are on the card; only then does the page say yes.
"""

import os
import weakref
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from logger.core.cell_names import why_no_name
from logger.core.foreign import decode_json, open_regular
from logger.core.live_settings import FOLLOW, WITHIN, within_of
from logger.core.printable import printable
from logger.core.types import Note

FILE = "requests"
LONGEST_TEXT = 120
"""Characters of a mark; a cell's name is shorter."""
MOST_AT_ONCE = 16
"""Requests in a tick; the page has no more of them under way."""
_LONGEST_LINE = 1024


class PageRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One line of the file: "follow" with a cell's name, "mark" with a text, "within" with metres.

    The status repeats `id` when the request is on the card.
    """

    do: Literal["follow", "mark", "within"]
    text: Annotated[str, msgspec.Meta(max_length=LONGEST_TEXT)] = ""
    id: Annotated[str, msgspec.Meta(max_length=16)] = ""

    def __post_init__(self) -> None:
        if self.do == FOLLOW and (why := why_no_name(self.text)):
            raise ValueError(why)
        if self.do == WITHIN:
            within_of(self.text)


class PageRequests:
    """New requests in the page's file.

    What stood there before this program started is not for this run. The folder belongs to another
    user: a pipe, a link or garbage there is counted in a note. `on_card` names the latest requests
    that are on the card.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._fd: int | None = None
        self._close: Callable[[], object] = lambda: None
        self._position = 0
        self._refused: tuple[int, ...] = ()
        if self._look_for_file():
            self._position = self._size
        self._waiting: deque[tuple[Note, str]] = deque()
        self._n_recorded = 0
        self._recorded: deque[str] = deque(maxlen=2 * MOST_AT_ONCE)

    @property
    def on_card(self) -> tuple[str, ...]:
        return tuple(self._recorded)

    def take(self) -> list[Note]:
        """Notes to be recorded: one for each new request, and for what is none."""
        lines = self._new_lines()
        requests = [_parse(line) for line in lines[:MOST_AT_ONCE]]
        taken = [(_note(request), request.id) for request in requests if request is not None]
        n_bad = len(lines) - len(taken)
        if n_bad:
            text = f"{n_bad} requests of the page refused"
            taken.append((Note("warning", "page-request", text), ""))
        self._waiting += taken
        return [note for note, _ in taken]

    def drop(self, dropped: Note) -> None:
        """Learn that a note that was taken will not be recorded."""
        self._waiting = deque(one for one in self._waiting if one[0] is not dropped)

    def confirm(self, n: int) -> None:
        """Learn that `n` notes are on the card: the first of all that were not dropped."""
        while self._n_recorded < n and self._waiting:
            self._n_recorded += 1
            _, name = self._waiting.popleft()
            if name:
                self._recorded.append(name)

    def disown(self) -> None:
        """Confirm nothing of what is under way: the card fails, and may take it or not."""
        self._waiting = deque((note, "") for note, _ in self._waiting)

    @property
    def _size(self) -> int:
        return 0 if self._fd is None else os.fstat(self._fd).st_size

    def _look_for_file(self) -> bool:
        """False for something new that is no file.

        The file stays open: the number of one that is gone may be that of the next.
        """
        try:
            now = self._path.lstat()
        except OSError:
            return True
        if self._fd is not None and os.path.samestat(now, os.fstat(self._fd)):
            return True
        if (now.st_ino, now.st_mode, now.st_ctime_ns) == self._refused:
            return True
        self._close()
        self._fd, self._position, self._close = None, 0, lambda: None
        try:
            with open_regular(self._path, follow_links=False) as file:
                self._fd = os.dup(file.fileno())
        except OSError:
            self._refused = now.st_ino, now.st_mode, now.st_ctime_ns
            return False
        self._close = weakref.finalize(self, os.close, self._fd)
        return True

    def _new_lines(self) -> list[bytes]:
        if not self._look_for_file():
            return [b""]
        if self._fd is None:
            return []
        if self._size < self._position:  # it was cut
            self._position = 0
        most = _LONGEST_LINE * MOST_AT_ONCE
        data = os.pread(self._fd, most, self._position)
        complete = len(data) if len(data) == most else data.rfind(b"\n") + 1
        self._position += complete
        return data[:complete].splitlines()


def page_requests(status: Path | None) -> PageRequests | None:
    """The page's requests where systemd gives the service a folder for its status."""
    return None if status is None else PageRequests(requests_folder(status))


def requests_folder(status: Path) -> Path:
    """The page's RuntimeDirectory=, beside the folder of status.json."""
    return status.with_name(f"{status.name}-page")


def _parse(line: bytes) -> PageRequest | None:
    try:
        return decode_json(line, PageRequest)
    except msgspec.DecodeError:
        return None


def _note(request: PageRequest) -> Note:
    return Note("info", request.do, printable(request.text))
