"""One file of a journal: append only, with reserved zeros ahead of the end.

It is on the card when `append` returns.

Settings and their reasons were found by pulling the plug on 57 designs (ARCHITECTURE.md, decision
3).
"""

import errno
import fcntl
import os
from contextlib import suppress
from pathlib import Path

RESERVE_BYTES = 1 << 20
"""Written zeros ahead of the data: a flush then changes no file size, which is what lying cards
lose.
"""

ROOM_MAY_COME = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS})
"""Errors after which the same file may be tried again: the card refused, it did not fail."""


class JournalFile:
    """A new file, locked against recovery while it is open.

    Raises OSError, and leaves nothing behind, if it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._fd = -1
        self._path = path
        self._end = 0
        self._reserved = 0
        self._fd = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.fsync(self._fd)
            sync_folder(path.parent)
        except OSError:
            self.discard()
            raise

    @property
    def is_empty(self) -> bool:
        """True until an `append` has succeeded."""
        return self._end == 0

    def append(self, data: bytes | bytearray) -> None:
        """Append data and wait until the card has it.

        After an OSError nothing counts as written.
        """
        with memoryview(data) as view:
            needed = self._write(view, self._end)
        if self._reserved - needed < RESERVE_BYTES // 2:
            self._reserve(needed)
            os.fsync(self._fd)
        else:
            os.fdatasync(self._fd)
        self._end = needed

    def close(self) -> None:
        """Cut the reserve off and close; failing to is no loss."""
        with suppress(OSError):
            os.ftruncate(self._fd, self._end)
            os.fsync(self._fd)
        self._let_go()

    def discard(self) -> None:
        """Close and remove it."""
        self._let_go()
        with suppress(OSError):
            self._path.unlink()

    def __del__(self) -> None:
        self._let_go()

    def _let_go(self) -> None:
        fd, self._fd = self._fd, -1
        with suppress(OSError, ValueError):  # the second where there is none
            # a process made meanwhile to read another run may have a copy, which would hold the
            # lock on
            fcntl.flock(fd, fcntl.LOCK_UN)
            os.close(fd)

    def _reserve(self, needed: int) -> None:
        """Reserve zeros ahead, as far as there is space; a full card still takes the last ones."""
        start = max(self._reserved, needed)
        with suppress(OSError), memoryview(bytes(needed + RESERVE_BYTES - start)) as zeros:
            while start < needed + RESERVE_BYTES:
                start += os.pwrite(self._fd, zeros[-(needed + RESERVE_BYTES - start) :], start)
                self._reserved = start

    def _write(self, view: memoryview, position: int) -> int:
        while view:
            # on a full card pwrite writes fewer bytes and reports no error
            written = os.pwrite(self._fd, view, position)
            view, position = view[written:], position + written
        return position


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def is_recording(path: Path) -> bool:
    """True while a process holds the journal open for writing."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
        return False
