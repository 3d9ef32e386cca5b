"""What is in a run's HDF5 file, for a reader that does not trust it.

Only what this program writes is taken: datasets of their own bytes, in the root, of known types,
and no larger than the file can honestly hold. HDF5 itself would follow links to other files, run
any filter that is named, and allocate any size that is declared.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from logger.core.errors import RunFileError
from logger.core.rows import Rows, parse_dtypes
from logger.core.runfile.hdf5_layout import FORMAT, FRAME_DTYPE, FRAMES, RAW_BYTES
from logger.core.runfile.journal_reader import decode_meta
from logger.core.runfile.limits import most_memory_bytes, most_unpacked_bytes
from logger.core.runfile.meta import RunMeta

TEXTS = ("meta", "config", "end", "damage")
_MOST_TEXT_BYTES = 16 << 20
"""Of a text dataset; a configuration has at most 1 MiB, and is in two of them."""
_MOST_CHUNK_BYTES = 16 << 20
"""HDF5 decompresses complete chunks; ours have at most 600 kB."""
_MOST_MEMBERS = 1000
FRAME_DTYPE_OF_SCHEMA_2 = np.dtype(
    [("number", "<u4"), ("kind", "|u1"), ("table", "S16"), ("n_rows", "<u4")]
)
_FILTERS = frozenset({h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32})
_LAYOUTS = frozenset({h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED})


@dataclass(frozen=True, slots=True)
class Content:
    """An open run; `member_names` are those of the root."""

    path: Path
    file: h5py.File
    member_names: tuple[str, ...]
    file_bytes: int

    def text(self, name: str) -> bytes:
        """A text dataset as it was written."""
        dataset = self._dataset(name)
        if dataset.shape != () or dataset.dtype.kind != "S" or dataset.nbytes > _MOST_TEXT_BYTES:
            raise RunFileError(f"{self.path}: {name} is no text")
        return bytes(dataset[()])

    def meta(self) -> RunMeta:
        return decode_meta(self.text("meta"), self.path)

    def table(self, name: str, dtype: np.dtype[Any]) -> h5py.Dataset:
        """A table of rows, or one of bytes, to be read in blocks."""
        dataset = self._dataset(name)
        if dataset.shape is None or len(dataset.shape) != 1:
            raise RunFileError(f"{self.path}: {name} is no table")
        if dataset.dtype != dtype and (name != FRAMES or dataset.dtype != FRAME_DTYPE_OF_SCHEMA_2):
            raise RunFileError(
                f"{self.path}: {name} has other columns than the description of the run"
            )
        if dataset.nbytes > most_unpacked_bytes(self.file_bytes):
            raise RunFileError(self.too_much(name, dataset.nbytes))
        return dataset

    def tables(self, meta: RunMeta) -> Mapping[str, h5py.Dataset]:
        """All tables, with the bytes and the frames, by name."""
        dtypes = {**parse_dtypes(meta.columns), RAW_BYTES: np.dtype("u1"), FRAMES: FRAME_DTYPE}
        found = {name: self.table(name, dtype) for name, dtype in dtypes.items()}
        n_bytes = sum(dataset.nbytes for dataset in found.values())
        if n_bytes > most_unpacked_bytes(self.file_bytes):
            raise RunFileError(self.too_much("it", n_bytes))
        return found

    def rows(self, meta: RunMeta) -> tuple[dict[str, Rows], int]:
        """Read all tables but the frames.

        If the raw bytes exceed the memory limit, only their number is returned.
        """
        found = self.tables(meta)
        raw_bytes = found[RAW_BYTES]
        wanted = {
            name: dataset for name, dataset in found.items() if name not in {FRAMES, RAW_BYTES}
        }
        n_bytes, most = (
            sum(dataset.nbytes for dataset in wanted.values()),
            most_memory_bytes(self.file_bytes),
        )
        if n_bytes > most:
            raise RunFileError(self.too_much("it", n_bytes))
        tables = {name: dataset[...] for name, dataset in wanted.items()}
        n_raw = len(raw_bytes)
        tables[RAW_BYTES] = raw_bytes[...] if n_raw <= most else np.empty(0, np.uint8)
        return tables, n_raw

    def digest(self) -> str:
        """The digest that the file states; an interrupted run has no other one."""
        found = self.file.attrs.get("digest", "")
        return found if isinstance(found, str) and len(found) <= 64 else ""

    def too_much(self, name: str, n_bytes: int) -> str:
        size = f"{n_bytes / 1e6:.0f} MB"
        return f"{self.path}: {name} claims {size}, more than a run of this size can hold"

    def _dataset(self, name: str) -> h5py.Dataset:
        if name not in self.member_names:
            raise RunFileError(f"{self.path} is damaged: it has no {name}")
        found = h5py.h5o.open(self.file.id, name.encode())
        if not isinstance(found, h5py.h5d.DatasetID):
            raise RunFileError(f"{self.path}: {name} is no dataset")
        return h5py.Dataset(found)


@contextmanager
def open_content(path: Path) -> Iterator[Content]:
    """A run's HDF5 file; raises `RunFileError` when it is not one.

    To be used within `isolation.run_isolated`: HDF5 may end the process over a damaged file.
    """
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise RunFileError(f"{path} is an HDF5 file but no cellwalk run")
            yield Content(path, file, member_names(path, file), path.stat().st_size)
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise RunFileError(f"{path} is damaged: {error}") from error


def member_names(path: Path, file: h5py.File) -> tuple[str, ...]:
    """Names in the root, after a check that none of them links outside the file.

    Names that this program does not read are checked too, because other programs will read them.
    """
    if len(file) > _MOST_MEMBERS:
        raise RunFileError(f"{path} has {len(file)} members, and is no cellwalk run")
    names = tuple(file)
    for name in names:
        if file.id.links.get_info(name.encode(errors="surrogateescape")).type != h5py.h5l.TYPE_HARD:
            raise RunFileError(
                f"{path}: {name} is a link to elsewhere; no run has that, and it is not read"
            )
        if why := not_of_its_own(h5py.h5o.open(file.id, name.encode(errors="surrogateescape"))):
            raise RunFileError(f"{path}: {name} {why}; no run has that, and it is not read")
    return names


def not_of_its_own(found: Any) -> str:
    """Why a dataset cannot be read safely from this file; empty if it can."""
    if not isinstance(found, h5py.h5d.DatasetID):
        return ""
    made = found.get_create_plist()
    if made.get_layout() not in _LAYOUTS:
        return "is made of other files"
    if made.get_layout() != h5py.h5d.COMPACT and made.get_external_count():
        return "keeps its bytes in another file"
    return (
        _hard_to_unpack(made, found.get_type().get_size())
        if made.get_layout() == h5py.h5d.CHUNKED
        else ""
    )


def _hard_to_unpack(made: Any, row_bytes: int) -> str:
    if any(made.get_filter(i)[0] not in _FILTERS for i in range(made.get_nfilters())):
        return "is compressed with an unsupported filter"
    return (
        "has chunks that are too large"
        if prod(made.get_chunk()) * row_bytes > _MOST_CHUNK_BYTES
        else ""
    )
