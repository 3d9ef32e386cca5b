"""Compressed files as the file that is in them."""

import errno
import gzip
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from logger.drivers.diag.frames import is_stream
from postproc.foreign_file import MOST_MEMBERS, most_unpacked_bytes
from postproc.progress import with_count

_GZIP = b"\x1f\x8b"
_ZIP = b"PK\x03\x04"
_CHUNK = 1 << 20
_PACKINGS = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
"""Those of every zip program; of the others zipfile unpacks a block of any size at once."""
_DAMAGE = (
    EOFError,
    zlib.error,
    zipfile.BadZipFile,
    NotImplementedError,
    RuntimeError,
    KeyError,
    ValueError,
)


def members(source: Path) -> dict[str, int]:
    """Names of the files in a zip, in their order, and their sizes; empty for any other file.

    Raises `RunFileError` for a zip that is damaged, has more than `MOST_MEMBERS` files or one name
    twice.
    """
    if not _head(source).startswith(_ZIP):
        return {}
    try:
        with _open_zip(source) as archive:
            files = _files_of(archive)
    except (OSError, *_DAMAGE) as error:
        raise _not_unpacked(source, error) from error
    sizes = {one.filename: one.file_size for one in files}
    if len(files) > MOST_MEMBERS:
        raise RunFileError(f"{source} has {len(files)} files: unpack it and import some of them")
    if len(sizes) < len(files):
        raise RunFileError(f"{source} has two files of one name: unpack it")
    return sizes


@contextmanager
def _open_zip(source: Path) -> Iterator[zipfile.ZipFile]:
    with _ZipSource(open_regular(source).detach()) as file, zipfile.ZipFile(file) as archive:
        yield archive


class _ZipSource(BufferedReader):
    """Reads the table of contents of a zip at once, whatever length it claims."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _CHUNK:
            raise zipfile.BadZipFile(f"its table of contents has more than {_CHUNK >> 20} MB")
        return super().read(size)


def _files_of(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    entries = archive.infolist()
    if not all(one.filename for one in entries):
        raise zipfile.BadZipFile("one of its files has no name")
    return [one for one in entries if not one.is_dir() and not one.filename.startswith("__MACOSX/")]


@contextmanager
def plain_file(source: Path, member: str | None = None) -> Iterator[Path]:
    """The file itself, or a temporary copy of what is in a gzip file or of one file of a zip.

    Without `member` the zip has to contain one file. Of a modem's recording that was cut while it
    was packed the beginning counts. Raises `RunFileError` for what cannot be read or unpacked;
    errors raised meanwhile name the file and not the copy.
    """
    head = _head(source)
    if not head.startswith((_GZIP, _ZIP)):
        yield source
        return
    with TemporaryDirectory() as folder:
        copy = Path(folder) / source.name
        try:
            with _open_archive(source, head, member) as read, copy.open("wb") as plain:
                for chunk in with_count(_chunks(read, source), f"{source.name}: unpacking MB"):
                    plain.write(chunk)
        except (OSError, *_DAMAGE) as error:
            if not (isinstance(error, EOFError) and is_stream(_head(copy, _CHUNK))):
                raise _not_unpacked(source, error) from error
        try:
            yield copy
        except RunFileError as error:
            raise RunFileError(str(error).replace(str(copy), str(source))) from error


def _not_unpacked(source: Path, error: Exception) -> RunFileError:
    reason = (isinstance(error, OSError) and error.strerror) or error
    if isinstance(error, OSError) and error.errno in {errno.ENOSPC, errno.EDQUOT}:
        reason = f"no space is left in {gettempdir()}; TMPDIR names another folder"
    if isinstance(error, EOFError) or str(error) == "File is not a zip file":
        reason = "its end is missing: download or copy it again"
    return RunFileError(f"{source} cannot be unpacked: {reason}")


def _head(source: Path, n_bytes: int = 4) -> bytes:
    try:
        with open_regular(source) as file:
            return file.read(n_bytes)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error


@contextmanager
def _open_archive(
    source: Path, head: bytes, member: str | None
) -> Iterator[Callable[[int], bytes]]:
    if head.startswith(_GZIP):
        with open_regular(source) as packed, gzip.GzipFile(fileobj=packed) as file:
            yield file.read1  # of a file that was cut it gives what there is
        return
    with _open_zip(source) as archive:
        files = _files_of(archive)
        if member is None and len(files) != 1:
            raise RunFileError(f"{source} is a zip of {len(files)} files: unpack it, or name one")
        chosen = files[0] if member is None else archive.getinfo(member)
        if chosen.compress_type not in _PACKINGS:
            raise RunFileError(f"{source} is not packed by deflate: unpack it")
        with archive.open(chosen) as member_file:
            yield member_file.read


def _chunks(read: Callable[[int], bytes], source: Path) -> Iterator[bytes]:
    size, most = 0, most_unpacked_bytes(source.stat().st_size)
    while chunk := read(_CHUNK):
        size += len(chunk)
        if size > most:
            raise RunFileError(
                f"{source} unpacks to more than {most >> 20} MB, which no log of its size does"
            )
        yield chunk
