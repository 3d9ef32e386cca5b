"""Streets as crossings and the legs between them, from lines in metres."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.errors import GeoError
from logger.core.places import Places

_SNAP_M = 3.0
"""Ends of lines this close are the same crossing: maps are drawn to about a metre."""
_LONGEST_LEG_M = 130.0
"""A longer street is divided, because one may turn back halfway."""
_TILE_M = 200.0
"""Side of the squares in which streets are compared: a city has too many pairs."""
_MOST_PAIRS, _MOST_PIECES = 100_000_000, 150_000
"""Pairs that are compared, which takes 20 s on a desktop, and pieces between their crossings: a map
of an old town has a tenth of the pairs and half of the pieces."""
_TILES_NORTH = 1 << 20
"""More tiles than there are from pole to pole."""
_TOO_DENSE = "too many streets cross at one place: leave out what cannot be walked"


class Leg(NamedTuple):
    """A street from crossing `start` to crossing `end`, along `line_m` (k, 2)."""

    start: int
    end: int
    line_m: FloatArray
    length_m: float

    def opposite(self) -> "Leg":
        """The same street walked the other way."""
        return Leg(self.end, self.start, self.line_m[::-1], self.length_m)


class OnStreet(NamedTuple):
    """The point of the map nearest to the walker: `along_m` from the start of a leg."""

    leg: Leg
    along_m: float
    away_m: float


class StreetMap:
    """Crossings (n, 2) and, for each, the legs that leave it."""

    def __init__(self, lines_m: Iterable[FloatArray]) -> None:
        self.crossing_m, legs = _legs_of(_split_at_crossings(_segments(lines_m)))
        self.leaving: list[list[Leg]] = [[] for _ in self.crossing_m]
        self.legs = legs
        for leg in legs:
            self.leaving[leg.start].append(leg)
            self.leaving[leg.end].append(leg.opposite())
        # the straight pieces of all legs, leg after leg: starts and ends (s, 2), number of the leg
        self._starts = np.concatenate([np.zeros((0, 2)), *(leg.line_m[:-1] for leg in legs)])
        self._ends = np.concatenate([np.zeros((0, 2)), *(leg.line_m[1:] for leg in legs)])
        self._leg = np.repeat(np.arange(len(legs)), [len(leg.line_m) - 1 for leg in legs])

    def nearest(self, place: Places) -> OnStreet | None:
        """The nearest point of any street; None of an empty map."""
        if not len(self._starts):
            return None
        here = place.xy_m[:, 0]
        along = self._ends - self._starts
        squared = np.maximum(np.sum(along**2, axis=1), 1e-9)
        part = np.clip(np.sum((here - self._starts) * along, axis=1) / squared, 0.0, 1.0)
        away_m = np.hypot(*(self._starts + part[:, None] * along - here).T)
        k = int(np.argmin(away_m))
        leg = self.legs[self._leg[k]]
        first = int(np.searchsorted(self._leg, self._leg[k]))
        before_m = float(np.sum(np.sqrt(squared[first:k])))
        return OnStreet(leg, before_m + float(part[k] * np.sqrt(squared[k])), float(away_m[k]))

    def nearest_crossing(self, place: Places) -> int:
        """Number of the nearest crossing."""
        return int(np.argmin(np.hypot(*(self.crossing_m - place.xy_m[:, 0]).T)))

    def shortest(
        self, first: Sequence[Leg], most_m: float, ends: Iterable[int]
    ) -> dict[int, tuple[Leg, ...]]:
        """The shortest way within `most_m`, beginning with one of some legs, to each of `ends`."""
        last: dict[int, tuple[Leg, int | None]] = {}  # to a crossing, and the crossing before
        reached: list[tuple[float, int, Leg, int | None]] = [
            (leg.length_m, k, leg, None) for k, leg in enumerate(first)
        ]
        reached.sort(key=lambda one: one[:2])
        count = len(reached)
        while reached:
            length_m, _, leg, before = heappop(reached)
            here = leg.end
            if here in last or length_m > most_m:
                continue
            last[here] = leg, before
            for onward in self.leaving[here]:
                if onward.end not in last:
                    count += 1  # equal lengths: the one found first, never a comparison of arrays
                    heappush(reached, (length_m + onward.length_m, count, onward, here))
        return {end: _way(last, end) for end in ends if end in last}


def _way(last: Mapping[int, tuple[Leg, int | None]], end: int) -> tuple[Leg, ...]:
    legs: list[Leg] = []
    here: int | None = end
    while here is not None:
        leg, here = last[here]
        legs.append(leg)
    return tuple(reversed(legs))


def along_line_m(line_m: FloatArray) -> FloatArray:
    """Way from the start of a line (k, 2) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line_m, axis=0).T))])


def part_of(leg: Leg, from_m: float) -> Leg:
    """The rest of a leg from a point `from_m` along it."""
    line = leg.line_m
    along_m = along_line_m(line)
    point = [float(np.interp(from_m, along_m, v)) for v in line.T]
    rest = np.concatenate([[point], line[along_m > from_m + 1e-6]])
    return leg._replace(line_m=rest, length_m=max(float(along_m[-1]) - from_m, 0.0))


def _segments(lines_m: Iterable[FloatArray]) -> FloatArray:
    """Shape (s, 4): x, y of both ends."""
    pieces = [np.hstack([line[:-1], line[1:]]) for line in lines_m if len(line) > 1]
    every = np.concatenate([np.zeros((0, 4)), *pieces])
    length_m = np.hypot(every[:, 2] - every[:, 0], every[:, 3] - every[:, 1])
    return np.asarray(every[length_m > 0.0], float)


def _split_at_crossings(segment: FloatArray) -> FloatArray:
    """Lines may cross where neither has a point.

    A bridge is joined too; the walker sees that there is no way.
    """
    start, along = segment[:, :2], segment[:, 2:] - segment[:, :2]
    length_m = np.hypot(*along.T)
    found = []
    n_found = 0
    for k, beside in enumerate(_beside(segment)):
        origin, way, others = start[k], along[k], along[beside]
        cross = way[0] * others[:, 1] - way[1] * others[:, 0]
        is_parallel = np.abs(cross) < 1e-9 * length_m[beside] * length_m[k]
        safe = np.where(is_parallel, 1.0, cross)
        apart = start[beside] - origin
        mine = (apart[:, 0] * others[:, 1] - apart[:, 1] * others[:, 0]) / safe
        other = (apart[:, 0] * way[1] - apart[:, 1] * way[0]) / safe
        tolerance = _SNAP_M / length_m[beside]
        own_tolerance = _SNAP_M / length_m[k]
        is_on = (mine > -own_tolerance) & (mine < 1.0 + own_tolerance) & ~is_parallel
        is_on &= (other > -tolerance) & (other < 1.0 + tolerance)
        at = np.unique(np.clip(np.concatenate([[0.0, 1.0], mine[is_on]]), 0.0, 1.0))
        points = origin + at[:, None] * way
        found.append(np.hstack([points[:-1], points[1:]]))
        n_found += len(at) - 1
        if n_found > _MOST_PIECES:
            raise GeoError(_TOO_DENSE)
    return np.concatenate([np.zeros((0, 4)), *found])


def _beside(segment: FloatArray) -> Iterator[IntArray]:
    """For each piece the others that share a tile of the ground with it."""
    number, tile = _tiles(segment)
    by_tile = np.lexsort((number, tile))
    in_tile = number[by_tile]
    _, tile, count = np.unique(tile, return_inverse=True, return_counts=True)
    if np.sum(count**2) > _MOST_PAIRS:
        raise GeoError(_TOO_DENSE)
    end = np.cumsum(count)
    tiles_of = np.split(tile, np.flatnonzero(np.diff(number)) + 1)
    for k, tiles in enumerate(tiles_of if len(segment) else []):
        others = np.unique(np.concatenate([in_tile[end[t] - count[t] : end[t]] for t in tiles]))
        yield others[others != k]


def _tiles(segment: FloatArray) -> tuple[IntArray, IntArray]:
    """Each piece with each tile that it may touch: its number, in order, and that of the tile."""
    length_m = np.hypot(*(segment[:, 2:] - segment[:, :2]).T)
    parts = np.maximum(np.ceil(length_m / _TILE_M), 1.0).astype(np.int64)
    piece = np.repeat(np.arange(len(segment)), parts)
    before = (np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[piece]
    start, along = segment[piece, :2], segment[piece, 2:] - segment[piece, :2]
    one = start + before[:, None] * along
    other = one + along / parts[piece, None]
    low, high = np.minimum(one, other) - _SNAP_M, np.maximum(one, other) + _SNAP_M
    first, last = (np.floor(v / _TILE_M).astype(np.int64) for v in (low, high))
    pairs = []
    for step in ((i, j) for i in range(3) for j in range(3)):  # a part is no longer than a tile
        at = first + step
        is_touched = np.all(at <= last, axis=1)
        pairs.append(np.stack([piece, at[:, 0] * _TILES_NORTH + at[:, 1]], axis=1)[is_touched])
    number, tile = np.unique(np.concatenate(pairs), axis=0).T
    return number, tile


def _snap(point_m: FloatArray) -> tuple[FloatArray, list[int]]:
    """Nodes (n, 2), and the number of the node of each point (p, 2)."""
    nodes: list[FloatArray] = []
    in_tile: dict[tuple[int, int], list[int]] = {}
    number = []
    for point in point_m:
        i, j = (int(v) for v in np.floor(point / _SNAP_M))
        near = [
            k
            for east in (-1, 0, 1)
            for north in (-1, 0, 1)
            for k in in_tile.get((i + east, j + north), ())
            if float(np.hypot(*(nodes[k] - point))) < _SNAP_M
        ]
        if not near:
            in_tile.setdefault((i, j), []).append(len(nodes))
            near = [len(nodes)]
            nodes.append(point)
        number.append(near[0])
    return np.array(nodes).reshape(-1, 2), number


def _legs_of(segment: FloatArray) -> tuple[FloatArray, list[Leg]]:
    """Crossings (n, 2), and the legs between them; nodes of two pieces are bends of one leg."""
    node_m, number = _snap(segment.reshape(-1, 2))
    pairs = {(min(a, b), max(a, b)) for a, b in zip(number[::2], number[1::2], strict=True)}
    beside: list[list[int]] = [[] for _ in node_m]
    for a, b in sorted(pairs):
        if a != b:
            beside[a].append(b)
            beside[b].append(a)
    chains = _chains(beside)
    crossings: list[FloatArray] = []
    of_node: dict[int, int] = {}
    legs = []
    for chain in chains:
        for end in (chain[0], chain[-1]):
            if end not in of_node:
                of_node[end] = len(crossings)
                crossings.append(node_m[end])
        line_m = node_m[chain]
        legs += _divide(line_m, of_node[chain[0]], of_node[chain[-1]], crossings)
    return np.array(crossings).reshape(-1, 2), legs


def _chains(beside: list[list[int]]) -> list[list[int]]:
    """Nodes from one crossing to the next, through nodes of two pieces."""
    used: set[tuple[int, int]] = set()
    chains = []
    ends = [k for k, near in enumerate(beside) if near and len(near) != 2]
    circles = [k for k, near in enumerate(beside) if len(near) == 2]
    for start in [*ends, *circles]:  # a circle without a crossing begins anywhere
        for first in beside[start]:
            chain = [start, first]
            while (chain[-2], chain[-1]) not in used:
                used |= {(chain[-2], chain[-1]), (chain[-1], chain[-2])}
                here = chain[-1]
                if len(beside[here]) != 2 or here == start:
                    chains.append(chain)
                    break
                back = chain[-2]
                chain.append(next((k for k in beside[here] if k != back), back))
    return chains


def _divide(line_m: FloatArray, start: int, end: int, crossings: list[FloatArray]) -> list[Leg]:
    """Appends to `crossings` where the line is divided."""
    along_m = along_line_m(line_m)
    count = max(1, int(np.ceil(along_m[-1] / _LONGEST_LEG_M)))
    if count == 1 and start != end:
        return [Leg(start, end, line_m, float(along_m[-1]))]
    if count == 1:
        count = 2
    at_m = np.linspace(0.0, along_m[-1], count + 1)
    numbers = [start]
    for where_m in at_m[1:-1]:
        numbers.append(len(crossings))
        crossings.append(np.array([np.interp(where_m, along_m, v) for v in line_m.T]))
    numbers.append(end)
    legs = []
    for k in range(count):
        inside = line_m[(along_m > at_m[k] + 1e-6) & (along_m < at_m[k + 1] - 1e-6)]
        line = np.concatenate([[crossings[numbers[k]]], inside, [crossings[numbers[k + 1]]]])
        legs.append(Leg(numbers[k], numbers[k + 1], line, float(at_m[k + 1] - at_m[k])))
    return legs
