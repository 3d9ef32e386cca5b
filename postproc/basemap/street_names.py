"""The name of the street at a position, from the vector tiles of a PMTiles file."""

import math
from collections.abc import Iterator
from pathlib import Path

from logger.core.errors import ConfigError
from postproc.basemap.pmtiles_file import is_pmtiles, vector_tile_at
from postproc.basemap.vector_tile import Layer, layers_of

_LAYERS = frozenset({"roads", "transportation_name"})
"""Of Protomaps and OpenMapTiles."""
_NEAR_M = 100.0
"""A position farther from every named street is not at one of them."""
_EQUATOR_M = 40_075_016.7

Point = tuple[float, float]


def street_near(path: Path, lat_deg: float, lon_deg: float) -> str | None:
    """Name of the nearest street within 100 m; None without one, and for other kinds of files.

    Raises `ConfigError` for a file that cannot be read.
    """
    if not is_pmtiles(path):
        return None
    found = vector_tile_at(path, lat_deg, lon_deg)
    if found is None:
        return None
    try:
        layers = layers_of(found.data)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from error
    tile_m = _EQUATOR_M * math.cos(math.radians(lat_deg)) / 2**found.zoom
    distances = [
        (_distance(layer, part, found.place) * tile_m, name)
        for layer in layers
        for name, part in _named_parts(layer)
    ]
    distance_m, name = min(distances, default=(math.inf, None))
    return name if distance_m <= _NEAR_M else None


def _named_parts(layer: Layer) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    if layer.name in _LAYERS:
        for feature in layer.features:
            name = feature.tags.get("name")
            if feature.kind == "line" and isinstance(name, str) and name:
                yield from ((name, part) for part in feature.parts)


def _distance(layer: Layer, part: list[tuple[int, int]], place: Point) -> float:
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
