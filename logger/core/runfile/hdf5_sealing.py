"""The seal of a run, from its HDF5 file: the frames are made again from the rows.

What a reader of the file can see is either under the hash chain (rows, raw bytes, description,
stop) or follows from that (attributes, configuration, damage, units). Whatever is neither is a
difference, and is named.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from zlib import crc32

import h5py
import msgspec
import numpy as np

from logger.core.errors import RunFileError
from logger.core.rows import Rows
from logger.core.runfile.frames import Kind
from logger.core.runfile.hdf5 import BLOCK_ROWS, attributes, config_bytes
from logger.core.runfile.hdf5_content import TEXTS, Content, open_content
from logger.core.runfile.hdf5_layout import FRAMES, RAW_BYTES
from logger.core.runfile.hdf5_reading import decode_damage, decode_end
from logger.core.runfile.meta import Damage, RunMeta, stop_text
from logger.core.runfile.verify import Sealed, Sealing
from logger.core.runfile.writer import raw_payload, rows_payload
from logger.core.schema import is_columns_text

_TEXT_OF = {Kind.META: "meta", Kind.END: "end", Kind.STOP: "end"}
_DAMAGE = {"missing_frames", "skipped_bytes", "description_lost"}
"""What every version has said of it."""
_MOST_NAMED = 20
_MOST_NOTED = 40


def sealing_in(path: Path, earlier: str = "") -> Sealing:
    """Seal of an HDF5 file; to be used within `isolation.run_isolated`. Raises `RunFileError`."""
    with open_content(path) as content:
        return _Sealing(content, earlier).result()


class _Sealing:
    """One file, gone through once."""

    def __init__(self, content: Content, earlier: str) -> None:
        self._content = content
        self._meta = content.meta()
        self._end_text = content.text("end")
        self._end = decode_end(self._end_text, content.path)
        self._tables = content.tables(self._meta)
        self._sealed = Sealed(earlier)
        self._changed: Counter[str] = Counter()
        self._numbers: list[int] = []
        self._has_meta = False

    def result(self) -> Sealing:
        readers = {name: _Reader(table) for name, table in self._tables.items()}
        for number, kind, payload in self._frames(readers):
            self._sealed.add(number, kind, payload)
        surplus = next((name for name, reader in readers.items() if not reader.at_end), "")
        damage = decode_damage(self._content.text("damage"), self._content.path)
        return Sealing(
            self._end,
            damage,
            self._sealed.recomputed_digest,
            self._sealed.chain.broken_at,
            surplus,
            tuple(_short(self._differences(damage))),
            self._end is None or self._sealed.stop is not None,
            self._sealed.continues,
        )

    def _frames(self, readers: Mapping[str, "_Reader"]) -> Iterator[tuple[int, int, bytes]]:
        """Number, kind and payload of the frames from which the file was made."""
        stop = b"" if self._end is None else stop_text(self._end)
        texts = {Kind.META: self._content.text("meta"), Kind.END: self._end_text, Kind.STOP: stop}
        raw_length = 0
        for number, kind, name, n_rows, *crc in readers[FRAMES].each():
            table = name.decode("utf-8", "replace")
            if kind in texts:
                payload, recorded = texts[kind], ("", 0)
            elif kind == Kind.RAW:
                rows = readers["raw"].take(n_rows)
                rows["offset"] -= raw_length
                n_bytes = int(rows["length"].astype(np.int64).sum())
                raw_length += n_bytes
                payload = raw_payload(rows.tobytes(), readers[RAW_BYTES].take(n_bytes).tobytes())
                recorded = ("raw", n_rows)
            elif kind == Kind.ROWS and table in self._meta.columns:
                payload, recorded = (
                    rows_payload(table, readers[table].take(n_rows).tobytes()),
                    (table, n_rows),
                )
            else:
                raise RunFileError(f"{self._content.path}: frames names what is not in the file")
            if (table, n_rows) != recorded:
                self._changed[FRAMES] += 1
            if crc and crc[0] != crc32(payload):
                self._changed[_TEXT_OF.get(kind, table)] += 1
            self._has_meta = self._has_meta or kind == Kind.META
            self._numbers.append(number)
            yield number, kind, payload

    def _differences(self, damage: Damage) -> Iterator[str]:
        yield from (
            f"{name}: {n} frames are not as they were recorded" for name, n in self._changed.items()
        )
        yield from self._sealed.differences(self._end)
        if self._end is not None and self._end_text != msgspec.json.encode(self._end):
            yield "end: it has more fields than a stop"
        yield from self._of_damage(damage)
        if self._content.text("config") != config_bytes(self._meta).rstrip(b"\0"):
            yield "config: it is not the configuration in the description"
        yield from _of_members(self._content, set(self._tables))
        yield from self._of_attributes()
        for name in self._content.member_names:
            if name in self._tables:
                yield from _of_table(name, self._tables[name], self._meta)
            elif name in TEXTS:
                yield from _of_text(name, self._content.file[name])

    def _of_damage(self, damage: Damage) -> Iterator[str]:
        missing = max(self._numbers, default=-1) + 1 - len(set(self._numbers))
        # a journal may also have lost its last frames, which the numbers do not show; a sealed one
        # has not
        sealed = self._end is not None and self._sealed.recomputed_digest == self._end.digest
        wrong = damage.missing_frames != missing if sealed else damage.missing_frames < missing
        if wrong or damage.description_lost == self._has_meta:
            yield f"damage: it states {damage}, but {missing} frames are missing"
        recorded = msgspec.json.decode(self._content.text("damage"))
        if (
            not _DAMAGE <= set(recorded) <= set(Damage.__struct_fields__)
            or damage.meaningless_values
        ):
            yield "damage: it is not what a recovery writes"

    def _of_attributes(self) -> Iterator[str]:
        digest = self._end.digest if self._end else self._sealed.recomputed_digest
        fixes = self._tables["fixes"].fields(["t_ns", "utc_ns", "valid"])[:]
        expected = attributes(self._meta, self._end, digest, fixes)
        found = self._content.file.attrs
        for name in found:
            if name not in expected:
                yield f"attribute {name}: it was added"
        for name, value in expected.items():
            if name not in found:
                yield f"attribute {name}: it is missing"
            elif type(value)(recorded := found[name]) != value or np.ndim(recorded):
                actual, wanted = str(recorded)[:_MOST_NOTED], str(value)[:_MOST_NOTED]
                yield f"attribute {name}: it is {actual}, and should be {wanted}"


def _of_members(content: Content, tables: set[str]) -> Iterator[str]:
    """Members and other things that no run has."""
    for name in content.member_names:
        if name not in tables and name not in TEXTS:
            yield f"{name}: it was added"
    if content.file.userblock_size:
        yield "the file begins with bytes that are no part of it"


def _of_table(name: str, table: h5py.Dataset, meta: RunMeta) -> Iterator[str]:
    """Units and types of the columns."""
    if table.id.get_type() != h5py.h5t.py_create(table.dtype, logical=True):
        yield f"{name}: its columns are stored in another way"
    described = name in meta.columns
    yield from _additions(name, table, {"columns"} if described else set())
    if described:
        text = table.attrs.get("columns", "")
        names = table.dtype.names or ()
        if not isinstance(text, str) or not is_columns_text(name, names, text):
            yield f"{name}: the units of its columns are not those that were recorded"


def _of_text(name: str, text: h5py.Dataset) -> Iterator[str]:
    yield from _additions(name, text, set())


def _additions(name: str, dataset: h5py.Dataset, known: set[str]) -> Iterator[str]:
    for attribute in dataset.attrs:
        if attribute not in known:
            yield f"{name}: the attribute {attribute} was added"


def _short(differences: Iterator[str]) -> Iterator[str]:
    """Not more than somebody reads."""
    for i, difference in enumerate(differences):
        if i == _MOST_NAMED:
            yield "and more"
            return
        yield difference


class _Reader:
    """Rows of a dataset in their order, read by blocks."""

    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset
        self._next = 0
        self._block: Rows = dataset[:0]

    def __len__(self) -> int:
        return int(self._dataset.shape[0])

    @property
    def at_end(self) -> bool:
        return self._next >= len(self) and not len(self._block)

    def each(self) -> Iterator[tuple[Any, ...]]:
        """All rows, as Python values."""
        while not self.at_end:
            yield from self.take(
                min(BLOCK_ROWS, len(self) - self._next + len(self._block))
            ).tolist()

    def take(self, n: int) -> Rows:
        """The next n rows, a copy; raises ValueError when there are not so many."""
        if not 0 <= n <= len(self) - self._next + len(self._block):
            raise ValueError(f"{self._dataset.name} ends too early")
        if len(self._block) < n:
            missing = max(BLOCK_ROWS, n - len(self._block))
            more = self._dataset[self._next : self._next + missing]
            self._next += len(more)
            self._block = np.concatenate([self._block, more])
        taken, self._block = self._block[:n].copy(), self._block[n:]
        return taken
