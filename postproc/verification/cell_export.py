"""Cell exports of OpenCelliD and Mozilla Location Service, row by row.

Fourteen columns, longitude before latitude, the same in both: radio, mcc, net, area, cell, unit,
lon, lat, range, samples, changeable, created, updated, averageSignal. The world file and all of
Mozilla's have that header line, country files have none; lines end in LF or CRLF; any may be
gzipped. Where there is a header its names count, not its order. Source: mozilla/ichnaea,
docs/import_export.rst, and wiki.opencellid.org, Menu map view.
"""

import csv
import gzip
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BufferedReader
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from logger.core.errors import RunFileError
from logger.core.foreign import check_regular, open_regular
from postproc.foreign_file import Lines

COLUMNS = (
    "radio", "mcc", "net", "area", "cell", "unit", "lon", "lat", "range",
    "samples", "changeable", "created", "updated", "averageSignal",
)  # fmt: skip
"""Layout of a file without header."""
NEEDED = ("radio", "mcc", "net", "area", "cell", "lon", "lat")

_GZIP = b"\x1f\x8b"


class Export(NamedTuple):
    """Rows of text, the index of each known column, and the share of the file read so far."""

    rows: Iterator[list[str]]
    column: dict[str, int]
    width: int
    read_share: Callable[[], float]


@contextmanager
def cell_export(path: Path) -> Iterator[Export]:
    """Open an export.

    Raises `RunFileError` for a file that cannot be read, is damaged, or is no such export.
    """
    try:
        with open_regular(path) as raw:
            size = max(check_regular(path), 1)
            lines = _lines(raw, path)  # held here: it closes the file when it goes
            yield _export(lines, path, lambda: raw.tell() / size)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RunFileError(f"{path}: the compressed file is damaged or cut: {error}") from error
    except OSError as error:
        raise RunFileError(f"{path}: {error.strerror or error}") from error
    except csv.Error as error:
        raise RunFileError(f"{path} is no CSV file: {error}") from error


def _lines(raw: BufferedReader, path: Path) -> Lines:
    packed = raw.peek(2).startswith(_GZIP)
    return Lines(gzip.GzipFile(fileobj=raw) if packed else raw, path)


def _rows(lines: Lines) -> Iterator[list[str]]:
    for row in csv.reader(lines):
        lines.end_row()
        yield row


def _export(lines: Lines, path: Path, read_share: Callable[[], float]) -> Export:
    rows = _rows(lines)
    first = next(rows, None)
    if first is None:
        raise RunFileError(f"{path} is empty")
    names = [name.strip() for name in first]
    if "radio" not in names:
        if len(first) != len(COLUMNS):
            raise RunFileError(
                f"{path} is no cell export: it has {len(first)} columns and no header line"
            )
        return Export(
            chain([first], rows),
            {name: i for i, name in enumerate(COLUMNS)},
            len(COLUMNS),
            read_share,
        )
    if missing := [name for name in NEEDED if name not in names]:
        raise RunFileError(f"{path}: the header line has no column {', '.join(missing)}")
    return Export(
        rows, {name: names.index(name) for name in COLUMNS if name in names}, len(names), read_share
    )
