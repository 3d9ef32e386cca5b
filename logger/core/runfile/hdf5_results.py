"""Results of the desktop program in HDF5, for a reader that does not trust the file.

As `hdf5_content`, to be used within `isolation.run_isolated`.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from logger.core.errors import RunFileError
from logger.core.runfile.hdf5_content import Content, member_names, not_of_its_own
from logger.core.runfile.isolation import Arrays
from logger.core.runfile.limits import most_memory_bytes

_FORMAT = "cellwalk results"
_GROUPS = ("runs", "cells")
_DEEPEST = 12
"""Groups within each other; ours are 8."""
_MOST_ARRAYS = 100_000
"""A cell has some 60."""
_KINDS = "biuf"


def results_in(path: Path, made_from: str) -> tuple[dict[str, Any], Arrays]:
    """Texts of a file of results and its arrays, flat, with their shapes among the texts.

    Without arrays if the results were made from something else.
    """
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != _FORMAT:
                raise RunFileError(f"{path} holds no results")
            return _read(
                Content(path, file, member_names(path, file), path.stat().st_size), made_from
            )
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise RunFileError(f"{path} is damaged: {error}") from error


def _read(content: Content, made_from: str) -> tuple[dict[str, Any], Arrays]:
    texts = {name: content.text(name).decode() for name in ("made_from", "selected")}
    texts["digest"] = str(content.file.attrs.get("digest", ""))
    if texts["made_from"] != made_from:
        return {**texts, "shapes": {}}, {}
    datasets = {"values": content.table("values", np.dtype("u1"))}
    for name in _GROUPS:
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
    """Datasets of numbers in a group and those within it."""
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
        if dataset.shape is None or dataset.dtype.kind not in _KINDS:
            raise RunFileError(f"{content.path}: {name}/{key} holds no numbers")
        yield f"{name}/{key}", dataset
