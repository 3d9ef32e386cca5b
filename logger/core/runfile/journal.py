"""The journal of a run: append only, one write and one fdatasync a tick, zeroed reserve ahead of the end.

Settings and their reasons were found by pulling the plug on 57 designs (ARCHITECTURE.md, decision 4).
"""

import fcntl
import os
import secrets
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.runfile.frames import Kind, encode

RESERVE_BYTES = 1 << 20
"""Written zeros ahead of the data: a flush then changes no file size, which is what lying cards lose."""


class Journal:
    """An open journal file; frames are collected by `add` and made durable by `sync`.

    Raises `RunFileError` when the file exists or cannot be made, `OSError` from `sync` when the card is full or
    failing: what was not written stays in memory and the next `sync` tries again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._run = secrets.randbits(32)
        self._number = 0
        self._pending = bytearray()
        self._end = 0
        self._reserved = 0
        try:
            self._fd = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise RunFileError(f"cannot make {path}: {error.strerror}") from error
        fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.fsync(self._fd)
        sync_folder(path.parent)

    def add(self, kind: Kind, payload: bytes) -> None:
        """Queue one frame for the next `sync`."""
        self._pending += encode(self._run, self._number, kind, payload)
        self._number += 1

    def sync(self) -> None:
        """Write what is queued and wait until the card has it."""
        self._reserve()
        while self._pending:
            # a full card writes less than asked, without an error
            written = os.pwrite(self._fd, self._pending, self._end)
            self._end += written
            del self._pending[:written]
        os.fdatasync(self._fd)

    def close(self) -> None:
        """Sync, cut the reserve off, sync again; the file is closed whatever happens."""
        try:
            self.sync()
            os.ftruncate(self._fd, self._end)
            os.fsync(self._fd)
        finally:
            os.close(self._fd)

    def _reserve(self) -> None:
        needed = self._end + len(self._pending)
        if self._reserved - needed >= RESERVE_BYTES // 2:
            return
        target = needed + RESERVE_BYTES
        start = max(self._reserved, self._end)
        while start < target:
            start += os.pwrite(self._fd, bytes(min(target - start, RESERVE_BYTES)), start)
            self._reserved = start
        os.fsync(self._fd)


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
