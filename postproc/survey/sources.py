"""The files of folders that are runs, or logs that `postproc import` reads."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from logger.core.errors import RunFileError

_LOGS = frozenset(
    {".csv", ".db", ".gz", ".json", ".jsonl", ".kismet", ".kml", ".ndjson", ".sqlite", ".zip"}
)
"""A folder has other files too; one that is named itself is read whatever it is called."""
_RESULTS = ".post.h5"


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Files that are named, and those of folders, in the order of their names.

    A journal is left out where the HDF5 file made of it is beside. Raises `RunFileError`.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise RunFileError(f"{path}: no such file or folder")
        files += sorted(_files_in(path)) if path.is_dir() else [path]
    return list(dict.fromkeys(files))


def is_run(path: Path) -> bool:
    """Whether the name is that of a run, and not of a log of another program."""
    return path.suffix in {".h5", ".journal"}


def _files_in(folder: Path) -> Iterator[Path]:
    for path in folder.rglob("*"):
        if path.name.startswith(".") or path.name.endswith(_RESULTS) or not path.is_file():
            continue
        is_finished = path.suffix == ".journal" and path.with_suffix(".h5").exists()
        if path.suffix in _LOGS or (is_run(path) and not is_finished):
            yield path
