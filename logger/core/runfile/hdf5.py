"""The finished run as plain HDF5: one compound dataset for each table, readable by h5py, h5dump, PyTables and pandas.

The oldest file format there is (superblock 0), since a run must open anywhere; gzip, shuffle and fletcher32 per chunk.
`frames` says how the rows were divided into frames of the journal, so that the hash chain can be checked without it.
"""

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zlib import crc32

import h5py
import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.rows import DTYPES
from logger.core.runfile.meta import Damage, RunEnd, RunMeta
from logger.core.runfile.parts import JournalParts, Part, decode_meta
from logger.core.schema import TABLES
from logger.core.timebase import fit
from logger.core.utc import utc_text

FORMAT = "cellwalk run"
RAW_BYTES = "raw_bytes"
FRAMES = "frames"
FRAME_DTYPE = np.dtype([("number", "<u4"), ("kind", "|u1"), ("table", "S16"), ("n_rows", "<u4")])
BLOCK_ROWS = 4096
_LIBVER = ("earliest", "v108")
_FILTERS = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}
_DATASETS = {**DTYPES, RAW_BYTES: np.dtype("u1"), FRAMES: FRAME_DTYPE}

Column = npt.NDArray[Any]


class _Datasets:
    """Datasets that grow by blocks, with a checksum of everything written."""

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._waiting: dict[str, list[Column]] = {}
        self._n_bytes: Counter[str] = Counter()
        self._raw_length = 0
        self.checksums: dict[str, int] = {}

    def take(self, part: Part) -> None:
        self._add(FRAMES, np.array([(part.number, part.kind, part.table, len(part.rows))], FRAME_DTYPE))
        if not part.table:
            return
        rows = part.rows
        if part.table == "raw":
            rows = rows.copy()
            rows["offset"] += self._raw_length
            self._raw_length += len(part.data)
            self._add(RAW_BYTES, np.frombuffer(part.data, "u1"))
        self._add(part.table, rows)

    def finish(self) -> None:
        """Write what waits, and make the tables of which the run has no row."""
        for name, dtype in _DATASETS.items():
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
            name, shape=(0,), maxshape=(None,), chunks=(1024 if dtype.names else 1 << 16,), dtype=dtype, **_FILTERS
        )
        if name in TABLES:
            dataset.attrs["columns"] = "\n".join(f"{c.name}: {c.unit}" for c in TABLES[name])
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


def write_hdf5(parts: JournalParts, path: Path) -> None:
    """Make the HDF5 file of a journal, wait until the card has it, and read every byte of it again.

    Raises `RunFileError` when the journal has no readable definition of its tables or the file reads back differently.
    """
    with h5py.File(path, "w", libver=_LIBVER, track_order=False) as file:
        datasets = _Datasets(file)
        for part in parts:
            datasets.take(part)
        datasets.finish()
        _write_header(file, parts)
    with path.open("rb") as written:
        os.fsync(written.fileno())
    _verify(path, datasets.checksums)


def _write_header(file: h5py.File, parts: JournalParts) -> None:
    # text in datasets: an attribute holds no more than 64 KiB, and a configuration may be longer
    meta, end = parts.meta, parts.end
    file["meta"] = np.bytes_(parts.meta_text)
    file["config"] = np.bytes_(meta.config_text.encode() or b"\n")
    file["end"] = np.bytes_(parts.end_text)
    file["damage"] = np.bytes_(msgspec.json.encode(parts.damage))
    fixes = file["fixes"].fields(["t_ns", "utc_ns", "valid"])[:]
    timebase = fit(fixes["t_ns"], fixes["utc_ns"], fixes["valid"])
    file.attrs["format"] = FORMAT
    file.attrs["schema"] = meta.schema
    file.attrs["run_id"] = meta.run_id
    file.attrs["boot_id"] = meta.boot_id
    file.attrs["program"] = meta.program
    file.attrs["started_utc"] = utc_text(timebase.utc_ns(meta.started_ns)) if timebase else "unknown"
    file.attrs["stop_reason"] = end.reason if end else "none recorded: the run was cut"
    file.attrs["digest"] = parts.digest


def _verify(path: Path, checksums: dict[str, int]) -> None:
    with h5py.File(path, "r") as file:
        for name, expected in checksums.items():
            dataset, found = file[name], 0
            for start in range(0, len(dataset), BLOCK_ROWS * 16):
                found = crc32(dataset[start : start + BLOCK_ROWS * 16].tobytes(), found)
            if found != expected:
                raise RunFileError(f"{path}: {name} reads back differently from what was written")


def is_hdf5(path: Path) -> bool:
    """True for a file that begins as HDF5."""
    return bool(h5py.is_hdf5(path))


def read_hdf5(path: Path) -> tuple[RunMeta, RunEnd | None, Damage, str, dict[str, Column]]:
    """Everything in a run's HDF5 file, its digest before the tables. Raises `RunFileError` as `open_run`."""
    with open_run(path) as file:
        meta = read_meta(file, path)
        tables = {name: file[name][...] for name in (*meta.columns, RAW_BYTES)}
        return meta, read_end(file), read_damage(file), str(file.attrs.get("digest", "")), tables


@contextmanager
def open_run(path: Path) -> Iterator[h5py.File]:
    """A run's HDF5 file; raises `RunFileError` when it is not one, or what is read inside is damaged."""
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise RunFileError(f"{path} is an HDF5 file but no cellwalk run")
            yield file
    except (OSError, KeyError, RuntimeError, ValueError, msgspec.MsgspecError) as error:
        raise RunFileError(f"{path} is damaged: {error}") from error


def read_meta(file: h5py.File, path: Path) -> RunMeta:
    return decode_meta(text_of(file, "meta"), path)


def read_end(file: h5py.File) -> RunEnd | None:
    end: RunEnd | None = msgspec.json.decode(text_of(file, "end"), type=RunEnd | None)
    return end


def read_damage(file: h5py.File) -> Damage:
    return msgspec.json.decode(text_of(file, "damage"), type=Damage)


def text_of(file: h5py.File, name: str) -> bytes:
    """A text dataset as it was written."""
    return bytes(file[name][()])
