"""Where the mass of a posterior lies: highest-density set, separate places, polygons.

A posterior is a set of square cells that tile the searched area, each with a probability. Density is probability by
area. The highest-density set of level 0.95 holds the densest cells that together have 95 % of the mass: the smallest
region of that probability, whatever its shape (Hyndman, The American Statistician 50(2), 1996).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from logger.core.arrays import FloatArray, IntArray
from logger.core.geo import Utm

LEVEL = 0.95
SADDLE = 0.5
"""Two peaks are one place when the pass between them is higher than this share of the lower peak."""

_DEGREE_DECIMALS = 7
_SIMPLIFY_CELLS = 0.5


@dataclass(frozen=True, slots=True)
class Cells:
    """Square cells, shape (n,): centre and side in metres, probability (sum 1)."""

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray
    probability: FloatArray

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def density(self) -> FloatArray:
        """Probability per square metre, shape (n,)."""
        return self.probability / self.size_m**2


def highest_density(cells: Cells, level: float = LEVEL) -> IntArray:
    """Indices of the densest cells that hold `level` of the mass, densest first."""
    order = np.argsort(-cells.density, kind="stable")
    held = np.cumsum(cells.probability[order])
    count = int(np.searchsorted(held, level * held[-1])) + 1
    return order[:count]


def places(cells: Cells, level: float) -> list[IntArray]:
    """Split a highest-density set into places, each the indices of its cells.

    Cells are added from the densest on; one that touches nothing opens a place, others join the neighbouring place
    with the highest peak. Places that meet at more than `SADDLE` times the lower peak are merged.
    """
    chosen = highest_density(cells, level)
    density = cells.density[chosen]
    neighbours = _denser_neighbours(cells, chosen)
    peak = np.arange(len(chosen))  # of the place a cell belongs to; refers onward once that place is merged
    for i, met in enumerate(neighbours):
        roots = sorted({_root(peak, k) for k in met})
        for root in roots[1:]:
            if density[i] > SADDLE * density[root]:
                peak[root] = roots[0]
        peak[i] = roots[0] if roots else i
    label = np.array([_root(peak, i) for i in range(len(chosen))])
    return [chosen[label == k] for k in np.unique(label)]


def _root(peak: IntArray, k: int) -> int:
    while peak[k] != k:
        k = int(peak[k])
    return k


def _denser_neighbours(cells: Cells, chosen: IntArray) -> list[IntArray]:
    """For each chosen cell those before it that share an edge or a corner with it."""
    squares = _squares(cells, chosen)
    one, other = shapely.STRtree(squares).query(squares)
    one, other = one[other < one], other[other < one]
    order = np.argsort(one, kind="stable")
    return np.split(other[order], np.searchsorted(one[order], np.arange(1, len(chosen))))


def _squares(cells: Cells, chosen: IntArray) -> npt.NDArray[np.object_]:
    """Squares as polygons, a little too large so that neighbours overlap."""
    half = 0.5 * cells.size_m[chosen] * (1.0 + 1e-6)
    x, y = cells.x_m[chosen], cells.y_m[chosen]
    return np.asarray(shapely.box(x - half, y - half, x + half, y + half))


def polygons(cells: Cells, level: float = LEVEL) -> MultiPolygon:
    """Outline of the highest-density set in UTM metres."""
    chosen = highest_density(cells, level)
    union = shapely.union_all(_squares(cells, chosen), grid_size=1e-3)
    parts = [part for part in shapely.get_parts(union) if isinstance(part, Polygon)]
    return MultiPolygon([shapely.simplify(part, 1e-3) for part in parts])


def area_m2(cells: Cells, level: float = LEVEL) -> float:
    """Area of the highest-density set."""
    return float(np.sum(cells.size_m[highest_density(cells, level)] ** 2))


def outline(cells: Cells, level: float = LEVEL) -> list[Polygon]:
    """Highest-density set in UTM metres to be drawn or handed on: outer rings counterclockwise.

    Steps of the cells are smoothed by up to half the smallest cell, to keep the outline short.
    """
    tolerance = _SIMPLIFY_CELLS * float(np.min(cells.size_m[highest_density(cells, level)]))
    smooth = shapely.simplify(polygons(cells, level), tolerance, preserve_topology=True)
    return [orient(part) for part in shapely.get_parts(smooth) if isinstance(part, Polygon) and not part.is_empty]


def geojson(cells: Cells, utm: Utm, level: float = LEVEL) -> dict[str, Any]:
    """Outline as a GeoJSON MultiPolygon: lon/lat, 7 decimals (RFC 7946)."""
    parts = outline(cells, level)
    rings = [[_ring(np.asarray(r.coords, float), utm) for r in (part.exterior, *part.interiors)] for part in parts]
    return {"type": "MultiPolygon", "coordinates": rings}


def _ring(xy_m: FloatArray, utm: Utm) -> list[list[float]]:
    lat_deg, lon_deg = utm.to_latlon_arrays(xy_m[:, 0], xy_m[:, 1])
    lonlat: list[list[float]] = np.round(np.column_stack([lon_deg, lat_deg]), _DEGREE_DECIMALS).tolist()
    return lonlat
