"""Is a run whole and as it was sealed? For a third party: the file in either form is all that is needed."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from logger.core.rows import Rows
from logger.core.runfile.chain import Chain
from logger.core.runfile.frames import Kind
from logger.core.runfile.hdf5 import BLOCK_ROWS, FRAMES, RAW_BYTES, is_hdf5, open_run, read_damage, read_end, text_of
from logger.core.runfile.meta import Damage, RunEnd
from logger.core.runfile.parts import JournalParts
from logger.core.runfile.writer import raw_payload, rows_payload


@dataclass(frozen=True, slots=True)
class Sealing:
    """What the hash chain of a run says; `recomputed` is over the frames before the END frame, or all there are.

    `surplus` names a table of the HDF5 file with rows that stand in no frame.
    """

    end: RunEnd | None
    damage: Damage
    recomputed: str
    broken_at: int | None
    surplus: str = ""

    @property
    def holds(self) -> bool:
        """True when the run was sealed, and all frames are there as they were then."""
        if self.end is None or self.broken_at is not None or self.surplus:
            return False
        return self.recomputed == self.end.digest


@dataclass(slots=True)
class _Sealed:
    """A chain that keeps the digest before the END frame."""

    chain: Chain = field(default_factory=Chain)
    before_end: str | None = None

    def add(self, number: int, kind: int, payload: bytes) -> None:
        if kind == Kind.END:
            self.before_end = self.chain.digest
        self.chain.add(number, kind, payload)

    def sealing(self, end: RunEnd | None, damage: Damage, surplus: str = "") -> Sealing:
        return Sealing(end, damage, self.before_end or self.chain.digest, self.chain.broken_at, surplus)


def sealing_of(path: Path) -> Sealing:
    """Compute the hash chain of a run again, from its journal or its HDF5. Raises `RunFileError`."""
    return _of_hdf5(path) if path.is_file() and is_hdf5(path) else _of_journal(path)


def _of_journal(path: Path) -> Sealing:
    sealed = _Sealed()
    parts = JournalParts(path)
    for part in parts:
        sealed.add(part.number, part.kind, part.payload)
    return sealed.sealing(parts.end, parts.damage)


def _of_hdf5(path: Path) -> Sealing:
    sealed = _Sealed()
    with open_run(path) as file:
        readers = {name: _Reader(file[name]) for name in file if file[name].shape}
        for number, kind, payload in _frames(file, readers):
            sealed.add(number, kind, payload)
        surplus = next((name for name, reader in readers.items() if not reader.at_end), "")
        return sealed.sealing(read_end(file), read_damage(file), surplus)


def _frames(file: h5py.File, readers: dict[str, "_Reader"]) -> Iterator[tuple[int, int, bytes]]:
    """Number, kind and payload of the frames from which an HDF5 file was made."""
    told = {Kind.META: text_of(file, "meta"), Kind.END: text_of(file, "end")}
    frames = readers[FRAMES]
    raw_length = 0
    for _ in range(len(frames)):
        ((number, kind, table, n_rows),) = frames.take(1).tolist()
        if kind in told:
            yield number, kind, told[kind]
            continue
        rows = readers[table.decode()].take(n_rows)
        if kind == Kind.RAW:
            rows["offset"] -= raw_length
            n_bytes = int(rows["length"].sum())
            raw_length += n_bytes
            yield number, kind, raw_payload(rows.tobytes(), readers[RAW_BYTES].take(n_bytes).tobytes())
        else:
            yield number, kind, rows_payload(table.decode(), rows.tobytes())


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

    def take(self, n: int) -> Rows:
        """The next n rows, a copy; raises ValueError when there are not so many."""
        while len(self._block) < n:
            more = self._dataset[self._next : self._next + max(BLOCK_ROWS, n)]
            if not len(more):
                raise ValueError(f"{self._dataset.name} ends too early")
            self._next += len(more)
            self._block = np.concatenate([self._block, more])
        taken, self._block = self._block[:n].copy(), self._block[n:]
        return taken
