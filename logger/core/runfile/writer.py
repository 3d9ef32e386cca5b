"""Records in, journal out."""

import struct
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from logger.core.runfile.frames import Kind
from logger.core.runfile.journal import Journal
from logger.core.runfile.meta import RunEnd, RunMeta
from logger.core.schema import DTYPES, rows_of
from logger.core.types import RawBytes, Record

META_EVERY_SYNCS = 60
"""The table definitions are repeated, so that a journal that lost its first block can still be read."""

FRAME_RECORDS = 4096
"""A frame is read and checked as a whole, so it must stay small however many records come between two syncs."""

RAW_COUNT = struct.Struct("<I")


class RunWriter:
    """The only owner of a run while it is recorded: `append` numbers the records, `sync` makes them durable.

    Raises what `Journal` raises. One thread only.
    """

    def __init__(self, path: Path, meta: RunMeta) -> None:
        self._meta = msgspec.json.encode(meta)
        self._journal = Journal(path)
        self._rows: dict[str, list[tuple[Any, ...]]] = {}
        self._raw: list[tuple[Any, ...]] = []
        self._raw_data = bytearray()
        self._seq = 0
        self._syncs = 0
        self.sync()

    @property
    def path(self) -> Path:
        return self._journal.path

    def append(self, record: Record) -> int:
        """Take a record; returns its number in the run."""
        seq = self._seq
        self._seq += 1
        if self._seq % FRAME_RECORDS == 0:
            self._queue_rows()
        if isinstance(record.value, RawBytes):
            self._append_raw(seq, record, record.value)
        else:
            for table, row in rows_of(seq, record):
                self._rows.setdefault(table, []).append(row)
        return seq

    def sync(self) -> None:
        """Make everything appended so far durable; raises OSError and keeps it for the next try when it cannot."""
        if self._syncs % META_EVERY_SYNCS == 0:
            self._journal.add(Kind.META, self._meta)
        self._syncs += 1
        self._queue_rows()
        self._journal.sync()

    def close(self, t_ns: int, reason: str) -> None:
        """Write the end of the run and close the journal."""
        self._queue_rows()
        end = RunEnd(t_ns=t_ns, reason=reason, n_records=self._seq)
        self._journal.add(Kind.END, msgspec.json.encode(end))
        self._journal.close()

    def _append_raw(self, seq: int, record: Record, raw: RawBytes) -> None:
        source = record.source.encode()
        self._raw.append((seq, record.t_ns, source, raw.sent, len(self._raw_data), len(raw.data)))
        self._raw_data += raw.data

    def _queue_rows(self) -> None:
        if self._raw:
            index = np.array(self._raw, DTYPES["raw"]).tobytes()
            self._journal.add(Kind.RAW, RAW_COUNT.pack(len(self._raw)) + index + self._raw_data)
            self._raw.clear()
            self._raw_data.clear()
        for table, rows in self._rows.items():
            name = table.encode()
            self._journal.add(Kind.ROWS, bytes([len(name)]) + name + np.array(rows, DTYPES[table]).tobytes())
        self._rows.clear()
