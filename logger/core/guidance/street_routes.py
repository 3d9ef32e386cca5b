"""Ways to consider from here along the streets of a map."""

from collections.abc import Sequence

import numpy as np

from logger.core.guidance.clusters import Cluster
from logger.core.guidance.routes import LONGEST_M, Route
from logger.core.guidance.street_map import Leg, OnStreet, StreetMap, part_of
from logger.core.places import Places

FARTHEST_STREET_M = 60.0
"""Farther than this from any street the map does not help: the walker is in a park."""
_AT_CROSSING_M = 20.0
"""This close to a crossing all its streets are open, whatever the error of the fix."""
_LEAST_M = 160.0
"""Ways are followed at least this far: two legs of ordinary streets."""
_MOST_WAYS = 60
"""Ways without a destination; where crossings are close together the first ones are enough."""


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
            onward = [leg for leg in streets.leaving[way[-1].end] if leg.end != way[-1].start]
            ways += [way, *((*way, leg) for leg in onward)]
    return [_route(way) for way in ways]


def _first_legs(streets: StreetMap, on_street: OnStreet) -> list[Leg]:
    """Both parts of the street from here on, or all streets of the crossing that is here."""
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
        onward = [leg for leg in streets.leaving[way[-1].end] if leg.end != way[-1].start]
        if sum(leg.length_m for leg in way) >= _LEAST_M or not onward:
            complete.append(way)
        else:
            waiting += [(*way, leg) for leg in onward]
    return complete + waiting


def _route(way: Sequence[Leg]) -> Route:
    parts = [way[0].line_m, *(leg.line_m[1:] for leg in way[1:])]
    return Route(np.concatenate(parts))
