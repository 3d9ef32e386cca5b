"""Mapbox Vector Tiles 2.1: read, drawn as a quiet picture, and asked for the name of a street.

Source: mapbox/vector-tile-spec, 2.1. The tiles are protocol buffers, read here: the library
mapbox-vector-tile (2.2.0) needs a protobuf below 7 and pyclipper. Layers have the names of the two
schemas in use, Protomaps (docs.protomaps.com/basemaps/layers) and OpenMapTiles
(openmaptiles.org/schema).
"""

import math
import struct
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from PIL import Image, ImageDraw

Kind = Literal["point", "line", "polygon"]
Value = str | float | int | bool
Part = list[tuple[int, int]]
Point = tuple[float, float]
Colour = tuple[int, int, int]

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
    parts: list[Part]
    tags: dict[str, Value]


class Layer(NamedTuple):
    """A layer of a tile that is `extent` units wide and high."""

    name: str
    extent: int
    features: list[Feature]


def layers_of(tile: bytes) -> list[Layer]:
    """All layers of a tile; raises ValueError for bytes that are none."""
    try:
        return [_layer(_message(data)) for data in _message(tile)[3]]
    except (
        AttributeError,  # a number where a text belongs
        IndexError,
        KeyError,
        TypeError,
        UnicodeDecodeError,
        struct.error,
    ) as error:
        raise ValueError(f"no vector tile: {error}") from error


def _layer(fields: Mapping[int, Sequence[Any]]) -> Layer:
    keys = [key.decode() for key in fields[3]]
    values = [_value(_message(value)) for value in fields[4]]
    extent = int(fields[5][-1]) if fields[5] else 4096
    if not 0 < extent <= _FARTHEST:
        raise IndexError("its layers have no size")
    features = []
    for feature in map(_message, fields[2]):
        kind = _KINDS.get(feature[3][-1] if feature[3] else 0)
        if kind is not None:
            tags, geometry = (_numbers(feature[n][-1] if feature[n] else b"") for n in (2, 4))
            named = {keys[k]: values[v] for k, v in zip(tags[::2], tags[1::2], strict=False)}
            features.append(Feature(kind, _parts(geometry), named))
    return Layer(fields[1][-1].decode() if fields[1] else "", extent, features)


def _parts(numbers: Sequence[int]) -> list[Part]:
    """Commands of the cursor as points of each part; a polygon's first point is not repeated."""
    parts: list[Part] = []
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


def _value(fields: Mapping[int, Sequence[Any]]) -> Value:
    for number, (value, *_) in fields.items():
        match number:
            case 1:
                return str(value.decode())
            case 2 | 3:
                return float(struct.unpack("<f" if number == 2 else "<d", value)[0])
            case 6:
                return _signed(value)
        return int(value)
    return ""


def _message(data: bytes) -> Mapping[int, list[Any]]:
    fields: defaultdict[int, list[Any]] = defaultdict(list)
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind in {_VARINT, _BYTES}:
            length, at = _varint(data, at)
        else:
            length = {_FIXED64: 8, _FIXED32: 4}[kind]
        if kind == _VARINT:
            fields[key >> 3].append(length)
            continue
        if at + length > len(data):
            raise IndexError("cut short")
        fields[key >> 3].append(data[at : at + length])
        at += length
    return fields


def _numbers(data: bytes) -> list[int]:
    numbers, at = [], 0
    while at < len(data):
        number, at = _varint(data, at)
        numbers.append(number)
    return numbers


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
    return number >> 1 ^ -(number & 1)


_PAPER: Colour = (250, 249, 246)
_AREAS: dict[str, Colour] = {
    "landcover": (232, 240, 224),
    "landuse": (236, 240, 230),
    "park": (214, 232, 205),
    "water": (190, 215, 235),
    "buildings": (218, 213, 206),
    "building": (218, 213, 206),
}
"""In the order in which they are drawn."""
_GREEN = frozenset({"park", "forest", "wood", "grass", "garden", "nature_reserve", "cemetery"})
_DRAWN_STREETS = ("roads", "transportation")
_WATERWAYS = ("waterway", "water")
_WIDE = frozenset({"highway", "motorway", "trunk", "major_road", "primary", "secondary"})
_NARROW = frozenset({"path", "footway", "track", "steps", "cycleway", "other"})
_ROAD: Colour = (150, 146, 140)
_PATH: Colour = (186, 178, 166)


class _Pen(NamedTuple):
    draw: ImageDraw.ImageDraw
    scale: float

    def points(self, part: Part) -> list[tuple[float, float]]:
        return [(x * self.scale, y * self.scale) for x, y in part]


def draw_tile(layers: list[Layer], size: int) -> Image.Image:
    """The layers as RGBA of `size` pixels a side."""
    picture = Image.new("RGBA", (size, size), (*_PAPER, 255))
    draw = ImageDraw.Draw(picture)
    by_name = {layer.name: layer for layer in layers}
    for name, colour in _AREAS.items():
        for feature in _features(by_name, name, "polygon"):
            _draw_area(_pen(draw, by_name[name], size), feature, colour)
    for name in _WATERWAYS:
        for feature in _features(by_name, name, "line"):
            _draw_line(_pen(draw, by_name[name], size), feature, _AREAS["water"], size / 170)
    for name in _DRAWN_STREETS:
        for feature in _features(by_name, name, "line"):
            _draw_street(_pen(draw, by_name[name], size), feature, size)
    return picture


def _features(by_name: dict[str, Layer], name: str, kind: str) -> list[Feature]:
    layer = by_name.get(name)
    return [feature for feature in layer.features if feature.kind == kind] if layer else []


def _pen(draw: ImageDraw.ImageDraw, layer: Layer, size: int) -> _Pen:
    return _Pen(draw, size / max(layer.extent, 1))


def _draw_area(pen: _Pen, feature: Feature, colour: Colour) -> None:
    kinds = {str(feature.tags.get(key, "")) for key in ("kind", "class", "subclass", "pmap:kind")}
    fill = _AREAS["park"] if kinds & _GREEN else colour
    for part in feature.parts:
        if len(part) >= 3:
            # a hole runs the other way round (4.3.4.4 of the specification)
            pen.draw.polygon(pen.points(part), fill=fill if _area(part) > 0 else _PAPER)


def _area(part: Part) -> float:
    """Twice the signed area; positive for an outer ring, whose y points down."""
    following = [*part[1:], part[0]]
    return float(sum(x * v - u * y for (x, y), (u, v) in zip(part, following, strict=True)))


def _draw_street(pen: _Pen, feature: Feature, size: int) -> None:
    kinds = {str(feature.tags.get(key, "")) for key in ("kind", "class", "kind_detail")}
    is_path = bool(kinds & _NARROW)
    width = size / 400 if is_path else size / 200
    if kinds & _WIDE:
        width = size / 110
    _draw_line(pen, feature, _PATH if is_path else _ROAD, width)


def _draw_line(pen: _Pen, feature: Feature, colour: Colour, width: float) -> None:
    for part in feature.parts:
        if len(part) >= 2:
            pen.draw.line(pen.points(part), fill=colour, width=max(round(width), 1), joint="curve")


_NAMED_STREETS = frozenset({"roads", "transportation_name"})
"""Layers of Protomaps and OpenMapTiles."""
_NEAR_M = 100.0
"""A position farther from every named street is not at one of them."""


def street_near(layers: Sequence[Layer], place: Point, tile_m: float) -> str | None:
    """Name of the nearest street within 100 m of a place, given as shares of the tile."""
    distances = [
        (_distance(layer, part, place) * tile_m, name)
        for layer in layers
        for name, part in _named_parts(layer)
    ]
    distance_m, name = min(distances, default=(math.inf, None))
    return name if distance_m <= _NEAR_M else None


def _named_parts(layer: Layer) -> Iterator[tuple[str, Part]]:
    if layer.name in _NAMED_STREETS:
        for feature in layer.features:
            name = feature.tags.get("name")
            if feature.kind == "line" and isinstance(name, str) and name:
                yield from ((name, part) for part in feature.parts)


def _distance(layer: Layer, part: Part, place: Point) -> float:
    """From a place in a tile to a line of it, both as shares of the tile."""
    points = [(x / layer.extent, y / layer.extent) for x, y in part]
    ends = zip(points, points[1:] or points, strict=False)
    return min((_to_segment(place, *pair) for pair in ends), default=math.inf)


def _to_segment(place: Point, start: Point, end: Point) -> float:
    along = end[0] - start[0], end[1] - start[1]
    length = along[0] ** 2 + along[1] ** 2
    offset = place[0] - start[0], place[1] - start[1]
    share = 0.0 if length == 0.0 else (offset[0] * along[0] + offset[1] * along[1]) / length
    share = min(max(share, 0.0), 1.0)
    return math.hypot(offset[0] - share * along[0], offset[1] - share * along[1])
