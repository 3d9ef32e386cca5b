"""Where a transmitter can stand: within some metres of the walk, or inside polygons of a map."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, dist, inf, radians, sqrt

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.errors import ConfigError
from logger.core.places import Places, Utm

Corner = tuple[float, float]
"""In metres or, of a file, in degrees."""
Ring = tuple[Corner, ...]
"""Corners of a polygon or of a hole in it; the last is joined to the first."""
Polygon = tuple[Ring, ...]
"""The outer ring, then those of holes."""

_FARTHEST_M = 30_000.0
"""The reach of the prior: nothing farther from the walk is searched."""
_AROUND_DEG = 1.5
"""Of latitude: what lies farther from the walks is cut off, since their zone ends. GSM reaches 35
km, a fifth."""
_EDGE_DEG = 0.05
"""Longest edge: straight in degrees, as in a file, it bends by 1 m in metres."""
_GROWN = 0.25
"""Of its width: so much farther a walk that goes on is searched again."""
_LEAST_M = 1.0
"""A place so close to the hull of a walk, as of one who stands, does not change it."""
_PARTS = 8.0
"""Squares on the border of an area are at most its extent divided by this."""
_HALF_DIAGONAL = 0.7072
_CHUNK = 256
"""Positions at a time: a border of a city has thousands of corners."""


@dataclass(frozen=True, slots=True)
class Area:
    """A mask over positions, which the prior of the position is multiplied by.

    `text` says where, as it is printed. It is `polygons` widened by `wider_m`: in metres of the
    zone `utm`, or before `at` in degrees (longitude, latitude). Without polygons it is the hull of
    the walks given to `at`.
    """

    text: str
    wider_m: float = 0.0
    polygons: tuple[Polygon, ...] = ()
    utm: Utm | None = None

    @classmethod
    def within_walk(cls, metres: float) -> "Area":
        """The convex hull of the walk, widened."""
        return cls(f"within {metres:g} m of the walk", metres)

    def at(self, walks: Sequence[Places]) -> "Area":
        """The area in metres, for walks in one zone; one in metres stays as it is.

        Raises `ConfigError` where no walk is near the polygons.
        """
        if self.utm is not None:
            return self
        utm = walks[0].utm
        hulls = tuple((hull(walk),) for walk in walks if len(walk))
        if not self.polygons:
            return replace(self, polygons=hulls, utm=utm)
        corners = np.concatenate([np.array(ring) for (ring,) in hulls])
        lat_deg, lon_deg = utm.to_latlon_arrays(*corners.T)
        corners_deg = np.stack([lon_deg, lat_deg])
        polygons = tuple(_in_metres(polygon, utm, corners_deg) for polygon in self.polygons)
        placed = replace(self, polygons=tuple(filter(None, polygons)), utm=utm)
        nearest_m = np.min(placed.beyond_m(Places.of(*corners.T)), initial=inf)
        if nearest_m > _FARTHEST_M:
            away = f"all are more than {_FARTHEST_M / 1e3:.0f} km away"
            raise ConfigError(f"no walk is near the area {self.text}: {away}")
        return placed

    def beyond_m(self, positions: Places) -> FloatArray:
        """Distance of positions (h,) from the area, negative inside; shape (h,)."""
        nearest_m = np.full(len(positions), inf)
        for polygon in self.polygons:
            for first in range(0, len(positions), _CHUNK):
                some = slice(first, first + _CHUNK)
                outside_m = _beyond_polygon_m(polygon, positions.part(some))
                nearest_m[some] = np.minimum(nearest_m[some], outside_m)
        return np.asarray(nearest_m - self.wider_m, float)

    def share(self, square: FloatArray) -> FloatArray:
        """About which part of each square (3, h) is inside; shape (h,)."""
        beyond_m = self.beyond_m(Places.of(*square[:2]))
        return np.asarray(np.clip(0.5 - beyond_m / square[2], 0.0, 1.0), float)

    def is_coarse(self, square: FloatArray) -> BoolArray:
        """Whether squares (3, h) on its border are too large to show it; shape (h,)."""
        found = square[2] > self._least_extent_m / _PARTS
        large = square[:, found]
        found[found] = np.abs(self.beyond_m(Places.of(*large[:2]))) < _HALF_DIAGONAL * large[2]
        return np.asarray(found, np.bool_)

    @property
    def _least_extent_m(self) -> float:
        """Of the smallest polygon."""
        extents_m = []
        for outer, *_ in self.polygons:
            width_m, length_m = np.ptp(np.array(outer), axis=0) + 2.0 * self.wider_m
            extents_m.append(sqrt(width_m * length_m))
        return min(extents_m)


class WalkArea:
    """The area within some metres of a walk that goes on; with None anywhere."""

    def __init__(self, within_m: float | None) -> None:
        self._hull: Ring = ()
        self._utm: Utm | None = None
        self.widen(within_m)

    def widen(self, within_m: float | None) -> None:
        """Set another distance."""
        self.within_m = within_m
        self._renew()

    def add(self, place: Places) -> None:
        """Add the next place of the walker."""
        x_m, y_m = place.x_m.item(), place.y_m.item()
        if self._utm is None or _is_beyond(self._hull, (x_m, y_m)):
            corners = np.array([*self._hull, (x_m, y_m)])
            self._hull, self._utm = hull(Places.of(*corners.T)), place.utm
            self._renew()

    def _renew(self) -> None:
        self.area: Area | None = None
        if self.within_m is not None and self._utm is not None:
            area = Area.within_walk(self.within_m)
            self.area = replace(area, polygons=((self._hull,),), utm=self._utm)

    def has_outgrown(self, searched: Area | None) -> bool:
        """Whether the walk has left the searched area by a part of its width."""
        now = self.area
        if now is searched:
            return False
        if now is None or searched is None or now.wider_m != searched.wider_m:
            return True
        corners = Places.of(*np.array(self._hull).T)
        grown_m = np.max(searched.beyond_m(corners)) + searched.wider_m
        return bool(grown_m > _GROWN * now.wider_m)


def _is_beyond(ring: Ring, place: Corner) -> bool:
    """Clearly beyond: farther than `_LEAST_M`."""
    if len(ring) < 3:
        return all(dist(place, corner) > _LEAST_M for corner in ring)
    return any(
        _turn(a, b, place) < -_LEAST_M * dist(a, b)
        for a, b in zip(ring, (*ring[1:], ring[0]), strict=True)
    )


def hull(places: Places) -> Ring:
    """Corners of the convex hull, counterclockwise (Andrew, Inf. Proc. Letters 9(5), 1979)."""
    points = sorted(set(zip(places.x_m.tolist(), places.y_m.tolist(), strict=True)))
    if len(points) < 3:
        return tuple(points)
    half = []
    for way in (points, points[::-1]):
        chain: list[Corner] = []
        for x, y in way:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], (x, y)) <= 0.0:
                chain.pop()
            chain.append((x, y))
        half.append(chain[:-1])
    return tuple(half[0] + half[1])


def _turn(a: Corner, b: Corner, c: Corner) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _in_metres(polygon: Polygon, utm: Utm, walks_deg: FloatArray) -> Polygon:
    """The part around walks at (2, n) degrees, longitudes first; empty where there is none."""
    low, high = np.min(walks_deg, axis=1), np.max(walks_deg, axis=1)
    margin_deg = np.array([_AROUND_DEG / cos(radians(float(np.mean(walks_deg[1])))), _AROUND_DEG])
    rings = []
    for ring in polygon:
        corners = _in_box(list(ring), (low - margin_deg).tolist(), (high + margin_deg).tolist())
        if corners:
            lon_deg, lat_deg = _with_short_edges(np.array(corners)).T
            x_m, y_m = utm.to_xy_arrays(lat_deg, lon_deg)
            rings.append(tuple(zip(x_m.tolist(), y_m.tolist(), strict=True)))
    return tuple(rings)


def _in_box(ring: list[Corner], low: list[float], high: list[float]) -> list[Corner]:
    """Sutherland & Hodgman, CACM 17(1), 1974."""
    for axis, limit, sign in ((0, low, 1.0), (0, high, -1.0), (1, low, 1.0), (1, high, -1.0)):
        cut: list[Corner] = []
        for before, after in zip(ring[-1:] + ring[:-1], ring, strict=True):
            inside = [sign * (corner[axis] - limit[axis]) for corner in (before, after)]
            if (inside[0] >= 0.0) != (inside[1] >= 0.0):
                part = inside[0] / (inside[0] - inside[1])
                cut.append(
                    (
                        before[0] + part * (after[0] - before[0]),
                        before[1] + part * (after[1] - before[1]),
                    )
                )
            if inside[1] >= 0.0:
                cut.append(after)
        ring = cut
    return ring


def _with_short_edges(ring: FloatArray) -> FloatArray:
    """Adds corners to the long edges of a ring (n, 2) in degrees."""
    way = np.roll(ring, -1, axis=0) - ring
    parts = np.maximum(np.ceil(np.max(np.abs(way), axis=1) / _EDGE_DEG), 1.0).astype(int)
    edge = np.repeat(np.arange(len(ring)), parts)
    along = np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(ring[edge] + (along / parts[edge])[:, None] * way[edge], float)


def _beyond_polygon_m(polygon: Polygon, positions: Places) -> FloatArray:
    """Negative inside; shape (h,)."""
    start = np.concatenate([np.array(ring) for ring in polygon])
    end = np.concatenate([np.roll(np.array(ring), -1, axis=0) for ring in polygon])
    (x0, y0), (east, north) = start.T, (end - start).T
    x_m, y_m = positions.x_m[:, None], positions.y_m[:, None]
    dx, dy = x_m - x0, y_m - y0
    length2 = np.maximum(east**2 + north**2, 1e-12)
    along = np.clip((dx * east + dy * north) / length2, 0.0, 1.0)
    away_m = np.sqrt(np.min((dx - along * east) ** 2 + (dy - along * north) ** 2, axis=1))
    # a ray to the east crosses the border an odd number of times from inside
    crosses = (y0 > y_m) != (end[:, 1] > y_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        is_east = dx < dy * east / north
    is_inside = np.count_nonzero(crosses & is_east, axis=1) % 2 == 1
    return np.asarray(np.where(is_inside, -away_m, away_m), float)
