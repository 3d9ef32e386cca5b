"""Records in, journal out."""

import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from logger.core.runfile.frames import Kind
from logger.core.runfile.journal import Journal
from logger.core.runfile.meta import RunEnd, RunMeta, stop_text
from logger.core.schema import pack_rows, row_size, rows_of
from logger.core.types import RawBytes, Record

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
