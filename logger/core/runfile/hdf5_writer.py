"""The finished run as plain HDF5: one compound dataset for each table.

h5py, h5dump, PyTables and pandas read it: the oldest file format (superblock 0); gzip, shuffle and
fletcher32 per chunk. `frames` states how the rows were divided into frames of the journal, so that
the hash chain can be checked without the journal.
"""

import os
from collections import Counter
from pathlib import Path
from typing import Any
from zlib import crc32

import h5py
import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.printable import printable
from logger.core.rows import Rows, parse_dtypes
from logger.core.runfile.journal_reader import JournalParts, Part
from logger.core.runfile.meta import RunEnd, RunMeta
from logger.core.schema import TABLES, columns_text
from logger.core.timebase import fit_run
from logger.core.utc import utc_text

FORMAT = "cellwalk run"
RAW_BYTES = "raw_bytes"
FRAMES = "frames"
FRAME_DTYPE = np.dtype(
    [("number", "<u4"), ("kind", "|u1"), ("table", "S16"), ("n_rows", "<u4"), ("crc32", "<u4")]
)
"""One row for each frame; the CRC-32 of its payload shows which rows changed."""
BLOCK_ROWS = 4096
_LIBVER = ("earliest", "v108")
_FILTERS = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}

Column = npt.NDArray[Any]


class _Datasets:
    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._waiting: dict[str, list[Column]] = {}
        self._n_bytes: Counter[str] = Counter()
        self._raw_length = 0
        self.checksums: dict[str, int] = {}

    def take(self, part: Part) -> None:
        self._add(FRAMES, np.array([_frame_row(part)], FRAME_DTYPE))
        if not part.table:
            return
        rows = part.rows
        if part.table == "raw":
            rows = rows.copy()
            rows["offset"] += self._raw_length
            self._raw_length += len(part.data)
            self._add(RAW_BYTES, np.frombuffer(part.data, "u1"))
        self._add(part.table, rows)

    def finish(self, meta: RunMeta) -> None:
        """Write what waits, and make the tables of the run's version that have no row."""
        of_run = {**parse_dtypes(meta.columns), RAW_BYTES: np.dtype("u1"), FRAMES: FRAME_DTYPE}
        for name, dtype in of_run.items():
            if name not in self.checksums:
                self._add(name, np.empty(0, dtype))
        for name in self.checksums:
            self._write(name)

    def _add(self, name: str, rows: Column) -> None:
        if name not in self.checksums:
            self._make(name, rows.dtype)
        self._waiting[name].append(rows)
        self._n_bytes[name] += rows.nbytes
        if self._n_bytes[name] >= BLOCK_ROWS * 128:
            self._write(name)

    def _make(self, name: str, dtype: np.dtype[Any]) -> None:
        dataset = self._file.create_dataset(
            name,
            shape=(0,),
            maxshape=(None,),
            chunks=(1024 if dtype.names else 1 << 16,),
            dtype=dtype,
            **_FILTERS,
        )
        if name in TABLES:
            dataset.attrs["columns"] = columns_text(name, dtype.names or ())
        self._waiting[name] = []
        self.checksums[name] = 0

    def _write(self, name: str) -> None:
        if not self._waiting[name]:
            return
        rows = np.concatenate(self._waiting[name])
        self._waiting[name].clear()
        self._n_bytes[name] = 0
        dataset = self._file[name]
        start = len(dataset)
        dataset.resize((start + len(rows),))
        dataset[start:] = rows
        self.checksums[name] = crc32(rows.tobytes(), self.checksums[name])


def _frame_row(part: Part) -> tuple[int, int, str, int, int]:
    return part.number, part.kind, part.table, len(part.rows), crc32(part.payload)


def write_hdf5(parts: JournalParts, path: Path) -> None:
    """Make the HDF5 file of a journal, wait until the card has it, and read every byte of it again.

    Raises `RunFileError` when the journal has no readable definition of its tables or the file
    reads back differently.
    """
    with h5py.File(path, "w", libver=_LIBVER, track_order=False, locking=False) as file:
        datasets = _Datasets(file)
        for part in parts:
            datasets.take(part)
        datasets.finish(parts.meta)
        _write_header(file, parts)
    with path.open("rb") as written:
        os.fsync(written.fileno())
    _verify(path, datasets.checksums)


def _write_header(file: h5py.File, parts: JournalParts) -> None:
    # text in datasets: an attribute holds no more than 64 KiB, and a configuration may be longer
    file["meta"] = np.bytes_(parts.meta_text)
    file["config"] = np.bytes_(config_bytes(parts.meta))
    file["end"] = np.bytes_(parts.end_text)
    file["damage"] = np.bytes_(msgspec.json.encode(parts.damage))
    fixes = file["fixes"].fields(["t_ns", "utc_ns", "valid"])[:]
    for name, value in attributes(parts.meta, parts.end, parts.digest, fixes).items():
        file.attrs[name] = value


def config_bytes(meta: RunMeta) -> bytes:
    """The configuration as it stands in a dataset, which cannot be empty."""
    return meta.config_text.encode() or b"\n"


def attributes(meta: RunMeta, end: RunEnd | None, digest: str, fixes: Rows) -> dict[str, str | int]:
    """Attributes of the file: all of them follow from what is in it."""
    timebase = fit_run(meta.origin, fixes)
    return {
        "format": FORMAT,
        "schema": meta.schema,
        "run_id": printable(meta.run_id),
        "boot_id": printable(meta.boot_id),
        "program": printable(meta.program),
        "started_utc": utc_text(timebase.utc_ns(meta.started_ns)) if timebase else "unknown",
        "stop_reason": printable(end.reason) if end else "none recorded: the run was cut",
        "digest": printable(digest),
    }


def _verify(path: Path, checksums: dict[str, int]) -> None:
    with h5py.File(path, "r", locking=False) as file:
        for name, expected in checksums.items():
            dataset, found = file[name], 0
            for start in range(0, len(dataset), BLOCK_ROWS * 16):
                found = crc32(dataset[start : start + BLOCK_ROWS * 16].tobytes(), found)
            if found != expected:
                raise RunFileError(f"{path}: {name} reads back differently from what was written")
