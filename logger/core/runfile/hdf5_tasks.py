"""Tasks of `isolation.run_isolated` on an HDF5 file; each runs in a separate process.

HDF5 is imported only there: the calling process starts faster without it.
"""

# ruff: noqa: PLC0415
from pathlib import Path
from typing import Any

import msgspec

from logger.core.runfile.isolation import Arrays


def everything(path: Path) -> tuple[Any, Arrays]:
    """All tables of a run; its texts, its digest, and how many raw bytes it has."""
    from logger.core.runfile.hdf5_content import open_content

    with open_content(path) as content:
        tables, n_raw = content.rows(content.meta())
        texts = {name: content.text(name).decode() for name in ("meta", "end", "damage")}
        return {**texts, "digest": content.digest(), "n_raw": n_raw}, tables


def everything_in(*paths: Path) -> tuple[Any, Arrays]:
    """As `everything` of several runs with their seals; arrays of the k-th are named `k/table`."""
    from logger.core.runfile.hdf5_sealing import sealing_in

    values: list[Any] = []
    arrays: Arrays = {}
    for k, path in enumerate(paths):
        value, tables = everything(path)
        values.append((value, msgspec.to_builtins(sealing_in(path))))
        arrays |= {f"{k}/{name}": rows for name, rows in tables.items()}
    return values, arrays


def run_id(path: Path) -> tuple[Any, Arrays]:
    """Identity of a run."""
    from logger.core.runfile.hdf5_content import open_content

    with open_content(path) as content:
        return content.meta().run_id, {}


def results(path: Path, made_from: str) -> tuple[Any, Arrays]:
    """Results of the desktop program; only their origin if they were made from something else."""
    from logger.core.runfile.hdf5_results import results_in

    return results_in(path, made_from)


def sealing(path: Path, earlier: str) -> tuple[Any, Arrays]:
    """Whether a run is as it was recorded, as plain values."""
    from logger.core.runfile.hdf5_sealing import sealing_in

    return msgspec.to_builtins(sealing_in(path, earlier)), {}
