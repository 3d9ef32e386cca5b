"""Ways to consider from here: eight directions and routes to places, or the streets of a map."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.forecast import STEP_M
from logger.core.guidance.sample import Cluster
from logger.core.guidance.street_map import Leg, OnStreet, StreetMap, along_line_m, part_of
from logger.core.places import Places

LEG_M = 100.0
"""A block of houses, after which the walker looks again at a crossing."""
LONGEST_M = 1000.0
"""A longer route is planned again long before its end."""
DIRECTIONS = 8
_STRAIGHT_LEGS = 4
"""Under shadowing two legs ahead say little, and a walker without a map would not leave."""
_RIGHT_ANGLE = 2
"""In eighths of a circle: a leg that turns more leads back."""
FARTHEST_STREET_M = 60.0
"""Farther than this from any street the map does not help: the walker is in a park."""
_AT_CROSSING_M = 20.0
"""This close to a crossing all its streets are open, whatever the fix's error."""
_LEAST_M = 160.0
"""Ways are followed at least this far: two legs of ordinary streets."""
_MOST_WAYS = 60
"""Ways without a destination; where crossings are close together the first ones are enough."""


class Route(NamedTuple):
    """Corners (k, 2) from the walker on, in metres."""

    corner_m: FloatArray

    @property
    def length_m(self) -> float:
        """Along the corners."""
        return float(np.sum(np.hypot(*np.diff(self.corner_m, axis=0).T)))

    def points(self) -> FloatArray:
        """Points (m, 2) in the middle of equal parts of about `STEP_M`."""
        along_m = along_line_m(self.corner_m)
        count = max(1, round(along_m[-1] / STEP_M))
        at_m = (np.arange(count) + 0.5) / count * along_m[-1]
        return np.stack([np.interp(at_m, along_m, v) for v in self.corner_m.T], axis=1)


def compass_routes(here: Places, places: Sequence[Cluster]) -> list[Route]:
    """Legs in all directions, a route to each place, and one leg beyond it."""
    found = [
        _legs(here, [first, first + turn])
        for first in range(DIRECTIONS)
        for turn in range(-_RIGHT_ANGLE, _RIGHT_ANGLE + 1)
    ]
    found += [_legs(here, [direction] * _STRAIGHT_LEGS) for direction in range(DIRECTIONS)]
    for place in places:
        found += _to_place(here, place)
    return found


def _legs(here: Places, directions: Sequence[int]) -> Route:
    angle = 2.0 * np.pi * np.asarray(directions, float) / DIRECTIONS
    step_m = LEG_M * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    start_m = here.xy_m.T
    return Route(np.concatenate([start_m, start_m + np.cumsum(step_m, axis=0)]))


def _to_place(here: Places, place: Cluster) -> list[Route]:
    """Straight to a place, and on from it ahead, to the right and to the left."""
    start, end = here.xy_m[:, 0], place.place.xy_m[:, 0]
    way_m = end - start
    away_m = float(np.hypot(*way_m))
    if away_m < STEP_M:
        return []
    ahead = way_m / away_m
    end = start + ahead * min(away_m, LONGEST_M)
    found = [Route(np.stack([start, end]))]
    if away_m < LONGEST_M - LEG_M:
        right = np.array([ahead[1], -ahead[0]])
        found += [Route(np.stack([start, end, end + LEG_M * on])) for on in (ahead, right, -right)]
    return found


def street_routes(streets: StreetMap, here: Places, places: Sequence[Cluster]) -> list[Route]:
    """Ways of about two legs, the shortest route to each place, and one leg beyond it.

    Empty where there is no street within `FARTHEST_STREET_M`.
    """
    on_street = streets.nearest(here)
    if on_street is None or on_street.away_m > FARTHEST_STREET_M:
        return []
    first = _first_legs(streets, on_street)
    ways = _ways(streets, first)
    ends = [streets.nearest_crossing(place.place) for place in places]
    shortest = streets.shortest(first, LONGEST_M, ends)
    for end in ends:
        way = shortest.get(end)
        if way is not None:
            ways += [way, *((*way, leg) for leg in _onward(streets, way))]
    return [_route(way) for way in ways]


def _first_legs(streets: StreetMap, on_street: OnStreet) -> list[Leg]:
    leg, along_m, _ = on_street
    if along_m < _AT_CROSSING_M:
        return streets.leaving[leg.start]
    if leg.length_m - along_m < _AT_CROSSING_M:
        return streets.leaving[leg.end]
    return [part_of(leg, along_m), part_of(leg.opposite(), leg.length_m - along_m)]


def _ways(streets: StreetMap, first: Sequence[Leg]) -> list[tuple[Leg, ...]]:
    """Ways without turning on the spot, breadth first."""
    complete: list[tuple[Leg, ...]] = []
    waiting: list[tuple[Leg, ...]] = [(leg,) for leg in first]
    while waiting and len(complete) + len(waiting) < _MOST_WAYS:
        way, *waiting = waiting
        onward = _onward(streets, way)
        if sum(leg.length_m for leg in way) >= _LEAST_M or not onward:
            complete.append(way)
        else:
            waiting += [(*way, leg) for leg in onward]
    return complete + waiting


def _onward(streets: StreetMap, way: Sequence[Leg]) -> list[Leg]:
    return [leg for leg in streets.leaving[way[-1].end] if leg.end != way[-1].start]


def _route(way: Sequence[Leg]) -> Route:
    parts = [way[0].line_m, *(leg.line_m[1:] for leg in way[1:])]
    return Route(np.concatenate(parts))
