"""Lines and polygons of (lon, lat) as files of maps have them."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from logger.core.arrays import FloatArray

# RFC 7946 3.1.6 and 3.1.9. A line or ring steps by less than half a turn, so its longitudes can be
# made continuous.

LonLat = tuple[float, float]
Line = list[LonLat]
Rings = list[Line]
"""Outer ring first, then holes; each closed."""

DECIMALS = 7


def lines(points: Sequence[LonLat]) -> list[Line]:
    """A line of (lon, lat), cut at the antimeridian; none for fewer than two points."""
    if len(points) < 2:
        return []
    if all(abs(a[0] - b[0]) < 180.0 for a, b in pairwise(points)):
        line = _round(points)
        return [line] if any(point != line[0] for point in line) else []
    unwrapped = LineString(_continuous(np.asarray(points, float)))
    parts = (
        part
        for turn, strip in _strips(unwrapped)
        for part in _shift(turn, shapely.intersection(unwrapped, strip))
    )
    return [
        _round(part.coords) for part in parts if isinstance(part, LineString) and part.length > 0.0
    ]


def polygons(parts: Iterable[Sequence[Sequence[Sequence[float]]]]) -> list[Rings]:
    """Polygons, each a list of rings of (lon, lat), made valid, cut and wound by RFC 7946."""
    polygons_of_rings: list[Rings] = []
    for part in parts:
        outer = _continuous(np.asarray(part[0], float))
        holes = [_continuous(np.asarray(ring, float), outer[0, 0]) for ring in part[1:]]
        polygon = shapely.make_valid(Polygon(outer, holes))
        for turn, strip in _strips(polygon):
            for piece in _shift(turn, shapely.intersection(polygon, strip)):
                if isinstance(piece, Polygon):
                    polygons_of_rings += _rings(piece)
    return polygons_of_rings


def _continuous(points: FloatArray, near_deg: float | None = None) -> FloatArray:
    """Points with longitudes that do not jump, the first within half a turn of `near_deg`."""
    lon_deg = np.unwrap(points[:, 0], period=360.0)
    if near_deg is not None:
        lon_deg = lon_deg + 360.0 * np.round((near_deg - lon_deg[0]) / 360.0)
    return np.column_stack([lon_deg, points[:, 1]])


def _strips(shape: shapely.Geometry) -> Iterator[tuple[int, Polygon]]:
    """Turns around the Earth that a shape touches, and the strip of each."""
    west, _, east, _ = shapely.bounds(shape).tolist()
    for turn in range(int((west + 180.0) // 360.0), int((east + 180.0) // 360.0) + 1):
        yield turn, shapely.box(-180.0 + 360.0 * turn, -90.0, 180.0 + 360.0 * turn, 90.0)


def _shift(turn: int, shape: shapely.Geometry) -> Iterator[shapely.Geometry]:
    moved = shapely.transform(shape, lambda xy: xy - (360.0 * turn, 0.0)) if turn else shape
    for part in shapely.get_parts(moved).tolist():
        yield from part.geoms if isinstance(part, MultiPolygon) else (part,)


def _rings(polygon: Polygon) -> Iterator[Rings]:
    """Rings of a polygon after rounding, which may divide it or leave nothing."""
    for part in shapely.get_parts(shapely.set_precision(polygon, 10.0**-DECIMALS)).tolist():
        if isinstance(part, Polygon) and not part.is_empty:
            wound = orient(part)
            yield [_round(ring.coords) for ring in (wound.exterior, *wound.interiors)]


def _round(coordinates: Iterable[Sequence[float]]) -> Line:
    return [
        (round(lon, DECIMALS) + 0.0, round(lat, DECIMALS) + 0.0) for lon, lat, *_ in coordinates
    ]
