"""What a file looks like from outside, packed or not, and the formats that are known by it."""

import errno
import gzip
import re
import sqlite3
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from typing import Literal

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from logger.core.runfile.frames import MAGIC as JOURNAL_MAGIC
from logger.drivers.diag.frames import is_stream
from logger.sqlite_file import SQLITE_MAGIC, open_database
from postproc import csv_table
from postproc.foreign_file import MOST_MEMBERS, encoding_of, most_unpacked_bytes
from postproc.interop.sighting import Columns, Row, parse_rows
from postproc.progress import with_count

Kind = Literal["tables", "xml", "json", "text", "diag", "packets"]

_HDF5 = b"\x89HDF\r\n\x1a\n"
_KINDS = {
    b"%PDF": "a PDF document",
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"PAR1": "a Parquet table",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (save its sheet as CSV)",
    b"7z\xbc\xaf": "a file packed by 7-Zip (unpack it)",
    b"Rar!": "a file packed by RAR (unpack it)",
    b"\xfd7zXZ": "a file packed by xz (unpack it)",
    b"BZh": "a file packed by bzip2 (unpack it)",
    b"\x28\xb5\x2f\xfd": "a file packed by zstd (unpack it)",
    b"\x7fELF": "a program",
    b"PK\x05\x06": "an empty zip",
    b"PK": "a zip within a compressed file",
    b"\x1f\x8b": "a compressed file within another",
}
PACKETS = (b"\x0a\x0d\x0d\x0a", b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1")
"""How pcapng begins, then pcap with little and big-endian numbers and with nanoseconds."""
_HEAD_BYTES = 65_536
"""Holds the first objects of any JSON and the root of any XML."""
_KEY = re.compile(r'"(\w{1,60})"\s*:')
_ROOT = re.compile(r"<(?!\?|!)(?:[\w.-]+:)?([\w.-]+)")
_MOST_SHOWN = 60
_MOST_NAMES = 8


@dataclass(frozen=True, slots=True)
class Contents:
    """`names` in lower case: tables of SQLite, the root of XML, keys of JSON, columns of a text.

    `words` states the same for a reader of an error message.
    """

    kind: Kind
    names: frozenset[str]
    head: str
    words: str

    def has(self, *names: str) -> bool:
        """Whether the file has all these names."""
        return self.names.issuperset(names)


@dataclass(frozen=True, slots=True)
class Format:
    """A format that can be imported, how it is recognised, and what it calls its times.

    Without a name of times only the order of the rows counts. With `has_scans`, rows that follow
    each other at one time are one scan. What `is_general` comes after all others. Apps repeat
    measurements when they export again, except `unrepeated` formats. Rows of a modem's `capture`
    have its clock and need no position.
    """

    name: str
    read: Callable[[Path], Iterator[Row]]
    times: str
    is_it: Callable[[Contents], bool]
    has_scans: bool = False
    is_general: bool = False
    unrepeated: bool = False
    capture: bool = False


def of_columns(
    name: str,
    columns: Columns,
    required: Collection[str | Collection[str]],
    *,
    times: str,
    known_by: Collection[str] = (),
    has_scans: bool = False,
) -> Format:
    """A table of text that is recognised by the columns `known_by`, by default those `required`.

    Of a collection of names in `required` one is enough.
    """

    def read(source: Path) -> Iterator[Row]:
        yield from parse_rows(csv_table.rows(source, required=required), columns.sighting)

    marks = known_by or [one for one in required if isinstance(one, str)]
    return Format(
        name, read, times, lambda seen: seen.kind == "text" and seen.has(*marks), has_scans
    )


def of_json(*keys: str) -> Callable[[Contents], bool]:
    """Whether a file is JSON with these keys."""
    return lambda seen: seen.kind == "json" and seen.has(*keys)


def look_at(source: Path) -> Contents:
    """What is in a file; raises `RunFileError` for one that holds no log whatever is in it."""
    try:
        with open_regular(source) as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if head.startswith(SQLITE_MAGIC):
        return _tables(source)
    if head.startswith(_HDF5):
        raise RunFileError(f"{source} is HDF5: a run needs no import")
    if head.startswith(JOURNAL_MAGIC):
        raise RunFileError(f"{source} is the journal of a run, which needs no import")
    if head.startswith(PACKETS):
        return Contents("packets", frozenset(), "", "network packets")
    if is_stream(head):
        return Contents("diag", frozenset(), "", "Qualcomm's diagnostic stream")
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")
    text = head.decode(encoding_of(head), "replace").lstrip()
    # what a power cut left at the end of a text is zeros; the first line of one has none
    if not text or "\0" in text.splitlines()[0] or start.startswith(tuple(_KINDS)):
        raise unknown_format(source, _kind_of(start))
    if text.startswith("<"):
        return _xml(source, text)
    if text.startswith(("{", "[")):
        keys = list(dict.fromkeys(_KEY.findall(text)))
        kind = "a JSON list" if text.startswith("[") else "JSON"
        return Contents("json", _lower(keys), text, f"{kind} with the keys {_list_of(keys)}")
    return _text(source)


_HOW: dict[Kind | None, str] = {
    "tables": "a table of it (sqlite3 -csv -header FILE 'SELECT * FROM TABLE' > table.csv)",
    "json": "its values as a table (CSV with a line of column names)",
    "xml": "its values as a table (CSV with a line of column names)",
    "text": "any table",
    None: "any table of text (CSV with a line of column names)",
}


def unknown_format(source: Path, words: str, kind: Kind | None = None) -> RunFileError:
    """The error for a file that no format fits, with what makes it one that can be read."""
    return RunFileError(
        f"{source}: unknown format; I read {words}. docs/guide/formats.md lists the known ones; "
        f"{_HOW[kind]} with positions and levels can be read with --columns "
        "lat=...,lon=...,level=..."
    )


def _tables(source: Path) -> Contents:
    try:
        with open_database(source) as database:
            query = "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name LIMIT 1000"
            tables = [str(name) for (name,) in database.execute(query)]
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is a damaged SQLite file: {error}") from error
    return Contents("tables", _lower(tables), "", f"SQLite with the tables {_list_of(tables)}")


def _xml(source: Path, text: str) -> Contents:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise unknown_format(source, "XML or HTML with a document type, which no log has")
    root = _ROOT.search(text)
    name = root[1] if root else ""
    return Contents(
        "xml", frozenset({name.lower()}), text, f"XML or HTML that begins with <{name}>"
    )


def _text(source: Path) -> Contents:
    _, header = csv_table.header_of(source)
    columns = csv_table.names_of(header)
    if len(columns) > 1:
        words = f"a table with the columns {_short(', '.join(columns))}"
    else:
        words = f"text that begins with {_short(header.strip())!r}"
    return Contents("text", frozenset(columns), header, words)


def _kind_of(head: bytes) -> str:
    if not head:
        return "an empty file"
    for magic, kind in _KINDS.items():
        if head.startswith(magic):
            return kind
    return f"a binary file that begins with {head[:8].hex(' ')}"


def _lower(names: list[str]) -> frozenset[str]:
    return frozenset(name.lower() for name in names)


def _list_of(names: list[str]) -> str:
    return ", ".join(names[:_MOST_NAMES]) or "none"


def _short(text: str) -> str:
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


# --- packed files ---

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
    if "[Content_Types].xml" in sizes:
        raise unknown_format(source, "an Excel workbook (save its sheet as CSV)")
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
    # a member that reaches into the table of contents overlaps it (Python 3.11.8 and later)
    cut = ("File is not a zip file", "Overlapped entries")
    if isinstance(error, EOFError) or str(error).startswith(cut):
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
