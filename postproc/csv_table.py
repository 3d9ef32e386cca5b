"""CSV with a header line, row by row."""

import csv
import re
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

from logger.core.errors import RunFileError
from postproc import foreign_file
from postproc.foreign_file import MOST_COLUMNS, Lines

Line = tuple[int, dict[str, str]]

# name of what a row has beyond its columns; its other values are empty, as they may be moved
TOO_MANY = "\0"
_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+")
_MOST_LINES = 10  # of a value: names of cells and networks have one, comments some
_MOST_TITLES = 30  # lines above the header: of drive-test programs some twenty
_FEWEST_NAMES = 3  # of a table with positions and levels; titles have one or two values
_ROW_NUMBER = re.compile(r'"\d+"')


@contextmanager
def text_lines(source: Path) -> Iterator[Lines]:
    """Lines of a text file; raises `RunFileError` if it cannot be read or is no CSV."""
    try:
        with foreign_file.text_lines(source) as lines:
            yield lines
    except csv.Error as error:
        raise RunFileError(
            f"{source} is no CSV file: line {lines.number}: {error}; "
            "is a quotation mark never closed?"
        ) from error


def names_of(header: str) -> list[str]:
    """Column names of a header line, in lower case."""
    return [
        name.strip().lower()
        for name in next(csv.reader([header], delimiter=_delimiter(header)), [])
    ]


def header_of(source: Path, skip: int = 0) -> tuple[int, str]:
    """Number and text of the header line: the first with three names, else with any."""
    first = 0, ""
    with text_lines(source) as lines:
        for line in lines:
            lines.end_row()
            if lines.number <= skip or line.startswith("#") or not line.strip():
                continue
            first = first if first[0] else (lines.number, line)
            if sum(map(bool, names_of(line))) >= _FEWEST_NAMES:
                return lines.number, line
            if lines.number >= _MOST_TITLES:
                break
    return first


def rows(
    source: Path,
    *,
    skip: int = 0,
    required: Iterable[str | Collection[str]] = (),
    header: Sequence[str] = (),
) -> Iterator[Line]:
    """Rows by column name with line numbers.

    `skip` lines come before the header. `required` names columns; of a collection of names one is
    enough. `header` names the columns of a file that has no header line. Raises `RunFileError`
    naming the columns that are missing.
    """
    if header:
        with text_lines(source) as lines:
            yield from _rows_of(source, lines, ",", list(header))
        return
    number, first = header_of(source, skip)
    names = names_of(first)
    _check(source, names, required)
    with text_lines(source) as lines:
        while lines.number < number:
            next(lines)
            lines.end_row()
        yield from _rows_of(source, lines, _delimiter(first), names)


def _rows_of(source: Path, lines: Lines, delimiter: str, header: list[str]) -> Iterator[Line]:
    # of two columns of one name the first counts
    names = [name if name not in header[:i] else f"{name} {i}" for i, name in enumerate(header)]
    known = set(header)
    for number, values in _values_of(lines, delimiter, len(names)):
        if any(value.strip() for value in values):
            if values[0].strip().lower() in known and _is_another(values, header):
                raise RunFileError(
                    f"{source}: line {number} is another header, with other columns: divide the "
                    "file there"
                )
            # a short row lacks its last columns; what it lacks is then empty
            padded = values + [""] * (len(names) - len(values))
            row = {n: v.strip() for n, v in zip(names, padded, strict=False)}
            if any(value.strip() for value in values[len(names) :]):
                row = dict.fromkeys(names, "") | {TOO_MANY: f"{len(values)} values"}
            if delimiter != ",":  # as spreadsheets write numbers in most languages
                row = {n: v.replace(",", ".") if _COMMA.fullmatch(v) else v for n, v in row.items()}
            yield number, row


def _is_another(values: Sequence[str], names: Sequence[str]) -> bool:
    # files that were joined may have their columns in another order
    lower = [value.strip().lower() for value in values]
    return lower != list(names) and len(set(lower) & set(names) - {""}) >= _FEWEST_NAMES


def _values_of(lines: Lines, delimiter: str, n_names: int) -> Iterator[tuple[int, list[str]]]:
    """Values of each row, with the number of its first line.

    Apps write names of networks unquoted, also those with a quotation mark. So where the marks do
    not give a value for each column, even with the next lines, they are text.
    """
    ahead: deque[str] = deque()
    is_numbered: bool | None = None  # by R, between quotation marks, in a column without a name
    while line := ahead.popleft() if ahead else next(lines, ""):
        lines.end_row()
        number = lines.number - len(ahead)
        values = plain = line.rstrip("\r\n").split(delimiter)
        if '"' in line:
            quoted, n_lines = _row([line], delimiter)
            if n_lines > 1 and (len(plain) != n_names or plain[-1].startswith('"')):
                ahead.extend(islice(lines, _MOST_LINES - len(ahead)))
                quoted, n_lines = _row([line, *ahead], delimiter)
            # a last value has lines of its own only where they are no rows
            are_rows = [len(one.split(delimiter)) == n_names for one in islice(ahead, n_lines - 1)]
            is_quoted = len(quoted) == n_names and not any(are_rows)
            if n_lines <= len(ahead) + 1 and (is_quoted or len(plain) != n_names):
                values = quoted
                for _ in range(n_lines - 1):
                    ahead.popleft()
        if is_numbered is None and any(value.strip() for value in values):
            is_numbered = len(values) == n_names + 1 and bool(_ROW_NUMBER.match(line))
        yield number, values[1:] if is_numbered else values


def _row(lines: Sequence[str], delimiter: str) -> tuple[list[str], int]:
    """Values of the row that begins with these lines, and of how many lines it is.

    More than there are where a quotation mark is never closed.
    """
    reader = csv.reader([*lines, ""], delimiter=delimiter)
    return next(reader), reader.line_num


def _delimiter(header: str) -> str:
    return max(",;\t|", key=header.count)


def _check(source: Path, names: list[str], required: Iterable[str | Collection[str]]) -> None:
    if len(names) > MOST_COLUMNS:
        raise RunFileError(f"{source} has more than {MOST_COLUMNS} columns")
    options = [{column} if isinstance(column, str) else set(column) for column in required]
    missing = [" or ".join(sorted(some)) for some in options if not some & set(names)]
    if missing:
        raise RunFileError(f"{source}: the header line has no column {', '.join(missing)}")


_FORMULA = re.compile("'*[=+\\-@\t\r\n]")
"""What a spreadsheet would run: `=cmd|...` in the name of a cell (OWASP, CSV Injection).

It is marked as text by an apostrophe, which spreadsheets do not show. Numbers stay as they are: a
minus before a level is no formula.
"""
_TO_QUOTE = re.compile('[,"\r\n]')
_MARKED = re.compile("'+[=+\\-@\t\r\n]")


def escape(text: str) -> str:
    """Text for a cell, with a mark where it looks like a formula or like marked text."""
    return f"'{text}" if _FORMULA.match(text) else text


def unescape(text: str) -> str:
    """The text that was marked."""
    return text[1:] if _MARKED.match(text) else text


def line(values: Iterable[str]) -> str:
    """A line of CSV (RFC 4180); the csv module leaves a lone CR unquoted and reads two lines."""
    return ",".join(_in_quotes(value) for value in values) + "\n"


def _in_quotes(value: str) -> str:
    doubled = value.replace('"', '""')
    return f'"{doubled}"' if _TO_QUOTE.search(value) else value
