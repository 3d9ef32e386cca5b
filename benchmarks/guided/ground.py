"""Where a walker may go from a crossing, the same for streets and for open ground."""

from collections.abc import Collection
from typing import NamedTuple, Protocol

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.street_map import StreetMap
from logger.core.places import Places

LEG_M = 100.0
DIRECTIONS = 8

Node = int | tuple[float, float]
"""Number of a crossing, or east and north in metres on open ground."""


class Way(NamedTuple):
    """A leg to another node, along `line_m` (k, 2)."""

    to: Node
    line_m: FloatArray


class Ground(Protocol):
    """Nodes, their positions, and the ways between them."""

    def start(self) -> Node: ...
    def at_m(self, node: Node) -> FloatArray: ...
    def ways(self, node: Node) -> list[Way]: ...
    def is_tried(self, node: Node, way: Way, walked: Collection[tuple[Node, Node]]) -> bool: ...
    def route(self, node: Node, to: Node) -> Way: ...


class Streets:
    """The crossings of a map."""

    def __init__(self, streets: StreetMap) -> None:
        self._streets = streets

    def start(self) -> Node:
        return self._streets.nearest_crossing(Places.of(0.0, 0.0))

    def at_m(self, node: Node) -> FloatArray:
        return self._streets.crossing_m[number_of(node)]

    def ways(self, node: Node) -> list[Way]:
        return [Way(leg.end, leg.line_m) for leg in self._streets.leaving[number_of(node)]]

    def is_tried(self, node: Node, way: Way, walked: Collection[tuple[Node, Node]]) -> bool:
        return (node, way.to) in walked or (way.to, node) in walked

    def route(self, node: Node, to: Node) -> Way:
        """The first way of the shortest route."""
        first = self._streets.leaving[number_of(node)]
        legs = self._streets.shortest(first, 6000.0).get(number_of(to))
        leg = first[0] if legs is None else legs[0]
        return Way(leg.end, leg.line_m)


class OpenGround:
    """Steps of 100 m in eight directions; what is within 65 m of a node has been tried."""

    def start(self) -> Node:
        return (0.0, 0.0)

    def at_m(self, node: Node) -> FloatArray:
        return np.asarray(node, float)

    def ways(self, node: Node) -> list[Way]:
        angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        return [self.step(node, float(angle)) for angle in angles]

    def step(self, node: Node, angle: float, length_m: float = LEG_M) -> Way:
        """A step in any direction, clockwise from north in radians."""
        here = np.asarray(node, float)
        there = here + length_m * np.array([np.sin(angle), np.cos(angle)])
        to = (round(float(there[0]), 3), round(float(there[1]), 3))
        return Way(to, np.stack([here, np.array(to)]))

    def is_tried(self, _node: Node, way: Way, walked: Collection[tuple[Node, Node]]) -> bool:
        seen = np.array([one for pair in walked for one in pair]).reshape(-1, 2)
        return bool(len(seen)) and float(np.min(np.hypot(*(seen - way.to).T))) < 65.0

    def route(self, node: Node, to: Node) -> Way:
        east_m, north_m = self.at_m(to) - self.at_m(node)
        away_m = float(np.hypot(east_m, north_m))
        return self.step(node, float(np.arctan2(east_m, north_m)), min(max(away_m, 20.0), LEG_M))


def number_of(node: Node) -> int:
    """The number of a crossing."""
    if not isinstance(node, int):
        raise TypeError("a crossing of streets is a number")
    return node
