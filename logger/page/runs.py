"""Runs that are closed, for download."""

import os
import re
from pathlib import Path
from typing import BinaryIO

from logger.core.foreign import open_regular

_CLOSED = re.compile(r"run-\d{6}\.h5", re.ASCII)
MOST_SHOWN = 20


def closed_runs(folder: Path) -> list[tuple[str, int]]:
    """Names and sizes, the newest first."""
    try:
        names = sorted((file.name for file in folder.iterdir() if is_run(file.name)), reverse=True)
        return [(name, (folder / name).lstat().st_size) for name in names[:MOST_SHOWN]]
    except OSError:
        return []


def is_run(name: str) -> bool:
    """Whether a name is that of a closed run; none of them leads to another folder."""
    return _CLOSED.fullmatch(name) is not None


def open_run(folder: Path, name: str) -> tuple[BinaryIO, int] | None:
    """The file and its size; None where it is no closed run or cannot be read."""
    return open_sized(folder / name) if is_run(name) else None


def open_sized(path: Path) -> tuple[BinaryIO, int] | None:
    """A regular file and its size; None for a link, a pipe, or what cannot be read."""
    try:
        file = open_regular(path, follow_links=False)
    except OSError:
        return None
    return file, os.fstat(file.fileno()).st_size
