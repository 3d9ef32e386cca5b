"""Walks by waypoints at a walking speed, and the shapes that they are made of."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.certainty import OnMap
from logger.sim.world import World

Waypoints = tuple[tuple[float, float], ...]

WALKING_MPS = 1.3
BLOCK_M = 80.0
"""Distance between the streets of a random walk."""
_STEP_S = 1.0
"""How often a led walker looks at the arrow."""
CIRCLE_CORNERS = 72  # 0.1 % shorter than the circle


@dataclass(frozen=True)
class Walk:
    """From waypoint to waypoint (east, north in metres) without a stop."""

    waypoints: Waypoints
    speed_mps: float = WALKING_MPS

    @property
    def length_m(self) -> float:
        return float(self._distances_m()[-1])

    @property
    def duration_s(self) -> float:
        return self.length_m / self.speed_mps

    @property
    def streets(self) -> tuple[Waypoints, ...]:
        """The streets that its legs follow, to five blocks beyond the outermost corners."""
        corners = np.asarray(self.waypoints, float)
        low_m, high_m = corners.min(axis=0) - 5 * BLOCK_M, corners.max(axis=0) + 5 * BLOCK_M
        streets: dict[Waypoints, None] = {}
        for (east_0, north_0), (east_1, north_1) in pairwise(self.waypoints):
            if east_0 == east_1:
                streets[(east_0, float(low_m[1])), (east_0, float(high_m[1]))] = None
            elif north_0 == north_1:
                streets[(float(low_m[0]), north_0), (float(high_m[0]), north_0)] = None
            else:
                streets[(east_0, north_0), (east_1, north_1)] = None
        return tuple(streets)

    def position(self, t_s: float) -> tuple[float, float]:
        """East and north in metres."""
        east_m, north_m = self.positions(np.array([t_s]))
        return float(east_m[0]), float(north_m[0])

    def positions(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """East and north in metres, shape as given."""
        walked_m = np.asarray(t_s, float) * self.speed_mps
        corners, distances_m = self._path(float(np.max(walked_m)))
        return np.interp(walked_m, distances_m, corners[:, 0]), np.interp(
            walked_m, distances_m, corners[:, 1]
        )

    def motion(self, t_s: float) -> tuple[float, float]:
        """Speed in m/s, zero outside the walk, and course in degrees from north of the leg."""
        walked_m = t_s * self.speed_mps
        corners, distances_m = self._path(walked_m)
        leg = int(np.searchsorted(distances_m, walked_m, side="right"))
        leg = min(max(leg, 1), len(corners) - 1)
        east_m, north_m = corners[leg] - corners[leg - 1]
        course_deg = float(np.degrees(np.arctan2(east_m, north_m))) % 360.0
        return (self.speed_mps if 0.0 <= walked_m < distances_m[-1] else 0.0), course_deg

    def _path(self, _walked_m: float) -> tuple[FloatArray, FloatArray]:
        """Corners (k, 2), at least up to a distance, and the distance walked at each of them."""
        return np.asarray(self.waypoints, float), self._distances_m()

    def _distances_m(self) -> FloatArray:
        legs = np.diff(np.asarray(self.waypoints, float), axis=0)
        return np.concatenate([[0.0], np.cumsum(np.hypot(legs[:, 0], legs[:, 1]))])


class GuidedWalk(Walk):
    """A walk in a `world` that is led: `goal` is what the arrow points at now, None without one.

    Without an arrow it goes round its waypoints. Past a goal it goes straight on until there is
    another.
    """

    def __init__(
        self, waypoints: Waypoints, world: World, goal: Callable[[], OnMap | None]
    ) -> None:
        super().__init__(waypoints)
        self._world, self._goal = world, goal
        self._next = 1
        self._lock = threading.Lock()
        self._steps_m = [np.asarray(waypoints[0], float)]
        self._passed_m: FloatArray | None = None

    def _path(self, walked_m: float) -> tuple[FloatArray, FloatArray]:
        step_m = self.speed_mps * _STEP_S
        with self._lock:
            while (len(self._steps_m) - 1) * step_m <= walked_m:
                self._steps_m.append(self._step(step_m))
            steps_m = np.array(self._steps_m)
        return steps_m, step_m * np.arange(len(steps_m), dtype=float)

    def _step(self, step_m: float) -> FloatArray:
        before, here = self._steps_m[-2:][0], self._steps_m[-1]
        on_map = self._goal()
        goal = None if on_map is None else np.array(self._world.to_local(on_map.lat, on_map.lon))
        if goal is None:
            aim = np.asarray(self.waypoints[self._next], float)
            if np.hypot(*(aim - here)) <= step_m:
                self._next = (self._next + 1) % len(self.waypoints)
                return aim
        elif self._passed_m is not None and np.array_equal(goal, self._passed_m):
            aim = here + (here - before)
        else:
            aim = goal
            if np.hypot(*(aim - here)) <= step_m:
                self._passed_m = aim
                return aim
        way_m = aim - here
        return np.asarray(here + step_m * way_m / max(float(np.hypot(*way_m)), 1e-9), float)


def waypoints(shape: str, size_m: float, rng: np.random.Generator) -> Waypoints:
    """Waypoints of a named shape that begins at the origin; only "random" uses the generator.

    `size_m` is the leg of the L and of the straight walk, the side of the square and of the quarter
    of the random walk, and the diameter of the circle.
    """
    if shape not in SHAPES:
        raise ValueError(f"no walk has the shape {shape!r}; there are {', '.join(SHAPES)}")
    return SHAPES[shape](size_m, rng)


def _straight(size_m: float, _: np.random.Generator) -> Waypoints:
    return (0.0, 0.0), (size_m, 0.0)


def _l(size_m: float, _: np.random.Generator) -> Waypoints:
    return (0.0, 0.0), (0.0, size_m), (size_m, size_m)


def _square(size_m: float, _: np.random.Generator) -> Waypoints:
    return (0.0, 0.0), (0.0, size_m), (size_m, size_m), (size_m, 0.0), (0.0, 0.0)


def _circle(size_m: float, _: np.random.Generator) -> Waypoints:
    """Clockwise, beginning in the west."""
    turns = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS + 1)
    radius_m = size_m / 2.0
    return tuple(
        (float(radius_m * (1.0 - np.cos(turn))), float(radius_m * np.sin(turn))) for turn in turns
    )


def _random(size_m: float, rng: np.random.Generator) -> Waypoints:
    """Along a street grid, never straight back; six times as long as the quarter is wide."""
    blocks = max(round(size_m / BLOCK_M), 1)
    pitch_m = size_m / blocks
    path = [(0, 0)]
    while len(path) <= 6 * blocks:
        column, row = path[-1]
        around = [(column + 1, row), (column, row + 1), (column - 1, row), (column, row - 1)]
        back = path[-2] if len(path) > 1 else None
        ahead = [c for c in around if c != back and 0 <= c[0] <= blocks and 0 <= c[1] <= blocks]
        path.append(ahead[rng.integers(len(ahead))])
    return tuple((column * pitch_m, row * pitch_m) for column, row in path)


SHAPES: Mapping[str, Callable[[float, np.random.Generator], Waypoints]] = {
    "straight": _straight,
    "L": _l,
    "square": _square,
    "circle": _circle,
    "random": _random,
}


class Clock(Protocol):
    """What the simulator needs of a clock."""

    def now_ns(self) -> int:
        """Nanoseconds since any moment."""
        ...

    def wait(self, event: threading.Event, seconds: float) -> bool:
        """As `logger.device.clock.Clock.wait`."""
        ...


class WalkTime:
    """The walk begins when this is made; shared by the devices that are carried along it."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._start_ns = clock.now_ns()

    def now_s(self) -> float:
        return (self._clock.now_ns() - self._start_ns) / 1e9

    def wait_until(self, event: threading.Event, t_s: float) -> bool:
        """Sleep until the event is set (True) or it is `t_s` (False)."""
        while not event.is_set():
            left_s = t_s - self.now_s()
            if left_s <= 0.0:
                return False
            self._clock.wait(event, left_s)
        return True
