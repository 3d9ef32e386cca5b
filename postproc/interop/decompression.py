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
_GZIP = b"\x1f\x8b"
_ZIP = b"PK\x03\x04"
_CHUNK = 1 << 20


@contextmanager
def plain_file(source: Path) -> Iterator[Path]:
    """The file itself, or a temporary copy of the content of a gzip file or of a zip of one file.

    Raises `RunFileError` for what cannot be read or unpacked; errors raised meanwhile name the file
    and not the copy.
    """
    head = _head(source)
    if not head.startswith((_GZIP, _ZIP)):
        yield source
        return
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "unpacked"
        try:
            with _open_archive(source, head) as packed, copy.open("wb") as plain:
                _copy(packed, plain, source)
        except (
            OSError,
            EOFError,
            zlib.error,
            zipfile.BadZipFile,
            NotImplementedError,
            RuntimeError,
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
def _open_archive(source: Path, head: bytes) -> Iterator[IO[bytes] | gzip.GzipFile]:
    if head.startswith(_GZIP):
        with gzip.open(source, "rb") as file:
            yield file
        return
    with zipfile.ZipFile(source) as archive:
        names = [
            one
            for one in archive.infolist()
            if not one.is_dir() and not one.filename.startswith("__MACOSX/")
        ]
        if len(names) != 1:
            raise RunFileError(
                f"{source} is a zip of {len(names)} files: unpack it and import one of them"
            )
        with archive.open(names[0]) as file:
            yield file


def _copy(packed: IO[bytes] | gzip.GzipFile, plain: IO[bytes], source: Path) -> None:
    size = 0
    while chunk := packed.read(_CHUNK):
        size += len(chunk)
        if size > MOST_BYTES:
            raise RunFileError(f"{source} unpacks to more than {MOST_BYTES >> 30} GB")
        plain.write(chunk)
