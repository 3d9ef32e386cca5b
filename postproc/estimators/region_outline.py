"""Highest-density regions as polygons: in UTM metres for drawing, in degrees for GeoJSON.

The squares of a region are merged before they are outlined, which takes a tenth of the time.
"""

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from logger.core import answer
from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.region import LEVEL, Squares, highest_density
from logger.core.places import Utm
from postproc import outlines

_SIMPLIFY_CELLS = 0.5
_KEY_FACTORS = np.array([1 << 32, 1])
"""Combine column and row, counted in the finest squares, into one integer."""


def _boxes(cells: Squares) -> npt.NDArray[np.object_]:
    """Squares as polygons, a little too large so that neighbours overlap."""
    half = 0.5 * cells.size_m * (1.0 + 1e-6)
    x, y = cells.x_m, cells.y_m
    return np.asarray(shapely.box(x - half, y - half, x + half, y + half))


def polygons(cells: Squares, level: float = LEVEL) -> MultiPolygon:
    """Outline of the highest-density set in UTM metres."""
    union = shapely.union_all(_boxes(merge_squares(cells, level)), grid_size=1e-3)
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


def geojson(cells: Squares, utm: Utm, level: float = LEVEL) -> answer.MultiPolygon:
    """Outline as a GeoJSON MultiPolygon: lon/lat, 7 decimals, cut at 180 degrees (RFC 7946)."""
    rings = [
        [_ring(np.asarray(r.coords, float), utm) for r in (part.exterior, *part.interiors)]
        for part in outline(cells, level)
    ]
    lon_deg = [lon for part in rings for ring in part for lon, _ in ring]
    if lon_deg and max(lon_deg) - min(lon_deg) > 180.0:
        rings = outlines.polygons(rings)
    return answer.MultiPolygon(type="MultiPolygon", coordinates=rings)


def _ring(xy_m: FloatArray, utm: Utm) -> answer.Ring:
    lat_deg, lon_deg = (
        np.round(angles, outlines.DECIMALS).tolist() for angles in utm.to_latlon_arrays(*xy_m.T)
    )
    return list(zip(lon_deg, lat_deg, strict=True))


def merge_squares(cells: Squares, level: float) -> Squares:
    """The squares of a region; four that make up a larger square are merged, again and again."""
    inside = highest_density(cells, level)
    centre_m = np.column_stack([cells.x_m, cells.y_m])
    largest = int(np.argmax(cells.size_m))
    # a corner of the largest square is a corner of a smaller square at every scale of the tree
    corner_m = centre_m[largest] - 0.5 * cells.size_m[largest]
    finest_m = float(np.min(cells.size_m))
    side = np.rint(cells.size_m[inside] / finest_m).astype(np.int64)
    south_west = (centre_m[inside] - corner_m) / finest_m - 0.5 * side[:, None]
    squares = np.column_stack([side, np.rint(south_west).astype(np.int64)])
    largest_side = round(float(cells.size_m[largest]) / finest_m)
    merged_side = 1
    while merged_side < largest_side:
        squares = _merge_four(squares, merged_side)
        merged_side *= 2
    side_m = squares[:, 0] * finest_m
    x_m, y_m = (corner_m + squares[:, 1:] * finest_m + 0.5 * side_m[:, None]).T
    return Squares(x_m, y_m, side_m, np.full(len(squares), 1.0 / len(squares)))


def _merge_four(squares: IntArray, side: int) -> IntArray:
    """Merge squares (n, 3) of one side where four fill the next larger square.

    Columns are side, west and south.
    """
    of_side = squares[:, 0] == side
    if np.count_nonzero(of_side) < 4:
        return squares
    small = squares[of_side]
    parent = small[:, 1:] // (2 * side)
    _, first, which, counts = np.unique(
        parent @ _KEY_FACTORS, return_index=True, return_inverse=True, return_counts=True
    )
    complete = counts == 4
    corner = parent[first[complete]] * (2 * side)
    larger = np.column_stack([np.full(len(corner), 2 * side), corner])
    return np.vstack([squares[~of_side], small[~complete[which]], larger])
