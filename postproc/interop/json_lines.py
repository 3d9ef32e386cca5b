"""JSON objects, one a line, or all in one list."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from logger.core.errors import RunFileError
from postproc.interop.sighting import BadRow, Parsed, Row, parse_rows

Object = tuple[int, dict[str, Any]]


def objects(source: Path) -> Iterator[Object | BadRow]:
    """Objects with their number from 1; a line that is no object is a `BadRow`.

    Raises `RunFileError` for a file that cannot be read, and for a list that is no JSON.
    """
    try:
        with source.open(encoding="utf-8-sig", errors="replace") as file:
            start = file.read(1)
            file.seek(0)
            if start == "[":
                yield from _objects_of_list(json.load(file))
                return
            for number, line in enumerate(file, 1):
                if line.strip():
                    yield _object(number, line)
    except (OSError, ValueError, RecursionError) as error:
        raise RunFileError(f"{source} is no JSON file: {error}") from error


def _objects_of_list(values: list[object]) -> Iterator[Object | BadRow]:
    for number, value in enumerate(values, 1):
        if isinstance(value, dict):
            yield number, value
        else:
            yield BadRow(number, "it is no JSON object")


def _object(number: int, line: str) -> Object | BadRow:
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return BadRow(number, "it is no JSON")
    return (number, value) if isinstance(value, dict) else BadRow(number, "it is no JSON object")


def parse_objects(source: Path, parse: Callable[[int, dict[str, Any]], Parsed]) -> Iterator[Row]:
    """Rows of all objects; `parse` as for `parse_rows`. Raises as `objects`."""
    for entry in objects(source):
        if isinstance(entry, BadRow):
            yield entry
        else:
            yield from parse_rows([entry], parse)
