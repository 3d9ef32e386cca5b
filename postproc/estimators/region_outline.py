"""Highest-density regions as polygons: in UTM metres for drawing, in degrees for GeoJSON."""

from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from logger.core.arrays import FloatArray, IntArray
from logger.core.geo import Utm
from logger.core.locator.region import LEVEL, Squares, highest_density

_DEGREE_DECIMALS = 7
_SIMPLIFY_CELLS = 0.5


def _squares(cells: Squares, chosen: IntArray) -> npt.NDArray[np.object_]:
    """Squares as polygons, a little too large so that neighbours overlap."""
    half = 0.5 * cells.size_m[chosen] * (1.0 + 1e-6)
    x, y = cells.x_m[chosen], cells.y_m[chosen]
    return np.asarray(shapely.box(x - half, y - half, x + half, y + half))


def polygons(cells: Squares, level: float = LEVEL) -> MultiPolygon:
    """Outline of the highest-density set in UTM metres."""
    chosen = highest_density(cells, level)
    union = shapely.union_all(_squares(cells, chosen), grid_size=1e-3)
    parts = [part for part in shapely.get_parts(union) if isinstance(part, Polygon)]
    return MultiPolygon([shapely.simplify(part, 1e-3) for part in parts])


def outline(cells: Squares, level: float = LEVEL) -> list[Polygon]:
    """Highest-density set in UTM metres: outer rings counterclockwise.

    Steps of the cells are smoothed by up to half the smallest cell, to keep the outline short.
    """
    tolerance = _SIMPLIFY_CELLS * float(np.min(cells.size_m[highest_density(cells, level)]))
    smooth = shapely.simplify(polygons(cells, level), tolerance, preserve_topology=True)
    return [
        orient(part)
        for part in shapely.get_parts(smooth)
        if isinstance(part, Polygon) and not part.is_empty
    ]


def geojson(cells: Squares, utm: Utm, level: float = LEVEL) -> dict[str, Any]:
    """Outline as a GeoJSON MultiPolygon: lon/lat, 7 decimals (RFC 7946)."""
    parts = outline(cells, level)
    rings = [
        [_ring(np.asarray(r.coords, float), utm) for r in (part.exterior, *part.interiors)]
        for part in parts
    ]
    return {"type": "MultiPolygon", "coordinates": rings}


def _ring(xy_m: FloatArray, utm: Utm) -> list[list[float]]:
    lat_deg, lon_deg = utm.to_latlon_arrays(xy_m[:, 0], xy_m[:, 1])
    lonlat: list[list[float]] = np.round(
        np.column_stack([lon_deg, lat_deg]), _DEGREE_DECIMALS
    ).tolist()
    return lonlat
