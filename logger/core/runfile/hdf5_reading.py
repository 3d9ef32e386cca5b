"""A run's HDF5 file, read in a separate process (`isolation`) and validated here."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from logger.core.errors import RunFileError
from logger.core.runfile import hdf5_tasks
from logger.core.runfile.isolation import Arrays, run_isolated
from logger.core.runfile.journal_reader import decode_meta
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, check_end
from logger.core.runfile.verify import Sealing

Content = tuple[RunMeta, RunEnd | None, Damage, str, Arrays, int]


class StoredResults(NamedTuple):
    """Results of the desktop program as they are stored (`postproc.results`)."""

    made_from: bytes
    selected: bytes
    digest: str
    values: bytes
    arrays: Arrays


def read_hdf5(path: Path) -> Content:
    """Read a run's HDF5 file: its digest, the tables, and how many raw bytes it has."""
    return _decode(*run_isolated(path, hdf5_tasks.everything), path)


def read_hdf5_together(paths: Sequence[Path]) -> list[tuple[Content, Sealing]]:
    """Several files and their seals, by one process: starting it takes longer than a small file.

    They share the limits of time and memory of the first. Raises `RunFileError` if any of them
    cannot be read.
    """
    values, arrays = run_isolated(paths[0], hdf5_tasks.everything_in, *paths[1:])
    tables: list[Arrays] = [{} for _ in paths]
    for name, rows in arrays.items():
        number, _, table = name.partition("/")
        tables[int(number)][table] = rows
    return [
        (_decode(content, rows, path), msgspec.convert(sealing, Sealing))
        for (content, sealing), rows, path in zip(values, tables, paths, strict=True)
    ]


def _decode(content: Any, tables: Arrays, path: Path) -> Content:
    meta = decode_meta(content["meta"].encode(), path)
    return (
        meta,
        decode_end(content["end"], path),
        decode_damage(content["damage"], path),
        content["digest"],
        tables,
        content["n_raw"],
    )


def run_id_of(path: Path) -> str:
    """Identifier of the run in a file; raises `RunFileError` if it cannot be read."""
    try:
        return str(run_isolated(path, hdf5_tasks.run_id)[0])
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror}") from error


def read_results(path: Path, made_from: str) -> StoredResults:
    """Results of the desktop program; without values if they were made from something else.

    Raises `RunFileError`.
    """
    try:
        content, arrays = run_isolated(path, hdf5_tasks.results, made_from)
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror}") from error
    shapes = content["shapes"]
    values = arrays.pop("values", np.empty(0, np.uint8)).tobytes()
    return StoredResults(
        content["made_from"].encode(),
        content["selected"].encode(),
        content["digest"],
        values,
        {name: array.reshape(shapes[name]) for name, array in arrays.items()},
    )


def decode_end(text: bytes | str, path: Path) -> RunEnd | None:
    """How a run stopped; raises `RunFileError` for what is no such thing."""
    try:
        end: RunEnd | None = msgspec.json.decode(text, type=RunEnd | None)
        if end is not None:
            check_end(end)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise RunFileError(f"{path} is damaged: how it ended cannot be read ({error})") from error
    return end


def decode_damage(text: bytes | str, path: Path) -> Damage:
    """What a run lacks; raises `RunFileError` for what is no such thing."""
    try:
        return msgspec.json.decode(text, type=Damage)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise RunFileError(f"{path} is damaged: what it lacks cannot be read ({error})") from error
