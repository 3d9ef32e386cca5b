"""A `Result` as plain values and named arrays, and back, without loss of a bit.

Every field of the dataclasses and named tuples in it is encoded by its annotation (msgspec), so a
new field needs no change here. An array is named by the way to it, such as `cells/0/ekf/x`; small
ones stand among the values. The recorded data are not part of it: a `Run` is read from its file.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from hashlib import sha256
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.readings import Observations
from logger.core.runfile import Run
from postproc.result import CellResult, ObservedRun, Options, Result

_MOST_INLINE = 32
"""Elements of an array that stands among the values, such as a state or a covariance."""

Array = npt.NDArray[Any]
Value = TypeVar("Value")


class Encoded(NamedTuple):
    """MessagePack of the values, and the arrays that it names."""

    values: bytes
    arrays: dict[str, Array]


@dataclass(frozen=True, slots=True)
class _Run:
    """An `ObservedRun` with the id of its run."""

    run_id: str
    observations: Observations | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Document:
    """The fields of a `Result`."""

    runs: tuple[_Run, ...]
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...]
    options: Options
    version: str


def encode(result: Result) -> Encoded:
    """The values of a result, and its arrays; equal arrays are there once."""
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

    return Encoded(msgspec.msgpack.encode(document, enc_hook=plain), arrays)


def decode(encoded: Encoded, runs: Sequence[Run]) -> Result:
    """The result about these runs, in whatever order they are given.

    Raises ValueError for values that are none, or that name other arrays or runs.
    """

    def restore(_: Any, value: Any) -> Array:
        if isinstance(value, str):
            return encoded.arrays[value]
        dtype, shape, elements = value
        return np.array(elements, np.dtype(dtype)).reshape(shape)

    try:
        document = msgspec.msgpack.decode(encoded.values, type=_Document, dec_hook=restore)
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
    """Arrays of more than a few elements with the ways to them, such as `cells/0/ekf/x`."""
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
