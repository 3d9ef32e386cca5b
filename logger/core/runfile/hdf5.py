"""The finished run as plain HDF5: written, and read by the tasks of another process.

A file is not trusted (`logger.core.isolation`). Only what this program writes is taken: datasets of
their own bytes, in the root, of known types, and no larger than the file can honestly hold. HDF5
itself would follow links to other files, run any named filter, and allocate any declared size.

What a reader of a run can see is either under the hash chain (rows, raw bytes, description, stop),
whose frames are made again from the rows, or follows from that (attributes, configuration, damage,
units). Anything else is a difference, and is named.
"""

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any
from zlib import crc32

import h5py
import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.isolation import most_memory_bytes, most_unpacked_bytes
from logger.core.printable import printable
from logger.core.rows import Rows, parse_dtypes
from logger.core.runfile.frames import Kind, Sealed, Sealing
from logger.core.runfile.journal import raw_payload, rows_payload
from logger.core.runfile.journal_reader import (
    JournalParts,
    Part,
    decode_damage,
    decode_end,
    decode_meta,
)
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, stop_text
from logger.core.schema import OLDEST_DESCRIBED, TABLES, columns_text, is_columns_text
from logger.core.timebase import fit_run
from logger.core.types import utc_text

# h5py, h5dump, PyTables and pandas read it: the oldest file format (superblock 0); gzip, shuffle
# and fletcher32 per chunk. `frames` states how the rows were divided into frames of the journal,
# so that the hash chain can be checked without the journal.

FORMAT = "cellwalk run"
RAW_BYTES = "raw_bytes"
FRAMES = "frames"
FRAME_DTYPE = np.dtype(
    [("number", "<u4"), ("kind", "|u1"), ("table", "S16"), ("n_rows", "<u4"), ("crc32", "<u4")]
)
"""One row for each frame; the CRC-32 of its payload shows which rows changed."""
BLOCK_ROWS = 4096
_LIBVER = ("earliest", "v108")
_PACKING = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}

Column = npt.NDArray[Any]


def _dtypes_of(meta: RunMeta) -> dict[str, np.dtype[Any]]:
    return {**parse_dtypes(meta.columns), RAW_BYTES: np.dtype("u1"), FRAMES: FRAME_DTYPE}


class _Datasets:
    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._waiting: dict[str, list[Column]] = {}
        self._n_bytes: Counter[str] = Counter()
        self._raw_length = 0
        self.checksums: dict[str, int] = {}

    def take(self, part: Part) -> None:
        row = part.number, part.kind, part.table, len(part.rows), crc32(part.payload)
        self._add(FRAMES, np.array([row], FRAME_DTYPE))
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
        for name, dtype in _dtypes_of(meta).items():
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
            **_PACKING,
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


# --- read by another process ---

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
_TEXT_OF = {Kind.META: "meta", Kind.END: "end", Kind.STOP: "end"}
_DAMAGE = {"missing_frames", "skipped_bytes", "description_lost"}
"""What every version has said of it."""
_MOST_NAMED = 20
_MOST_NOTED = 40
_RESULTS_FORMAT = "cellwalk results"
_RESULT_GROUPS = ("runs", "cells")
_DEEPEST = 12
"""Groups within each other; ours are 8."""
_MOST_ARRAYS = 100_000
"""A cell has some 60."""
_NUMBERS = "biuf"

Arrays = dict[str, npt.NDArray[Any]]


def read_run(path: Path) -> tuple[dict[str, Any], Arrays]:
    """All tables of a run; its texts, its digest, and how many raw bytes it has."""
    with open_content(path) as content:
        tables, n_raw = content.rows(content.meta())
        texts = {name: content.text(name).decode() for name in ("meta", "end", "damage")}
        return {**texts, "digest": content.digest(), "n_raw": n_raw}, tables


def read_sealed_run(path: Path) -> tuple[dict[str, Any], Arrays]:
    """As `read_run`, with its seal."""
    value, tables = read_run(path)
    return {**value, "sealing": read_sealing(path)[0]}, tables


def read_run_id(path: Path) -> tuple[str, Arrays]:
    """Identity of a run."""
    with open_content(path) as content:
        return content.meta().run_id, {}


def read_sealing(path: Path, earlier: str = "") -> tuple[Any, Arrays]:
    """Whether a run is as it was recorded: a `Sealing` as plain values."""
    with open_content(path) as content:
        return msgspec.to_builtins(_Sealing(content, earlier).result()), {}


def read_results(path: Path, made_from: str) -> tuple[dict[str, Any], Arrays]:
    """Texts of a file of results and its arrays, flat, with their shapes among the texts.

    Without arrays if the results were made from something else.
    """
    with open_content(path, _RESULTS_FORMAT, "holds no results") as content:
        return _results(content, made_from)


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
        if meta.schema < OLDEST_DESCRIBED and FRAMES not in self.member_names:
            raise RunFileError(
                f"{self.path} has schema {meta.schema}, which this cellwalk reads as a journal only"
            )
        found = {name: self.table(name, dtype) for name, dtype in _dtypes_of(meta).items()}
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
def open_content(
    path: Path, kind: str = FORMAT, otherwise: str = "is an HDF5 file but no cellwalk run"
) -> Iterator[Content]:
    """An HDF5 file of ours; raises `RunFileError` where it is not of that kind, or damaged."""
    try:
        # without a lock: who has just made the run may still hold one, and network drives have none
        with h5py.File(path, "r", locking=False) as file:
            if (found := file.attrs.get("format")) != kind:
                if found == _RESULTS_FORMAT:
                    otherwise = "holds results of `postproc smooth`: name the run beside it"
                raise RunFileError(f"{path} {otherwise}")
            yield Content(path, file, member_names(path, file), path.stat().st_size)
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        why = str(error)
        if cut := _CUT.search(why):
            why = f"{int(cut[1]):,} of its {int(cut[2]):,} bytes are there; copy it again"
        raise RunFileError(f"{path} is damaged: {why}") from error


# what HDF5 says of a file whose copying was interrupted
_CUT = re.compile(r"truncated file: eof = (\d+),.* stored_eof = (\d+)")


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


class _Sealing:
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
        self._take_frames(readers)
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

    def _take_frames(self, readers: Mapping[str, "_Reader"]) -> None:
        """Compute the chain of the frames from which the file was made."""
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
            self._sealed.add(number, kind, payload)

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
                yield from _additions(name, self._content.file[name], set())

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
    for name in content.member_names:
        if name not in tables and name not in TEXTS:
            yield f"{name}: it was added"
    if content.file.userblock_size:
        yield "the file begins with bytes that are no part of it"


def _of_table(name: str, table: h5py.Dataset, meta: RunMeta) -> Iterator[str]:
    if table.id.get_type() != h5py.h5t.py_create(table.dtype, logical=True):
        yield f"{name}: its columns are stored in another way"
    described = name in meta.columns
    yield from _additions(name, table, {"columns"} if described else set())
    if described:
        text = table.attrs.get("columns", "")
        names = table.dtype.names or ()
        if not isinstance(text, str) or not is_columns_text(name, names, text):
            yield f"{name}: the units of its columns are not those that were recorded"


def _additions(name: str, dataset: h5py.Dataset, known: set[str]) -> Iterator[str]:
    for attribute in dataset.attrs:
        if attribute not in known:
            yield f"{name}: the attribute {attribute} was added"


def _short(differences: Iterator[str]) -> Iterator[str]:
    for i, difference in enumerate(differences):
        if i == _MOST_NAMED:
            yield "and more"
            return
        yield difference


class _Reader:
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


def _results(content: Content, made_from: str) -> tuple[dict[str, Any], Arrays]:
    texts = {name: content.text(name).decode() for name in ("made_from", "selected")}
    texts["digest"] = str(content.file.attrs.get("digest", ""))
    if texts["made_from"] != made_from:
        return {**texts, "shapes": {}}, {}
    datasets = {"values": content.table("values", np.dtype("u1"))}
    for name in _RESULT_GROUPS:
        if name in content.member_names:
            datasets |= dict(_datasets(content, content.file[name], name, _DEEPEST))
    if len(datasets) > _MOST_ARRAYS:
        raise RunFileError(f"{content.path} holds {len(datasets)} arrays")
    n_bytes = sum(dataset.nbytes for dataset in datasets.values())
    if n_bytes > most_memory_bytes(content.file_bytes):
        raise RunFileError(content.too_much("it", n_bytes))
    arrays = {name: dataset[...] for name, dataset in datasets.items()}
    shapes = {name: array.shape for name, array in arrays.items()}
    return {**texts, "shapes": shapes}, {name: array.ravel() for name, array in arrays.items()}


def _datasets(
    content: Content, group: Any, name: str, depth: int
) -> Iterator[tuple[str, h5py.Dataset]]:
    if not isinstance(group, h5py.Group) or not depth:
        raise RunFileError(f"{content.path}: {name} is no group of results")
    for key in group:
        link = key.encode(errors="surrogateescape")
        if group.id.links.get_info(link).type != h5py.h5l.TYPE_HARD:
            raise RunFileError(f"{content.path}: {name}/{key} is a link to elsewhere")
        found = h5py.h5o.open(group.id, link)
        if isinstance(found, h5py.h5g.GroupID):
            yield from _datasets(content, h5py.Group(found), f"{name}/{key}", depth - 1)
            continue
        if why := not_of_its_own(found):
            raise RunFileError(f"{content.path}: {name}/{key} {why}")
        dataset = h5py.Dataset(found)
        if dataset.shape is None or dataset.dtype.kind not in _NUMBERS:
            raise RunFileError(f"{content.path}: {name}/{key} holds no numbers")
        yield f"{name}/{key}", dataset
