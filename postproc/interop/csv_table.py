"""CSV with a header line, row by row."""

import csv
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from logger.core.errors import RunFileError
from postproc import foreign_file
from postproc.foreign_file import MOST_COLUMNS, Lines

Line = tuple[int, dict[str, str]]


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


def rows(
    source: Path,
    *,
    skip: int = 0,
    required: Iterable[str | Collection[str]] = (),
    header: Sequence[str] = (),
) -> Iterator[Line]:
    """Rows by column name with line numbers; lines with # before the header are comments.

    `skip` lines come before the header. `required` names columns; of a collection of names one is
    enough. `header` names the columns of a file that has no header line. Raises `RunFileError`
    naming the columns that are missing.
    """
    if header:
        with text_lines(source) as lines:
            yield from _rows_of(lines, ",", list(header))
        return
    with text_lines(source) as lines:
        first = ""
        for first in lines:
            lines.end_row()
            if lines.number > skip and not first.startswith("#"):
                break
        else:
            first = ""
        names = names_of(first)
        _check(source, names, required)
        yield from _rows_of(lines, _delimiter(first), names)


def _rows_of(lines: Lines, delimiter: str, names: list[str]) -> Iterator[Line]:
    for line in lines:
        lines.end_row()
        values = _values(line.rstrip("\r\n"), delimiter, len(names))
        if any(value.strip() for value in values):
            # a short row lacks its last columns; what it lacks is then empty
            padded = values + [""] * (len(names) - len(values))
            yield lines.number, {n: v.strip() for n, v in zip(names, padded, strict=False)}


def _values(line: str, delimiter: str, n_names: int) -> list[str]:
    """Values of a row, which is one line: a mark that is never closed must not take others in.

    Apps write names of networks as they are, also those with a quotation mark, so where the marks
    do not give a value for each column they are text.
    """
    plain = line.split(delimiter)
    if '"' not in line:
        return plain
    quoted = next(csv.reader([line], delimiter=delimiter), [])
    return plain if len(plain) == n_names != len(quoted) else quoted


def _delimiter(header: str) -> str:
    return max(",;\t|", key=header.count)


def _check(source: Path, names: list[str], required: Iterable[str | Collection[str]]) -> None:
    if len(names) > MOST_COLUMNS:
        raise RunFileError(f"{source} has more than {MOST_COLUMNS} columns")
    options = [{column} if isinstance(column, str) else set(column) for column in required]
    missing = [" or ".join(sorted(some)) for some in options if not some & set(names)]
    if missing:
        raise RunFileError(f"{source}: the header line has no column {', '.join(missing)}")
