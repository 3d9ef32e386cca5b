"""Files of other programs: how much of one is read, and its lines within these limits.

A file may lie about everything. Whatever it claims is bounded by its own size, by what is left of
it, or by a limit that stands here; docs/guide/formats.md lists them.
"""

import codecs
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from gzip import GzipFile
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import TypeVar

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from postproc.progress import with_count

LONGEST_ITEM = 4 << 20
"""Bytes of a line, a row, an element of XML or an object of JSON: parsed, it takes 30 times that.

A track of 100,000 points in one element of KML is shorter."""
MOST_COLUMNS = 2000  # as many as a table of SQLite has
MOST_DEPTH = 100  # elements of XML within each other; a log has ten
MOST_ROWS = 200_000_000
"""Of any kind, in one file: OpenCelliD lists 50 million cells."""
MOST_READINGS = 3_000_000
"""Of one run: more than a year of daily walks."""
MOST_BAD_ROWS = 10_000
"""Of those that an import lists; further ones are counted."""
MOST_REMARKS = 100_000
"""Of another program, each of which becomes a note."""
MOST_TILE_PIXELS = 1024  # along a side; tiles have 256 or 512
MOST_TILE_BYTES = 4 << 20
"""Of one tile, unpacked; a dense city in a vector tile has one megabyte."""
MOST_DIRECTORY_BYTES = 2 << 20
"""Of a directory of PMTiles, unpacked: half a million entries; writers make some thousand."""
MOST_MEMBERS = 500
"""Files of a zip: more logs than anybody walks in a year."""
_MOST_UNPACKED = 2 << 30
"""A year of walks is smaller; what unpacks to more was made to fill a disk."""
_SMALL_BYTES = 64 << 20
_MOST_PACKED = 100
"""Times that a large file may be packed: a log is packed 5 to 20 times, zeros are 1000 times."""

# how Excel's "Unicode Text" begins, and what Windows writes by `>`
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_HEAD_BYTES = 8192  # a line of names is shorter, and files buffer as much
# GBK, as a spreadsheet in China writes: a sign has two such bytes; letters of western Europe have
# one, and seldom stand in pairs alone
_CHINESE = re.compile(rb"(?:[\0-\x7f]*[\xa1-\xf7][\xa1-\xfe]){4,}[\0-\x7f]*")
# what a spreadsheet writes in Russia: words of such letters alone, most of them small; a word that
# may be taken in pieces (+ for ++) takes ages of a damaged file
_RUSSIAN = re.compile(
    rb"(?:[^a-zA-Z\x80-\xff]|[a-zA-Z]++(?![\x80-\xff])|[\xa8\xb8\xb9\xc0-\xff]++(?![a-zA-Z]))+"
)
_RUSSIAN_WORD = re.compile(rb"[\xa8\xb8\xc0-\xff]{4}")
_LARGE, _SMALL = bytes(range(0xC0, 0xE0)), bytes(range(0xE0, 0x100))
# and in Poland: a mark or a French letter among others is there a letter, as in szerokość
_POLISH = re.compile(rb"[a-zA-Z](?:\xb3[a-z]|\x9c\xe6)")
# what programs for Windows write without saying so
_UNMARKED = {
    "utf-16-le": re.compile(rb"(?:[\t\r\n -~]\0){3}"),
    "utf-16-be": re.compile(rb"(?:\0[\t\r\n -~]){3}"),
}
# a first line that Excel writes and reads: no row, and the header shows the separator as well
_SEPARATOR = re.compile(r"sep=.?[\r\n]*")
_SEPARATOR_LINE = re.compile(rb"\Asep=[^\r\n]?[\r\n]+")

Item = TypeVar("Item")


def most_unpacked_bytes(packed_bytes: int) -> int:
    """What a compressed file, or all files of a zip together, may unpack to."""
    return min(_SMALL_BYTES + _MOST_PACKED * packed_bytes, _MOST_UNPACKED)


def encoding_of(head: bytes) -> str:
    """Encoding of a text by its first bytes."""
    if head.startswith(_UTF16):
        return "utf-16"
    for name, begins in _UNMARKED.items():
        if begins.match(head):
            return name
    line = _SEPARATOR_LINE.sub(b"", head, 1).partition(b"\n")[0]
    if line.decode("utf-8", "ignore").encode() == line:
        return "utf-8-sig"
    if _is_russian(line):
        return "cp1251"
    if _CHINESE.fullmatch(line):
        return "gb18030"
    return "cp1250" if _POLISH.search(line) else "utf-8-sig"


def _is_russian(line: bytes) -> bool:
    # the first of two bytes of a common Chinese sign is no small letter
    n_large, n_small = (len(line) - len(line.translate(None, some)) for some in (_LARGE, _SMALL))
    has_case = n_small >= n_large or not n_small
    return has_case and bool(_RUSSIAN_WORD.search(line) and _RUSSIAN.fullmatch(line))


def _as_windows(error: UnicodeError) -> tuple[str, int]:
    # a spreadsheet in western Europe writes cp1252 where it is not told to write UTF-8
    if not isinstance(error, UnicodeDecodeError) or error.encoding != "utf-8":
        return codecs.replace_errors(error)  # type: ignore[return-value]
    return error.object[error.start : error.end].decode("cp1252", "replace"), error.end


codecs.register_error("as-windows", _as_windows)


def open_text(file: BufferedReader | GzipFile, newline: str | None = None) -> TextIOWrapper:
    """Its text, with marks for what is none."""
    return TextIOWrapper(file, encoding_of(file.peek(_HEAD_BYTES)), "as-windows", newline=newline)


class Lines(Iterator[str]):
    """Lines of a text file; those that a reader joins to one row are bounded together.

    `next` raises `RunFileError` for a longer row.
    """

    def __init__(self, file: BufferedReader | GzipFile, source: Path) -> None:
        self._text = open_text(file, newline="")
        self._source = source
        self._taken = 0
        self.number = 0

    def __next__(self) -> str:
        line = self._text.readline(LONGEST_ITEM)
        if self.number == 0 and _SEPARATOR.fullmatch(line):
            self.number += 1
            line = self._text.readline(LONGEST_ITEM)
        if not line:
            raise StopIteration
        self._taken += len(line)
        self.number += 1
        if self._taken >= LONGEST_ITEM:
            raise RunFileError(
                f"{self._source}: line {self.number}: a row has more than {LONGEST_ITEM >> 20} MB"
            )
        if self.number > MOST_ROWS:
            raise RunFileError(f"{self._source} has more than {MOST_ROWS:,} lines: divide it")
        return line

    def end_row(self) -> None:
        """What follows belongs to the next row."""
        self._taken = 0


@contextmanager
def text_lines(source: Path) -> Iterator[Lines]:
    """Lines of a text file; raises `RunFileError` if it cannot be read."""
    try:
        with open_regular(source) as file:
            yield Lines(file, source)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror or error}") from error


def with_limit(
    items: Iterable[Item], source: Path, what: str, most: int = MOST_ROWS
) -> Iterator[Item]:
    """Pass items on, and show how many have come.

    Raises `RunFileError` for more than `most`.
    """
    for n, item in enumerate(with_count(items, f"{source.name}: {what}"), 1):
        if n > most:
            raise RunFileError(
                f"{source} has more than {most:,} {what}: divide it into several files"
            )
        yield item
