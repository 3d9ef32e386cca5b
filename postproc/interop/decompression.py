"""Compressed files as the file that is in them."""

import gzip
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from logger.core.errors import RunFileError

MOST_BYTES = 2 * 1024**3
"""A year of walks is smaller; what unpacks to more was made to fill a disk."""
MOST_MEMBERS = 500
"""More logs than anybody walks in a year."""
_GZIP = b"\x1f\x8b"
_ZIP = b"PK\x03\x04"
_CHUNK = 1 << 20


def members(source: Path) -> list[str]:
    """Names of the files in a zip, in their order; empty for any other file.

    Raises `RunFileError` for a zip that is damaged or has more than `MOST_MEMBERS` files.
    """
    if not _head(source).startswith(_ZIP):
        return []
    try:
        with zipfile.ZipFile(source) as archive:
            names = [one.filename for one in _files_of(archive)]
    except (OSError, zipfile.BadZipFile) as error:
        raise RunFileError(f"{source} cannot be unpacked: {error}") from error
    if len(names) > MOST_MEMBERS:
        raise RunFileError(f"{source} has {len(names)} files: unpack it and import some of them")
    return names


def _files_of(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """What is no folder and no note of macOS about a file."""
    return [
        one
        for one in archive.infolist()
        if not one.is_dir() and not one.filename.startswith("__MACOSX/")
    ]


@contextmanager
def plain_file(source: Path, member: str | None = None) -> Iterator[Path]:
    """The file itself, or a temporary copy of what is in a gzip file or of one file of a zip.

    Without `member` the zip has to contain one file. Raises `RunFileError` for what cannot be read
    or unpacked; errors raised meanwhile name the file and not the copy.
    """
    head = _head(source)
    if not head.startswith((_GZIP, _ZIP)):
        yield source
        return
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "unpacked"
        try:
            with _open_archive(source, head, member) as packed, copy.open("wb") as plain:
                _copy(packed, plain, source)
        except (
            OSError,
            EOFError,
            zlib.error,
            zipfile.BadZipFile,
            NotImplementedError,
            RuntimeError,
            KeyError,
        ) as error:
            raise RunFileError(f"{source} cannot be unpacked: {error}") from error
        try:
            yield copy
        except RunFileError as error:
            raise RunFileError(str(error).replace(str(copy), str(source))) from error


def _head(source: Path) -> bytes:
    try:
        with source.open("rb") as file:
            return file.read(4)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error


@contextmanager
def _open_archive(
    source: Path, head: bytes, member: str | None
) -> Iterator[IO[bytes] | gzip.GzipFile]:
    if head.startswith(_GZIP):
        with gzip.open(source, "rb") as file:
            yield file
        return
    with zipfile.ZipFile(source) as archive:
        files = _files_of(archive)
        if member is None and len(files) != 1:
            raise RunFileError(f"{source} is a zip of {len(files)} files: unpack it, or name one")
        with archive.open(files[0] if member is None else member) as file:
            yield file


def _copy(packed: IO[bytes] | gzip.GzipFile, plain: IO[bytes], source: Path) -> None:
    size = 0
    while chunk := packed.read(_CHUNK):
        size += len(chunk)
        if size > MOST_BYTES:
            raise RunFileError(f"{source} unpacks to more than {MOST_BYTES >> 30} GB")
        plain.write(chunk)
