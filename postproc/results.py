"""The results of `smooth` as `run.post.h5`, beside the run, which is never changed.

`report`, `view`, `plot`, `export` and `verify` read them instead of estimating again, where they
were made from the same data, with the same options and by the same program.

Every field of the dataclasses and named tuples of a result is encoded by its annotation (msgspec),
so a new field needs no change here. An array is named by the way to it, such as `cells/0/ekf/x`;
small ones stand among the values. A `Run` is read from its own file.
"""

import errno
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

import logger.core
from logger.core.document import json_text
from logger.core.errors import RunFileError
from logger.core.readings import Observations
from logger.core.runfile import RESULTS, Run, read_results
from postproc.atomic_write import whole_file
from postproc.result import (
    CellResult,
    ObservedRun,
    Options,
    Result,
    joint_warnings,
    program_version,
)
from postproc.scan_counts import observed_cells

_MOST_INLINE = 32
"""Elements of an array that stands among the values, such as a state or a covariance."""

Array = npt.NDArray[Any]
_TABLES = ("fixes", "scans", "readings")
"""What is estimated from; notes, raw bytes and the live estimate change no result."""
_SOURCES = ("*.py", "estimators/*.py", "survey/*.py")
"""Of this package: what may change a result. Pictures, reports and exports are made from one."""


@dataclass(frozen=True, slots=True)
class _Run:
    """An `ObservedRun` with the id of its run."""

    run_id: str
    observations: Observations | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Document:
    runs: tuple[_Run, ...]
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...]
    options: Options
    version: str


def encode(result: Result) -> tuple[bytes, dict[str, Array]]:
    """MessagePack of the values, and the arrays that it names; equal arrays are there once."""
    runs = tuple(_Run(run.run.meta.run_id, run.observations, run.warnings) for run in result.runs)
    document = _Document(runs, result.cells, result.warnings, result.options, result.version)
    arrays: dict[str, Array] = {}
    first_name: dict[tuple[str, tuple[int, ...], bytes], str] = {}
    name_of: dict[int, str] = {}
    for name, array in _large_arrays(document, ""):
        content = sha256(np.ascontiguousarray(array).data).digest()
        first = first_name.setdefault((array.dtype.str, array.shape, content), name)
        name_of[id(array)] = first
        if first == name:
            arrays[name] = array

    def plain(value: Any) -> Any:
        if isinstance(value, np.generic):
            return value.item()
        if not isinstance(value, np.ndarray):
            raise TypeError(f"a result cannot contain {type(value).__name__}")
        if id(value) in name_of:
            return name_of[id(value)]
        return value.dtype.str, value.shape, value.ravel().tolist()

    return msgspec.msgpack.encode(document, enc_hook=plain), arrays


def decode(values: bytes, arrays: Mapping[str, Array], runs: Sequence[Run]) -> Result:
    """The result about these runs, in any order.

    Raises ValueError for values that are none, or that name other arrays or runs.
    """

    def restore(_: Any, value: Any) -> Array:
        if isinstance(value, str):
            return arrays[value]
        dtype, shape, elements = value
        return np.array(elements, np.dtype(dtype)).reshape(shape)

    try:
        document = msgspec.msgpack.decode(values, type=_Document, dec_hook=restore)
    except (msgspec.MsgspecError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"the values are no result: {error}") from error
    by_id = {run.meta.run_id: run for run in runs}
    if by_id.keys() != {stored.run_id for stored in document.runs}:
        raise ValueError("the values are of other runs")
    observed = (
        ObservedRun(by_id[stored.run_id], stored.observations, stored.warnings)
        for stored in document.runs
    )
    return Result(
        tuple(observed), document.cells, document.warnings, document.options, document.version
    )


def _large_arrays(value: Any, name: str) -> Iterator[tuple[str, Array]]:
    if isinstance(value, np.ndarray):
        if value.size > _MOST_INLINE:
            yield name, value
        return
    parts: Iterator[tuple[Any, Any]] = iter(())
    if is_dataclass(value):
        parts = ((field.name, getattr(value, field.name)) for field in fields(value))
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        parts = zip(value._fields, value, strict=True)
    elif isinstance(value, tuple):
        parts = ((i, part) for i, part in enumerate(value))
    elif isinstance(value, Mapping):
        parts = iter(value.items())
    for key, part in parts:
        yield from _large_arrays(part, f"{name}/{key}" if name else str(key))


class MadeFrom(msgspec.Struct, frozen=True):
    """What determines a result, besides the selection of cells.

    `runs` are digests of the data in any order; `program` is the version with a digest of the
    source.
    """

    runs: tuple[str, ...]
    options: Options
    program: str


class NotStored(Exception):  # noqa: N818 (no error: the result can be computed)
    """Why stored results cannot be used; empty where there are none."""


def path_beside(runs: Sequence[Path]) -> Path:
    """`run-x.h5` -> `run-x.post.h5`, or `run-x.together.post.h5` for the first name of several."""
    first = min(runs, key=lambda path: (path.name, path))
    return first.with_suffix(f".together{RESULTS}" if len(runs) > 1 else RESULTS)


_LIBVER = ("earliest", "v108")
_MARGIN_BYTES = 1 << 20
_OBJECT_BYTES = 2048  # what HDF5 adds for each


@contextmanager
def _file_with_room(
    path: Path, arrays: Mapping[str, Array], texts: Sequence[bytes]
) -> Iterator[Path]:
    # HDF5 may crash on a full disk
    with whole_file(path) as part:
        n_bytes = sum(array.nbytes for array in arrays.values()) + sum(map(len, texts))
        n_bytes += _OBJECT_BYTES * len(arrays) + _MARGIN_BYTES
        if shutil.disk_usage(part.parent).free < n_bytes:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        yield part


def write(result: Result, summary: object, path: Path, cells: Sequence[str] = ()) -> None:
    """Write what `smooth --json` prints and the complete result, complete or not at all.

    `cells` are those that the result was limited to. Raises `RunFileError`.
    """
    import h5py  # noqa: PLC0415 (files are read in another process)

    values, arrays = encode(result)
    runs = [observed.run for observed in result.runs]
    made_from = _made_from_text(runs, result.options)
    selected = msgspec.json.encode(list(cells))
    run_ids = [run.meta.run_id for run in runs]
    texts = [np.bytes_(text) for text in (json_text(summary).encode(), made_from, selected)]
    with (
        _file_with_room(path, arrays, [*texts, values]) as part,
        h5py.File(part, "w", libver=_LIBVER) as file,
    ):
        file.attrs["format"] = "cellwalk results"
        file.attrs["digest"] = _digest(made_from, selected, values, arrays)
        if len(run_ids) == 1:
            file.attrs["run_id"] = run_ids[0]
        else:
            file.attrs["run_ids"] = run_ids
        file["summary"], file["made_from"], file["selected"] = texts
        file["values"] = np.frombuffer(values, np.uint8)
        for name, array in arrays.items():
            file[name] = array
        for i, cell in enumerate(result.cells):
            file.require_group(f"cells/{i}").attrs["cell"] = cell.cell


def read(path: Path, runs: Sequence[Run], only: Sequence[str] | None, options: Options) -> Result:
    """The result that `write` has stored, as it would be computed for these cells.

    Its runs are in the order in which they were estimated.

    Raises `NotStored` where the file was made from something else, lacks a cell or is damaged,
    `ConfigError` for a cell that was not observed.
    """
    wanted = observed_cells(runs, only)
    made_from = _made_from_text(runs, options)
    if not path.exists():
        raise NotStored
    try:
        stored = read_results(path, made_from.decode())
        if stored.made_from != made_from:
            raise NotStored(_difference(stored.made_from, made_from))
        if stored.digest != _digest(made_from, stored.selected, stored.values, stored.arrays):
            raise NotStored("it is damaged")
        selected: list[str] = msgspec.json.decode(stored.selected, type=list[str])
        result = decode(stored.values, stored.arrays, runs)
    except (RunFileError, msgspec.MsgspecError, ValueError) as error:
        raise NotStored(f"it is damaged ({error})") from error
    if selected and (missing := set(wanted) - set(selected)):
        raise NotStored(f"it lacks the cell {min(missing)}")
    return _select_cells(result, wanted)


def _select_cells(result: Result, wanted: dict[str, int]) -> Result:
    cells = tuple(cell for cell in result.cells if cell.cell in wanted)
    return replace(result, cells=cells, warnings=joint_warnings(len(result.runs), cells))


def _made_from_text(runs: Sequence[Run], options: Options) -> bytes:
    return msgspec.json.encode(
        MadeFrom(tuple(sorted(map(_digest_of_run, runs))), options, program_digest())
    )


def _digest_of_run(run: Run) -> str:
    """SHA-256 of what is estimated from; the digest in the file only says what was sealed."""
    digest = sha256(msgspec.json.encode(run.meta))
    for name in _TABLES:
        digest.update(np.ascontiguousarray(run.tables[name]).view(np.uint8).data)
    return digest.hexdigest()


def _digest(made_from: bytes, selected: bytes, values: bytes, arrays: Mapping[str, Array]) -> str:
    digest = sha256(msgspec.json.encode([made_from.decode(), selected.decode()]))
    digest.update(values)
    for name in sorted(arrays):
        array: Array = np.ascontiguousarray(arrays[name])
        digest.update(msgspec.json.encode([name, array.dtype.str, array.shape]))
        digest.update(array.data)
    return digest.hexdigest()


@cache
def program_digest() -> str:
    """Version, and digest of the source code that determines a result."""
    core, package = Path(logger.core.__file__).parent, Path(__file__).parent
    files = [*core.rglob("*.py"), *(path for some in _SOURCES for path in package.glob(some))]
    digest = sha256()
    for path in sorted(files):
        digest.update(path.read_bytes())
    return f"{program_version()} {digest.hexdigest()[:16]}"


def _difference(stored: bytes, made_from: bytes) -> str:
    """What a result was made from, where it is not from `made_from`."""
    try:
        theirs, ours = (msgspec.json.decode(text, type=MadeFrom) for text in (stored, made_from))
    except msgspec.MsgspecError:
        return "it is of another version of the program"
    if theirs.program != ours.program:
        return "it is of another version of the program"
    if theirs.runs != ours.runs:
        return "it was made from other data"
    return "it was made with other options"
