"""JSON objects, one a line, or all in one list."""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TextIO

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from postproc.foreign_file import LONGEST_ITEM, open_text, text_lines
from postproc.interop.sighting import BadRow, Parsed, Row, parse_rows

Object = tuple[int, dict[str, Any]]

_CHUNK = 1 << 16
_BETWEEN = re.compile(r"[\s,]*")
_DECODER = json.JSONDecoder()


def objects(source: Path, list_after: str = "") -> Iterator[Object | BadRow]:
    """Objects with their number from 1; a line that is no object is a `BadRow`.

    `list_after` is a regular expression. Raises `RunFileError` for a file that cannot be read, and
    for a list that is no JSON.
    """
    if list_after:
        yield from _objects_of_list(source, list_after)
        return
    with text_lines(source) as lines:
        for line in lines:
            if lines.number == 1 and line.startswith("["):
                break
            lines.end_row()
            if line.strip():
                yield _object(lines.number, line)
        else:
            return
    yield from _objects_of_list(source, r"\[")


def named_values(fields: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, str]]:
    """Values of an object and of those within it as texts, each by the names on its way."""
    for key, value in fields.items():
        name = f"{within} {key}".strip().lower()
        if key == "geometry" and isinstance(value, dict):  # GeoJSON begins with the longitude
            at = value.get("coordinates") if value.get("type") == "Point" else None
            yield name, f"POINT({' '.join(map(str, at))})" if isinstance(at, list) else ""
        elif isinstance(value, dict):
            yield from named_values(value, "" if key == "properties" else name)
        else:
            yield name, "" if value is None or isinstance(value, list) else str(value)


def _objects_of_list(source: Path, start: str) -> Iterator[Object | BadRow]:
    """Objects of the list that follows a regular expression in the head of a file.

    Raises `RunFileError` for a file that cannot be read or has no such list.
    """
    try:
        with open_text(open_regular(source)) as file:
            for number, value in enumerate(_values(start, file), 1):
                if isinstance(value, dict):
                    yield number, value
                else:
                    yield BadRow(number, "it is no JSON object")
    except (OSError, ValueError, RecursionError) as error:
        raise RunFileError(f"{source} is no JSON file: {error}") from error


def _values(start: str, file: TextIO) -> Iterator[object]:
    """Values of a list, each decoded by itself; raises ValueError."""
    text = file.read(_CHUNK)
    found = re.search(start, text)
    if found is None:
        raise ValueError(f"it has no list after {start}")
    at = found.end()
    while True:
        at = _between(text, at)
        try:
            if text.startswith("]", at):
                return
            value, end = _DECODER.raw_decode(text, at)
            is_whole = end < len(text)  # of a number more digits may follow
        except json.JSONDecodeError:
            is_whole = False
        if is_whole:
            yield value
            at = end
            continue
        text = text[at:]
        if len(text) > LONGEST_ITEM:
            raise ValueError(f"an object has more than {LONGEST_ITEM >> 20} MB, or is no JSON")
        # as much again: what is decoded once more has doubled
        more = file.read(max(len(text), _CHUNK))
        if not more:
            raise ValueError("the list has no end")
        text, at = text + more, 0


def _between(text: str, at: int) -> int:
    found = _BETWEEN.match(text, at)
    return found.end() if found else at


def _object(number: int, line: str) -> Object | BadRow:
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return BadRow(number, "it is no JSON")
    return (number, value) if isinstance(value, dict) else BadRow(number, "it is no JSON object")


def parse_objects(
    source: Path, parse: Callable[[int, dict[str, Any]], Parsed], list_after: str = ""
) -> Iterator[Row]:
    """Rows of all objects; `parse` as for `parse_rows`. Raises as `objects`."""
    return parse_rows(objects(source, list_after), parse)
