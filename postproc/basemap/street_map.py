"""A vector tile as a quiet picture: water, green, buildings and streets, without text.

Layers have the names of the two schemas in use, Protomaps (docs.protomaps.com/basemaps/layers) and
OpenMapTiles (openmaptiles.org/schema).
"""

from typing import NamedTuple

from PIL import Image, ImageDraw

from postproc.basemap.vector_tile import Feature, Layer

Colour = tuple[int, int, int]

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
_STREETS = ("roads", "transportation")
_WATERWAYS = ("waterway", "water")
_WIDE = frozenset({"highway", "motorway", "trunk", "major_road", "primary", "secondary"})
_NARROW = frozenset({"path", "footway", "track", "steps", "cycleway", "other"})
_ROAD: Colour = (150, 146, 140)
_PATH: Colour = (186, 178, 166)


class _Pen(NamedTuple):
    draw: ImageDraw.ImageDraw
    scale: float

    def points(self, part: list[tuple[int, int]]) -> list[tuple[float, float]]:
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
    for name in _STREETS:
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


def _area(part: list[tuple[int, int]]) -> float:
    """Twice the signed area; positive for an outer ring, whose y points down."""
    following = [*part[1:], part[0]]
    return float(sum(x * v - u * y for (x, y), (u, v) in zip(part, following, strict=True)))


def _draw_street(pen: _Pen, feature: Feature, size: int) -> None:
    kinds = {str(feature.tags.get(key, "")) for key in ("kind", "class", "kind_detail")}
    is_path = bool(kinds & _NARROW)
    width = size / 110 if kinds & _WIDE else size / 400 if is_path else size / 200
    _draw_line(pen, feature, _PATH if is_path else _ROAD, width)


def _draw_line(pen: _Pen, feature: Feature, colour: Colour, width: float) -> None:
    for part in feature.parts:
        if len(part) >= 2:
            pen.draw.line(pen.points(part), fill=colour, width=max(round(width), 1), joint="curve")
