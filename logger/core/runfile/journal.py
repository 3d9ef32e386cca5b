"""Records in, journal out: numbered and chained frames in one file.

After a failure of the card it continues in another file. A file is append only, with reserved zeros
ahead of the end, and is on the card when `append` returns; settings and their reasons were found by
pulling the plug on 57 designs (ARCHITECTURE.md, decision 3).
"""

import errno
import fcntl
import os
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from logger.core.errors import RunFileError
from logger.core.runfile.frames import Chain, Kind, encode
from logger.core.runfile.meta import RunEnd, RunMeta, stop_text
from logger.core.runfile.run_names import part_path
from logger.core.schema import SCHEMA_VERSION, pack_rows, row_size, rows_of
from logger.core.types import RawBytes, Record

DESCRIBE_EVERY_SYNCS = 60
"""The description is repeated in case a journal loses its first block."""

RESERVE_BYTES = 1 << 20
"""Written zeros ahead of the data: a flush then changes no file size, which is what lying cards
lose.
"""

ROOM_MAY_COME = frozenset({errno.ENOSPC, errno.EDQUOT})
"""Errors after which the same file may be tried again: the card is full, it did not fail."""

# an ext4 that has turned read-only stays so for open files, also where it is mounted anew
_CARD_ERRORS = ROOM_MAY_COME | {errno.EROFS, errno.EIO}


class Journal:
    """Frames are collected by `add` and made durable by `sync`.

    Raises `RunFileError` when the file exists or can never be made, `OSError` from `sync` when the
    card is full or failing: everything since the last good sync then stays in memory for the next
    one. After anything but want of room that goes into a new file (`file`): Linux may have dropped
    what it did not write, and call the next sync good.
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
        if self._file is not None and not self._file.is_in_place:
            self._give_up_file()
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

    def _next_file(self) -> "JournalFile":
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
        if self._file.is_empty and self._file.is_in_place and self.file != self.path:
            self._file.discard()
        else:
            self._failed.append(self._file)
        self._file = None
        self._undescribed_syncs = DESCRIBE_EVERY_SYNCS


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

    @property
    def is_in_place(self) -> bool:
        """False once removed, or hidden."""
        try:
            return os.path.samestat(os.fstat(self._fd), self._path.stat())
        except OSError:
            return False

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
        """Reserves as far as there is space; a full card still takes the last zeros."""
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


def write_durably(path: Path, content: bytes, mode: int = 0o666) -> None:
    """Write a file in one step, durably."""
    part = path.with_name(f"{path.name}.part")
    fd = os.open(part, os.O_CREAT | os.O_TRUNC | os.O_WRONLY | os.O_CLOEXEC, mode)
    with os.fdopen(fd, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(fd)
    part.replace(path)
    sync_folder(path.parent)


def is_recording(path: Path) -> bool:
    """True while a process holds the journal open for writing."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
        return False


# --- records ---

FRAME_RECORDS = 4096
"""A frame is read and checked as one unit, so its size is limited."""

MOST_WAITING_BYTES = 16 << 20
"""What may wait in memory for a full card, some hours of a walk; later records are counted and
lost.
"""

RAW_COUNT = struct.Struct("<I")


class RunWriter:
    """Owner of a run during recording: `append` numbers records, `sync` makes them durable.

    Waits for a card that is full or failing already at the start. Raises what `Journal` raises. One
    thread only.
    """

    def __init__(self, path: Path, meta: RunMeta) -> None:
        self.meta = meta
        self._journal = Journal(path, msgspec.json.encode(meta))
        self._rows: dict[str, list[bytes]] = {}
        self._raw: list[tuple[Any, ...]] = []
        self._raw_data = bytearray()
        self._seq = 0
        self._dropped = 0
        with suppress(OSError):  # the next sync raises the same error
            self._journal.sync()

    @property
    def path(self) -> Path:
        return self._journal.path

    @property
    def file(self) -> Path:
        """The file of the journal that is written now: another one after the card has failed."""
        return self._journal.file

    @property
    def is_durable(self) -> bool:
        """Whether nothing in the journal waits for the card.

        Records since the last `sync` are not considered.
        """
        return not self._journal.n_waiting

    @property
    def digest(self) -> str:
        """Digest of the hash chain so far."""
        return self._journal.chain.digest

    def append(self, record: Record) -> int:
        """Take a record; returns its number in the run.

        Raises OverflowError for a number that fits into no column, and is then without the record.
        """
        seq = self._seq
        self._seq += 1
        if self._journal.n_waiting > MOST_WAITING_BYTES:
            self._dropped += 1
            return seq
        if self._seq % FRAME_RECORDS == 0:
            self._queue_rows()
        if isinstance(record.value, RawBytes):
            self._append_raw(seq, record, record.value)
        else:
            packed = [(table, pack_rows(table, [row])) for table, row in rows_of(seq, record)]
            for table, row in packed:
                self._rows.setdefault(table, []).append(row)
        return seq

    def take_dropped(self) -> int:
        """Records lost since the last call: no memory while the card was full."""
        dropped, self._dropped = self._dropped, 0
        return dropped

    def sync(self) -> None:
        """Make everything appended so far durable.

        Raises OSError if that fails, and keeps the data for the next try.
        """
        self._queue_rows()
        self._journal.sync()

    def discard(self) -> None:
        """Remove the journal of a run in which nothing was recorded."""
        self._journal.discard()

    def close(self, t_ns: int, reason: str) -> str:
        """Write the end of the run, which seals it, and close the journal; returns the digest."""
        self._queue_rows()
        end = RunEnd(t_ns=t_ns, reason=reason, n_records=self._seq)
        self._journal.add(Kind.STOP, stop_text(end))
        end = msgspec.structs.replace(end, digest=self.digest)
        self._journal.add(Kind.END, msgspec.json.encode(end))
        self._journal.close()
        return end.digest

    def _append_raw(self, seq: int, record: Record, raw: RawBytes) -> None:
        source = record.source.encode()
        self._raw.append((seq, record.t_ns, source, raw.sent, len(self._raw_data), len(raw.data)))
        self._raw_data += raw.data

    def _queue_rows(self) -> None:
        if self._raw:
            self._journal.add(
                Kind.RAW, raw_payload(pack_rows("raw", self._raw), bytes(self._raw_data))
            )
            self._raw.clear()
            self._raw_data.clear()
        for table, rows in self._rows.items():
            self._journal.add(Kind.ROWS, rows_payload(table, b"".join(rows)))
        self._rows.clear()


def rows_payload(table: str, rows: bytes) -> bytes:
    """Payload of a ROWS frame: length of the table's name, the name, the packed rows."""
    name = table.encode()
    return bytes([len(name)]) + name + rows


def raw_payload(index: bytes, data: bytes) -> bytes:
    """Payload of a RAW frame: number of index rows, these rows packed, and the bytes.

    A row has an offset in `data`.
    """
    return RAW_COUNT.pack(len(index) // row_size("raw")) + index + data
