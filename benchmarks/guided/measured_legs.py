"""Measured walks past one surveyed transmitter, cut into legs among which a policy chooses.

The readings of all walks past a transmitter are gathered around crossings about 80 m apart; what
was measured on the way from one to the next is a leg. A policy walks from crossing to crossing and
hears what was measured there; a leg that was measured once and is walked again says nothing new.
"""

import csv
import json
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import cached_property, partial
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, shortest_path

from logger.core.arrays import FloatArray, IntArray
from logger.core.places import Utm

from .ground import Node, Way, number_of
from .world import SPEED_MPS

LONGEST_M = 2000.0
SURVEY_SLACK_M = 10.0
"""Allowed for the surveyed place and the receiver."""
_APART_M = 80.0
"""Distance of crossings."""
_AT_CROSSING_M = 40.0
"""A walk that comes closer has passed a crossing."""
_LONGEST_GAP_M, _LONGEST_LEG_M = 60.0, 170.0
"""Without a reading over a longer way, or between crossings farther apart, there is no leg."""
_DETOUR, _DETOUR_M = 1.7, 40.0
"""A walk that is longer than this times the straight way, and as much more, went elsewhere."""
_STARTS_M = (200.0, 900.0)
_FEWEST_CROSSINGS = 25
_SETS = {"kuleuven_lora_p2p": "Leuven", "powder_frs462": "Powder"}


class MeasuredLegs:
    """The legs past one transmitter, in metres from it.

    `crossing_m` (n, 2); `legs` has the readings x, y, level (k, 3) of each pair of crossings, one
    array for each time that the leg was walked.
    """

    def __init__(self, name: str, walks: Sequence[FloatArray]) -> None:
        self.name = name
        self.crossing_m = _crossings(np.concatenate(walks)[:, :2])
        self.legs: dict[tuple[int, int], list[FloatArray]] = {}
        for walk in walks:
            self._cut(walk)
        self._keep_connected()
        self.beside: dict[int, list[int]] = {}
        for start, end in self.legs:
            self.beside.setdefault(start, []).append(end)

    def _cut(self, walk: FloatArray) -> None:
        away_m = _apart_m(walk[:, :2], self.crossing_m)
        nearest = np.argmin(away_m, axis=1)
        parts = np.split(np.arange(len(walk)), np.flatnonzero(np.diff(nearest)) + 1)
        visits = [(int(nearest[part[0]]), int(part[0])) for part in parts]
        visits = [
            (crossing, int(part[np.argmin(away_m[part, crossing])]))
            for (crossing, _), part in zip(visits, parts, strict=True)
        ]
        visits = [(c, k) for c, k in visits if away_m[k, c] < _AT_CROSSING_M]
        for (start, first), (end, last) in pairwise(visits):
            readings = walk[first : last + 1]
            if start != end and self._is_leg(start, end, readings):
                self.legs.setdefault((start, end), []).append(readings[1:])
                self.legs.setdefault((end, start), []).append(readings[-2::-1])

    def _is_leg(self, start: int, end: int, readings: FloatArray) -> bool:
        straight_m = hypot(*(self.crossing_m[end] - self.crossing_m[start]))
        step_m = np.hypot(*np.diff(readings[:, :2], axis=0).T)
        return bool(
            straight_m < _LONGEST_LEG_M
            and np.max(step_m) < _LONGEST_GAP_M
            and np.sum(step_m) < _DETOUR * straight_m + _DETOUR_M
        )

    def _keep_connected(self) -> None:
        """Legs that can be reached from each other: the largest such part."""
        count = len(self.crossing_m)
        start, end = np.array(list(self.legs), int).reshape(-1, 2).T
        graph = csr_matrix((np.ones(len(start)), (start, end)), shape=(count, count))
        part = connected_components(graph, directed=False)[1]
        largest = np.argmax(np.bincount(part))
        self.legs = {pair: legs for pair, legs in self.legs.items() if part[pair[0]] == largest}

    @cached_property
    def nearest_m(self) -> float:
        """Smallest distance from any reading to the transmitter."""
        every = np.concatenate([leg for legs in self.legs.values() for leg in legs])
        return float(np.min(np.hypot(*every.T[:2])))

    @cached_property
    def predecessors(self) -> IntArray:
        """Crossing before the last on the shortest way from each to each."""
        start, end = np.array(list(self.legs)).T
        length_m = np.hypot(*(self.crossing_m[end] - self.crossing_m[start]).T)
        count = len(self.crossing_m)
        graph = csr_matrix((length_m, (start, end)), shape=(count, count))
        return np.asarray(shortest_path(graph, return_predecessors=True)[1], np.int64)

    def starts(self) -> list[int]:
        """Crossings from which the transmitter is neither near nor far."""
        low_m, high_m = _STARTS_M
        away_m = np.hypot(*self.crossing_m.T)
        return [k for k in sorted(self.beside) if low_m <= away_m[k] <= high_m]


class MeasuredGround:
    """The crossings of measured legs, as `guided.ground.Ground`."""

    def __init__(self, legs: MeasuredLegs, start: int) -> None:
        self._legs, self._start = legs, start

    def start(self) -> Node:
        return self._start

    def at_m(self, node: Node) -> FloatArray:
        return np.asarray(self._legs.crossing_m[number_of(node)], float)

    def ways(self, node: Node) -> list[Way]:
        return [self._way(node, end) for end in self._legs.beside[number_of(node)]]

    def is_tried(self, node: Node, way: Way, walked: Collection[tuple[Node, Node]]) -> bool:
        return (node, way.to) in walked or (way.to, node) in walked

    def route(self, node: Node, to: Node) -> Way:
        """The first way of the shortest route."""
        here, before = number_of(to), number_of(node)
        while self._legs.predecessors[before, here] != before:
            here = int(self._legs.predecessors[before, here])
        return self._way(node, here)

    def _way(self, node: Node, end: int) -> Way:
        return Way(end, np.stack([self.at_m(node), self.at_m(end)]))


class MeasuredWorld:
    """A walk among measured legs from one crossing on, as `guided.loop.Surroundings`."""

    ground, trap, rat = "measured", "", "other"
    longest_m, slack_m = LONGEST_M, SURVEY_SLACK_M

    def __init__(self, legs: MeasuredLegs, start: int, seed: int) -> None:
        self._legs, self._start = legs, start
        self.seed, self.noise = seed, legs.name
        self.emitter_m = np.zeros((1, 2))
        self.walked_m = 0.0
        self._times_walked: dict[tuple[int, int], int] = {}

    def emitters_now(self) -> FloatArray:
        return self.emitter_m

    def crossings(self) -> MeasuredGround:
        return MeasuredGround(self._legs, self._start)

    def street_lines_m(self) -> list[FloatArray]:
        pairs = [pair for pair in self._legs.legs if pair[0] < pair[1]]
        return [self._legs.crossing_m[list(pair)] for pair in pairs]

    def stand(self, _here_m: FloatArray) -> FloatArray:
        """Nothing was measured standing."""
        return np.zeros((0, 4))

    def walk(self, node: Node, way: Way) -> FloatArray:
        """Rows t_s, x, y, level; without a level where nothing new was measured."""
        start, end = number_of(node), number_of(way.to)
        pair = min(start, end), max(start, end)
        turn = self._times_walked[pair] = self._times_walked.get(pair, -1) + 1
        begun_m = self.walked_m
        self.walked_m += float(hypot(*(way.line_m[-1] - way.line_m[0])))
        legs = self._legs.legs[start, end]
        rows = legs[turn] if turn < len(legs) else np.array([[*way.line_m[-1], np.nan]])
        walked_m = np.linspace(begun_m, self.walked_m, len(rows) + 1)[1:]
        return np.column_stack([walked_m / SPEED_MPS, rows])


def measured_worlds(
    folder: Path, starts: int, name: str = ""
) -> Iterable[Callable[[], MeasuredWorld]]:
    """Makers of worlds; none without the traces, nor of transmitters with few crossings around.

    There are `starts` of each receiver of Powder and four times as many of Leuven's one
    transmitter. `folder` has the traces, `name` selects a set.
    """
    for number, legs in enumerate(_every(folder)):
        count = starts if legs.name.startswith(_SETS["powder_frs462"]) else 4 * starts
        if len(legs.beside) < _FEWEST_CROSSINGS or not legs.name.startswith(name):
            continue
        rng = np.random.default_rng([number, 7])
        for k, start in enumerate(rng.permutation(legs.starts())[:count].tolist()):
            yield partial(MeasuredWorld, legs, start, 1000 * number + k)


def _every(traces: Path) -> Iterable[MeasuredLegs]:
    for folder, title in _SETS.items():
        if not (traces / folder / "truth.json").is_file():
            continue
        truth = json.loads((traces / folder / "truth.json").read_text())
        walks: dict[tuple[str, str], list[FloatArray]] = {}
        for name, about in truth["traces"].items():
            day = name[:4] if title == "Powder" else ""
            source = truth["transmitters"][about["tx"]]
            utm = Utm.at(source["lat"], source["lon"])
            walk = _readings(traces / folder / about["file"], utm)
            walks.setdefault((day, about["tx"]), []).append(
                walk - [*utm.to_xy(source["lat"], source["lon"]), 0.0]
            )
        for of_one in walks.values():
            legs = MeasuredLegs(title, of_one)
            if title == "Powder" and legs.legs:
                legs.name = f"{title}, {_distance(legs.nearest_m)}"
            yield legs


def _distance(nearest_m: float) -> str:
    if nearest_m < 50.0:
        return "road within 50 m"
    return "road within 200 m" if nearest_m < 200.0 else "road farther"


def _readings(file: Path, utm: Utm) -> FloatArray:
    """Rows x, y, level; the level of LoRa without its noise where the set has it."""
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    level = "esp_dbm" if "esp_dbm" in rows[0] else "rssi_dbm"
    x_m, y_m = utm.to_xy_arrays(
        np.array([float(row["lat"]) for row in rows]), np.array([float(row["lon"]) for row in rows])
    )
    return np.column_stack([x_m, y_m, [float(row[level]) for row in rows]])


def _crossings(point_m: FloatArray) -> FloatArray:
    """Points (n, 2) that no place walked is far from, each in the middle of those nearest to it."""
    chosen: list[FloatArray] = []
    left = point_m[np.lexsort((point_m[:, 1], np.round(point_m[:, 0] / (0.5 * _APART_M))))]
    while len(left):
        chosen.append(left[0])
        left = left[np.hypot(*(left - left[0]).T) > 0.6 * _APART_M]
    crossing_m = np.array(chosen)
    for _ in range(3):
        nearest = np.argmin(_apart_m(point_m, crossing_m), axis=1)
        count = np.bincount(nearest, minlength=len(crossing_m))
        total_m = np.stack([np.bincount(nearest, v, len(count)) for v in point_m.T], axis=1)
        mean_m = total_m / np.maximum(count, 1)[:, None]
        crossing_m = np.where(count[:, None] > 0, mean_m, crossing_m)
    return crossing_m


def _apart_m(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(*(one[:, None] - other).transpose(2, 0, 1)), float)
