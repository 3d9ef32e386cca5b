"""The journal of a run: numbered and chained frames in one file.

After a failure of the card it continues in another file.
"""

import errno
import os
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.runfile.chain import Chain
from logger.core.runfile.frames import Kind, encode
from logger.core.runfile.journal_file import ROOM_MAY_COME, JournalFile
from logger.core.runfile.run_names import part_path
from logger.core.schema import SCHEMA_VERSION

DESCRIBE_EVERY_SYNCS = 60
"""The description is repeated, so that a journal that lost its first block can still be read."""

_CARD_ERRORS = ROOM_MAY_COME | {errno.EIO}


class Journal:
    """Frames are collected by `add` and made durable by `sync`.

    Raises `RunFileError` when the file exists or can never be made, `OSError` from `sync` when the
    card is full or failing: everything since the last good sync then stays in memory, and the next
    `sync` tries again, after anything but want of room in a new file (`file`): Linux may have
    dropped what it did not write, and call the next sync good.
    """

    def __init__(self, path: Path, description: bytes) -> None:
        self.path = self.file = path
        self.chain = Chain()
        self._description = description
        self._undescribed_syncs = DESCRIBE_EVERY_SYNCS
        self._run = int.from_bytes(os.urandom(4), "little")
        self._n_files = 0
        self._number = 0
        self._pending = bytearray()
        self._file: JournalFile | None = None
        self._failed: list[JournalFile] = []
        try:
            self._next_file()
        except OSError as error:
            if error.errno not in _CARD_ERRORS:
                raise RunFileError(f"cannot make {path}: {error.strerror}") from error

    @property
    def n_waiting(self) -> int:
        """Bytes that are not on the card yet."""
        return len(self._pending)

    def add(self, kind: Kind, payload: bytes) -> None:
        """Queue one frame for the next `sync`."""
        self._pending += encode(self._run, self._number, kind, payload, SCHEMA_VERSION)
        self.chain.add(self._number, kind, payload)
        self._number += 1

    def sync(self) -> None:
        """Write what is queued and wait until the card has it."""
        if self._undescribed_syncs >= DESCRIBE_EVERY_SYNCS:
            self.add(Kind.META, self._description)
            self._undescribed_syncs = 0
        self._flush()
        self._undescribed_syncs += 1

    def close(self) -> None:
        """Write what is queued, and close the files; they stay open when that fails."""
        self._flush()
        for file in (self._file, *self._failed):
            if file is not None:
                file.close()

    def discard(self) -> None:
        """Remove the files; nothing can be added afterwards."""
        for file in (self._file, *self._failed):
            if file is not None:
                file.discard()
        self._file = None

    def _flush(self) -> None:
        try:
            (self._file or self._next_file()).append(self._pending)
        except OSError as error:
            if error.errno not in ROOM_MAY_COME:
                self._give_up_file()
            raise
        self._pending.clear()

    def _next_file(self) -> JournalFile:
        path = part_path(self.path, self._n_files + 1)
        try:
            self._file = JournalFile(path)
        except FileExistsError:
            self._n_files += bool(
                self._n_files
            )  # what a failing card did not let go: the next try takes the next name
            raise
        self._n_files += 1
        self.file = path
        return self._file

    def _give_up_file(self) -> None:
        """The next sync creates another one.

        This file stays locked, which shows other processes that the run goes on.
        """
        if self._file is None:
            return
        if self._file.is_empty and self.file != self.path:
            self._file.discard()
        else:
            self._failed.append(self._file)
        self._file = None
        self._undescribed_syncs = DESCRIBE_EVERY_SYNCS
