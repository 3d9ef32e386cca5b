"""Streets of a file, of which the map around the walker is made."""

from array import array
from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.street_map import StreetMap
from logger.core.places import Places, Utm

FARTHEST_M = 3000.0
"""Streets farther from the first position are left out: an hour's walk ends before."""
_TOWN_M = 2.0 * FARTHEST_M
"""A file that spans no more is prepared before the first position is known."""
_DEG_M = 111_000.0
"""A degree of latitude is no shorter than 110.5 km; the difference decides nothing."""
_LONGEST_M = FARTHEST_M
"""A longer straight piece is a ferry, or a gap in a track."""
_MOST_LENGTHS, _LENGTH_M = 25_000, 200.0
"""Most pieces of a map, where a piece counts once for each of these lengths that it begins. The old
town of a capital has so many within 1.7 km. A map of them takes up to 45 MB while it is made."""
_MOST_AT_ONCE = 10_000
"""Points that are projected at once."""

Line = list[tuple[float, float]]
"""Latitudes and longitudes in degrees."""


class Streets(Protocol):
    """Where streets come from."""

    def near(self, here: Places) -> StreetMap | None:
        """The streets around a walk that is here; None without any."""


class _Prepared(NamedTuple):
    """A map, and how far from its centre it serves."""

    centre: Places
    reach_m: float
    streets: StreetMap

    def serves(self, here: Places) -> bool:
        """Whether a walk that is here needs no other map."""
        return here.utm == self.centre.utm and here.away_m(self.centre) <= self.reach_m


class StreetAtlas:
    """The streets of a file; those of a town are prepared at once: 0.1 s for 1000 streets.

    Where there are more near the walker than a map may have, it has the nearest. Raises `GeoError`
    where too many of them cross at one place.
    """

    def __init__(self, lines: Iterable[Line]) -> None:
        deg, first, n_points = array("d"), array("q"), 0
        for line in lines:
            first.append(n_points)
            n_points += len(line)
            for point in line:
                deg.extend(point)
        self._lat_lon_deg = np.array(deg, float).reshape(-1, 2)
        self._first = np.array(first, np.int64)
        self._prepared: _Prepared | None = None
        if not n_points:
            return
        low_deg, high_deg = np.min(self._lat_lon_deg, axis=0), np.max(self._lat_lon_deg, axis=0)
        centre_deg = 0.5 * (low_deg + high_deg)
        span_m = _DEG_M * (high_deg - low_deg) * [1.0, np.cos(np.radians(centre_deg[0]))]
        if np.all(span_m <= _TOWN_M):
            self._prepared = self._map_at(Places.of_degrees(*centre_deg), np.inf)

    def near(self, here: Places) -> StreetMap | None:
        """As `Streets.near`; None of an empty file."""
        if not len(self._first):
            return None
        ready = self._prepared
        if ready is None or not ready.serves(here):
            self._prepared = None  # two maps would take twice the memory
            ready = self._prepared = self._map_at(here, 0.5 * FARTHEST_M)
        return ready.streets

    def near_densest(self) -> StreetMap | None:
        """The map around the densest place: if it can be made, all others can."""
        if not len(self._first):
            return None
        lat_deg, lon_deg = self._lat_lon_deg.T
        side_deg = FARTHEST_M / _DEG_M
        narrow = np.cos(np.radians(lat_deg))
        squares = np.stack([lat_deg // side_deg, lon_deg * narrow // side_deg], axis=1)
        _, at, count = np.unique(squares, axis=0, return_index=True, return_counts=True)
        where_deg = self._lat_lon_deg[at[np.argmax(count)]]
        return self.near(Places.of_degrees(*where_deg))

    def _map_at(self, centre: Places, reach_m: float) -> _Prepared:
        here = centre.xy_m[:, 0]
        start_m, end_m = self._pieces_near(centre.utm, here)
        along = end_m - start_m
        length_m = np.hypot(*along.T)
        is_street = (length_m > 0.0) & (length_m <= _LONGEST_M)
        lengths = np.ceil(length_m / _LENGTH_M)
        if np.sum(lengths[is_street]) > _MOST_LENGTHS:
            apart_m = np.hypot(*(0.5 * (start_m + end_m) - here).T)
            order = np.argsort(np.where(is_street, apart_m, np.inf), kind="stable")
            fits = order[np.cumsum(lengths[order]) <= _MOST_LENGTHS]
            is_street[np.setdiff1d(np.arange(len(order)), fits)] = False
            reach_m = min(reach_m, 0.5 * float(np.max(apart_m[is_street])))
        pieces = np.hstack([start_m, end_m])[is_street]
        return _Prepared(centre, reach_m, StreetMap(pieces.reshape(-1, 2, 2)))

    def _pieces_near(self, utm: Utm, here: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both ends, in metres, of the straight pieces of all lines that come near."""
        corner_m = here + FARTHEST_M * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        corner_deg = Places.of(*corner_m.T, utm=utm).lat_lon_deg.T
        low, high = (
            bound.reduceat(self._lat_lon_deg, self._first) for bound in (np.minimum, np.maximum)
        )
        is_near = (low < np.max(corner_deg, axis=0)) & (high > np.min(corner_deg, axis=0))
        count = np.diff(np.append(self._first, len(self._lat_lon_deg)))
        is_point = np.repeat(np.all(is_near, axis=1), count)
        last = np.cumsum(count) - 1
        is_start = is_point.copy()
        is_start[last] = False
        k = np.flatnonzero(is_start)
        point_m = np.full((len(self._lat_lon_deg), 2), np.nan)
        near = np.flatnonzero(is_point)
        for some in np.split(near, np.arange(_MOST_AT_ONCE, len(near), _MOST_AT_ONCE)):
            point_m[some] = Places.of_degrees(*self._lat_lon_deg[some].T, utm=utm).xy_m.T
        return point_m[k], point_m[k + 1]
