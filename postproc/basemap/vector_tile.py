"""Mapbox Vector Tiles 2.1: layers of points, lines and polygons in the units of a tile.

Source: mapbox/vector-tile-spec, 2.1. The tiles are protocol buffers; the few kinds of fields that
they have are read here.
"""

import struct
from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

Kind = Literal["point", "line", "polygon"]
Value = str | float | int | bool
Rings = list[list[tuple[int, int]]]

_KINDS: dict[int, Kind] = {1: "point", 2: "line", 3: "polygon"}
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_MOVE, _LINE, _CLOSE = 1, 2, 7
_FARTHEST = 1 << 24
"""Units of a tile, which has 4096: a drawing program would take hours for a line beyond."""
_MOST_BITS = 70
"""Of a number in bytes of seven."""


class Feature(NamedTuple):
    """One feature: its parts as points (x, y), x to the east and y to the south, and its tags."""

    kind: Kind
    parts: Rings
    tags: dict[str, Value]


class Layer(NamedTuple):
    """A layer of a tile that is `extent` units wide and high."""

    name: str
    extent: int
    features: list[Feature]


def layers_of(tile: bytes) -> list[Layer]:
    """All layers of a tile; raises ValueError for bytes that are none."""
    try:
        return [_layer(value) for number, value in _fields(tile) if number == 3]
    except (
        AttributeError,  # a number where a text belongs
        IndexError,
        KeyError,
        TypeError,
        UnicodeDecodeError,
        struct.error,
    ) as error:
        raise ValueError(f"no vector tile: {error}") from error


def _layer(data: bytes) -> Layer:
    name, extent, keys, values, raw = "", 4096, [], [], []
    for number, value in _fields(data):
        match number:
            case 1:
                name = value.decode()
            case 2:
                raw.append(value)
            case 3:
                keys.append(value.decode())
            case 4:
                values.append(_value(value))
            case 5:
                extent = int(value)
    if not 0 < extent <= _FARTHEST:
        raise IndexError("its layers have no size")
    features = [feature for one in raw if (feature := _feature(one, keys, values)) is not None]
    return Layer(name, extent, features)


def _feature(data: bytes, keys: list[str], values: list[Value]) -> Feature | None:
    kind, tags, geometry = 0, [], b""
    for number, value in _fields(data):
        match number:
            case 2:
                tags = list(_varints(value))
            case 3:
                kind = int(value)
            case 4:
                geometry = value
    if kind not in _KINDS:
        return None
    named = {keys[k]: values[v] for k, v in zip(tags[::2], tags[1::2], strict=False)}
    return Feature(_KINDS[kind], _parts(geometry), named)


def _parts(geometry: bytes) -> Rings:
    """Commands of the cursor as points of each part; a polygon's first point is not repeated."""
    numbers = list(_varints(geometry))
    parts: Rings = []
    at = x = y = 0
    while at < len(numbers):
        kind, count = numbers[at] & 7, numbers[at] >> 3
        at += 1
        if kind == _CLOSE:
            continue
        if 2 * count > len(numbers) - at:
            raise IndexError("a line has fewer points than it states")
        points = numbers[at : at + 2 * count]
        at += 2 * count
        for right, down in zip(points[::2], points[1::2], strict=True):
            x, y = x + _signed(right), y + _signed(down)
            if max(abs(x), abs(y)) > _FARTHEST:
                raise IndexError("a point lies far outside of the tile")
            if kind == _MOVE:
                parts.append([])
            parts[-1].append((x, y))
    return parts


def _value(data: bytes) -> Value:
    """The value in its only field, of whatever type."""
    for number, value in _fields(data):
        match number:
            case 1:
                return str(value.decode())
            case 2 | 3:
                return float(struct.unpack("<f" if number == 2 else "<d", value)[0])
            case 6:
                return _signed(value)
        return int(value)
    return ""


def _fields(data: bytes) -> Iterator[tuple[int, Any]]:
    """Numbers and values of the fields of a message; a number where the field is one."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == _VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if kind == _BYTES:
            length, at = _varint(data, at)
        else:
            length = {_FIXED64: 8, _FIXED32: 4}[kind]
        if at + length > len(data):
            raise IndexError("cut short")
        yield number, data[at : at + length]
        at += length


def _varints(data: bytes) -> Iterator[int]:
    at = 0
    while at < len(data):
        value, at = _varint(data, at)
        yield value


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value, at = value | (byte & 0x7F) << shift, at + 1
        if byte < 0x80:
            return value, at
        shift += 7
        if shift >= _MOST_BITS:
            raise IndexError("a number has more than 64 bit")


def _signed(number: int) -> int:
    """The integer of a zigzag code."""
    return number >> 1 ^ -(number & 1)
