"""Streets of a file: lines of GeoJSON, or tracks and routes of GPX.

The recorder, which may use little memory, reads the untrusted file part by part and keeps only the
points of lines, 16 bytes each.
"""

import re
from array import array
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from xml.parsers import expat

from logger.core.errors import ConfigError, GeoError
from logger.core.foreign import check_regular, open_regular
from logger.core.guidance.street_atlas import Line
from logger.core.places import check_position

MOST_BYTES, MOST_POINTS = 32 << 20, 500_000
"""The streets of a city of 20 x 20 km. Reading them takes 2 s on a desktop."""
_DEEPEST = 64
"""Levels of brackets or elements; lines need about ten."""
_PART_BYTES, _LONGEST_BYTES = 1 << 16, 1 << 18
"""What is read at once, and the longest text, tag or comment."""


class StreetLines:
    """Lines as numbers one after the other; each line is made when it is asked for."""

    def __init__(self) -> None:
        self._deg = array("d")
        self._ends = array("L", [0])

    def __len__(self) -> int:
        return len(self._ends) - 1

    def __iter__(self) -> Iterator[Line]:
        for start, end in pairwise(self._ends):
            deg = self._deg[2 * start : 2 * end]
            yield list(zip(deg[::2], deg[1::2], strict=True))

    @property
    def n_points(self) -> int:
        """Number of points of all lines."""
        return self._ends[-1]

    def add(self, points: Iterable[tuple[float, float]]) -> None:
        """Take the next points of a line."""
        for point in points:
            check_position(*point)
            self._deg.extend(point)
        if len(self._deg) > 2 * MOST_POINTS:
            raise _TooLargeError

    def end_line(self) -> None:
        """What follows belongs to another line; a single point is none."""
        n_points = len(self._deg) // 2
        if n_points > self._ends[-1] + 1:
            self._ends.append(n_points)
        del self._deg[2 * self._ends[-1] :]

    def cut(self, n_lines: int) -> None:
        """Forget all lines but the first ones."""
        del self._ends[n_lines + 1 :]
        del self._deg[2 * self._ends[-1] :]


def read_lines(path: Path) -> StreetLines:
    """Read the lines of a street file as (latitude, longitude) in degrees.

    Raises `ConfigError` for a file that is neither GeoJSON nor GPX, has no line, or is too large.
    """
    lines = StreetLines()
    try:
        _read(_parts(path), lines)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except _TooLargeError:
        raise ConfigError(
            f"{path} is too large: streets may have at most {MOST_BYTES >> 20} MB and "
            f"{MOST_POINTS} points; cut out a part of the city"
        ) from None
    except (ValueError, LookupError, expat.ExpatError, GeoError) as error:
        raise ConfigError(f"{path} is neither GeoJSON nor GPX with lines: {error}") from error
    if not len(lines):
        raise ConfigError(f"{path} has no line: streets are LineString (GeoJSON) or trk, rte (GPX)")
    return lines


class _TooLargeError(Exception):
    """There is more than may be kept."""


def _parts(path: Path) -> Iterator[bytes]:
    """The content from its first character on; a file may also grow meanwhile."""
    if check_regular(path) > MOST_BYTES:
        raise _TooLargeError
    left = MOST_BYTES
    with open_regular(path) as file:
        part = file.read(_PART_BYTES).removeprefix(BOM_UTF8).lstrip()
        while part:
            left -= len(part)
            if left < 0:
                raise _TooLargeError
            yield part
            part = file.read(_PART_BYTES)


def _read(parts: Iterator[bytes], lines: StreetLines) -> None:
    first = next(parts, b"")
    reader = _Gpx(lines) if first.startswith(b"<") else _GeoJson(lines)
    reader.take(first)
    for part in parts:
        reader.take(part)
    reader.finish()


def _check_depth(depth: int) -> None:
    if depth > _DEEPEST:
        raise ValueError(f"nested in more than {_DEEPEST} levels")


def _check_length(n_bytes: int) -> None:
    if n_bytes > _LONGEST_BYTES:
        raise ValueError(f"a text, tag or comment of more than {_LONGEST_BYTES >> 10} kB")


_LONGEST_POINT = 4096
_TEXT = rb'"(?:[^"\\]++|\\.)*+"'
_NUMBER = rb"\s*+-?\d[\d.eE+-]*+\s*+"
_POINT = rb"\[" + _NUMBER + rb"," + _NUMBER + rb'(?:,[^][{}"]*+)?\]'
_PAIR = re.compile(rb"\[\s*+([^],]++),([^],]++)")
_TOKEN = re.compile(
    # points, a key, a text or number, or a bracket; possessive: the search stores nothing
    rb"[\s,]*+(?:(" + _POINT + rb"(?:\s*+,\s*+" + _POINT + rb")*+)|(" + _TEXT + rb")\s*+:"
    rb"|(" + _TEXT + rb'|[^][{}",\s]++)|([][{}]))',
    re.DOTALL,
)
_FLAT = re.compile(rb'\s*+\{(?:[^{}"]++|' + _TEXT + rb")*+\}", re.DOTALL)
"""An object in which there is no other: as a rule the properties of a feature."""
_LINE_TYPES = frozenset({b'"LineString"', b'"MultiLineString"'})


class _Member:
    """An open object or list; `key` and `kind` (its "type") are those of an object.

    Its coordinates begin after `n_before` lines, -1 without any. Nothing `foreign`, as a feature's
    properties, is a street.
    """

    __slots__ = ("foreign", "is_object", "key", "kind", "n_before")

    def __init__(self, *, is_object: bool, foreign: bool) -> None:
        self.is_object, self.foreign = is_object, foreign
        self.key = self.kind = b""
        self.n_before = -1


class _GeoJson:
    def __init__(self, lines: StreetLines) -> None:
        self._lines = lines
        self._rest = b""
        self._open = [_Member(is_object=False, foreign=False)]
        self._depth = 0  # of brackets within coordinates

    def take(self, part: bytes) -> None:
        self._rest += part
        self._take_tokens(len(self._rest) - _LONGEST_POINT)
        _check_length(len(self._rest))

    def finish(self) -> None:
        self._take_tokens(len(self._rest))
        if self._rest.strip() or len(self._open) > 1 or self._depth:
            raise ValueError("it ends in the middle")

    def _take_tokens(self, end: int) -> None:
        """Those that begin before `end`; a text without its end waits."""
        text, at = self._rest, 0
        while at < end and (token := _TOKEN.match(text, at)):
            at = token.end()
            points, key, value, bracket = token.groups()
            inner = self._open[-1]
            if bracket:
                self._take_bracket(inner, bracket)
            elif self._depth:
                if not points:
                    raise ValueError("coordinates are no numbers")
                self._lines.add(
                    (float(lat_deg), float(lon_deg)) for lon_deg, lat_deg in _PAIR.findall(points)
                )
            elif key:
                inner.key = key
                if key == b'"properties"' and (flat := _FLAT.match(text, at)):
                    at = flat.end()
            elif value and inner.key == b'"type"':
                inner.kind = value
        self._rest = text[at:]

    def _take_bracket(self, inner: _Member, bracket: bytes) -> None:
        is_object = bracket in b"{}"
        if self._depth:
            if is_object:
                raise ValueError("coordinates are no numbers")
            self._depth += 1 if bracket == b"[" else -1
            _check_depth(self._depth)
            self._lines.end_line()
        elif bracket == b"[" and inner.key == b'"coordinates"':
            inner.n_before = len(self._lines)
            self._depth = 1
        elif bracket in b"[{":
            foreign = inner.foreign or inner.key == b'"properties"'
            self._open.append(_Member(is_object=is_object, foreign=foreign))
            _check_depth(len(self._open))
        else:
            self._close(is_object=is_object)

    def _close(self, *, is_object: bool) -> None:
        closed = self._open.pop()
        if not self._open or closed.is_object != is_object:
            raise ValueError("a bracket is missing")
        if closed.n_before >= 0 and (closed.foreign or closed.kind not in _LINE_TYPES):
            self._lines.cut(closed.n_before)  # buildings, trees: not a way


class _Gpx:
    """Points of tracks and routes."""

    def __init__(self, lines: StreetLines) -> None:
        self._lines = lines
        self._depth = self._depth_of_line = 0
        self._n_bytes = 0
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.EntityDeclHandler = self._refuse

    def take(self, part: bytes) -> None:
        self._parser.Parse(part, False)
        self._n_bytes += len(part)
        _check_length(self._n_bytes - max(self._parser.CurrentByteIndex, 0))

    def finish(self) -> None:
        self._parser.Parse(b"", True)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        _check_depth(self._depth)
        if _is_line(name):
            self._depth_of_line = self._depth
        elif self._depth == self._depth_of_line + 1 and "lat" in attributes and self._depth_of_line:
            self._lines.add([(float(attributes["lat"]), float(attributes.get("lon", "")))])

    def _end(self, name: str) -> None:
        if _is_line(name):
            self._depth_of_line = 0
            self._lines.end_line()
        self._depth -= 1

    def _refuse(self, *_: object) -> None:
        raise ValueError("it declares entities")


def _is_line(name: str) -> bool:
    return name.rpartition(":")[2] in {"trkseg", "rte"}
