"""The rows that are appended to a journal, while it is written, without numpy.

Only a journal of this version of the program is read: it is the one that is being recorded.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from logger.core.foreign import open_regular
from logger.core.runfile.frames import Frame, Kind, payload_of, scan
from logger.core.runfile.run_names import part_path
from logger.core.schema import SCHEMA_VERSION, columns_of, packing_of

_CRC_BYTES = 4
_PORTION = 1 << 16
_LARGEST_PORTION = 1 << 22
"""Frames of a second are far smaller; only a flush after a full card makes larger ones."""
_PACKING = packing_of(SCHEMA_VERSION)
_NAMES = {
    table: [name for name, _ in columns] for table, columns in columns_of(SCHEMA_VERSION).items()
}

Row = dict[str, Any]


class JournalTail:
    """Follows the files of one journal; `rows` are those that are new."""

    def __init__(self, journal: Path, tables: frozenset[str]) -> None:
        self.journal = journal
        self._tables = tables
        self._part = 1
        self._position = 0
        self._portion = _PORTION

    def rows(self) -> Iterator[tuple[str, Row]]:
        """Rows of the next portion with the names of their tables; values as they are stored."""
        data = self._read()
        end = 0
        for frame in scan(data):
            if isinstance(frame, Frame):
                end = frame.start + frame.length + _CRC_BYTES
                yield from self._rows_in(frame, data)
        self._position += end
        if end:
            self._portion = _PORTION
        elif data.strip(b"\0"):
            self._portion = min(2 * self._portion, _LARGEST_PORTION)
        elif part_path(self.journal, self._part + 1).exists():
            self._part, self._position = self._part + 1, 0

    def _read(self) -> bytes:
        try:
            with open_regular(part_path(self.journal, self._part), follow_links=False) as file:
                return os.pread(file.fileno(), self._portion, self._position)
        except OSError:
            return b""

    def _rows_in(self, frame: Frame, data: bytes) -> Iterator[tuple[str, Row]]:
        if frame.kind != Kind.ROWS or frame.schema != SCHEMA_VERSION:
            return
        payload = payload_of(data[frame.start : frame.start + frame.length], frame.version)
        if not payload:
            return
        table = payload[1 : 1 + payload[0]].decode("ascii", "replace")
        body = payload[1 + payload[0] :]
        if table not in self._tables or len(body) % _PACKING[table].size:
            return
        for values in _PACKING[table].iter_unpack(body):
            yield table, dict(zip(_NAMES[table], values, strict=True))
