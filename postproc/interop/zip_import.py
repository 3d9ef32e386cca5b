"""The logs of a zip, each made into a run of its own."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from logger.core.errors import FieldLoggerError, RunFileError
from postproc.foreign_file import most_unpacked_bytes
from postproc.interop.importing import Imported, Reading, import_walk

_LONGEST = 60
"""Characters of a name: a file system accepts 255 bytes."""
_UNUSUAL = re.compile(r"[^\w.-]+")


def import_members(
    source: Path, target: Path, sizes: Mapping[str, int], reading: Reading
) -> Iterator[tuple[str, Imported | str]]:
    """Import each file of a zip; yield its name with the result, or with why it is left out.

    The runs are called as `target` with the name of the file: `walk.h5` becomes `walk-monday.h5`.
    Raises `RunFileError` if the files are too large together: they may share their bytes.
    """
    most = most_unpacked_bytes(source.stat().st_size)
    if sum(sizes.values()) > most:
        raise RunFileError(f"{source} unpacks to more than {most >> 20} MB: unpack it yourself")
    for name, path in zip(sizes, _targets(target, list(sizes)), strict=True):
        try:
            yield name, import_walk(source, path, reading=reading, member=name)
        except FieldLoggerError as error:
            yield name, str(error)


def _targets(target: Path, names: list[str]) -> Iterator[Path]:
    """A path beside `target` for each file; a name that comes again gets a number."""
    taken: set[str] = set()
    for name in names:
        stem = _UNUSUAL.sub("-", PurePosixPath(name).stem).strip(".-")[:_LONGEST] or "log"
        free, number = stem, 1
        while free.lower() in taken:
            number += 1
            free = f"{stem}-{number}"
        taken.add(free.lower())
        yield target.with_name(f"{target.stem}-{free}{target.suffix}")
