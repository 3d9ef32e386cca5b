"""Streets of a file, of which the map around the walker is made."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.geo import Utm
from logger.core.guidance.street_map import StreetMap

FARTHEST_M = 3000.0
"""Streets farther from the first position are left out: no walk of an hour gets there."""
_TOWN_M = 2.0 * FARTHEST_M
"""A file that spans no more is prepared before the first position is known."""

Line = list[tuple[float, float]]
"""Latitudes and longitudes in degrees."""


class _Prepared(NamedTuple):
    """A map, and how far from its centre it serves."""

    utm: Utm
    centre_m: FloatArray
    reach_m: float
    streets: StreetMap


class StreetAtlas:
    """The streets of a file; those of a town are prepared at once: 0.1 s for 1000 streets."""

    def __init__(self, lines: Sequence[Line]) -> None:
        self._lat_lon_deg = np.array([point for line in lines for point in line], float)
        self._first = np.cumsum([0, *(len(line) for line in lines)])[:-1]
        self._prepared: _Prepared | None = None
        if not lines:
            return
        utm = Utm.at(*lines[0][0])
        point_m = self._points(utm)
        low, high = np.min(point_m, axis=0), np.max(point_m, axis=0)
        if np.all(high - low <= _TOWN_M):
            streets = StreetMap(np.split(point_m, self._first[1:]))
            self._prepared = _Prepared(utm, 0.5 * (low + high), np.inf, streets)

    def near(self, utm: Utm, x_m: float, y_m: float) -> StreetMap | None:
        """The streets around a walk that is here; None of an empty file."""
        if not len(self._first):
            return None
        here = np.array([x_m, y_m])
        ready = self._prepared
        if ready is None or ready.utm != utm or np.hypot(*(here - ready.centre_m)) > ready.reach_m:
            streets = StreetMap(self._lines_near(utm, here))
            ready = self._prepared = _Prepared(utm, here, 0.5 * FARTHEST_M, streets)
        return ready.streets

    def _lines_near(self, utm: Utm, here: FloatArray) -> list[FloatArray]:
        point_m = self._points(utm)
        low, high = (bound.reduceat(point_m, self._first) for bound in (np.minimum, np.maximum))
        is_near = np.all((low < here + FARTHEST_M) & (high > here - FARTHEST_M), axis=1)
        lines_m = np.split(point_m, self._first[1:])
        return [lines_m[k] for k in np.flatnonzero(is_near)]

    def _points(self, utm: Utm) -> FloatArray:
        return np.stack(utm.to_xy_arrays(*self._lat_lon_deg.T), axis=1)
