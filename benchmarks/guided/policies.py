"""Policies to compare with: without a plan, by the level, or towards the best position."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.forecast import Forecaster
from logger.core.guidance.planner import Course, azimuth_deg, plans
from logger.core.guidance.routes import Route
from logger.core.guidance.sample import draw
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import Tree

from .ground import DIRECTIONS, Ground, Node, OpenGround, Way

_NEAR_M = 35.0
"""Readings this close to a crossing are those of the crossing."""
_WALKED_BEFORE = 0.4
"""A walker takes a street that turns so much more, as a cosine, to avoid one already walked."""
_DETOUR_M_PER_DB = 100.0
_UNHEARD_DBM = -140.0
"""Of a crossing without a reading: below all that is measured."""


@dataclass
class Walker:
    """Where a walker is, where it came from, and what it has heard.

    `best_m` is the position that the locator shows, None before the first; `posterior` is what it
    is from, with the walker's origin at `origin_m`.
    """

    ground: Ground
    rng: np.random.Generator
    node: Node
    before: Node | None = None
    best_m: FloatArray | None = None
    posterior: tuple[LocatorInput, Tree] | None = None
    origin_m: FloatArray = field(default_factory=lambda: np.zeros(2))
    legs: int = 0
    heading: int | None = None
    walked: Counter[tuple[Node, Node]] = field(default_factory=Counter)
    level_dbm: dict[Node, float] = field(default_factory=dict)

    def go(self, way: Way) -> None:
        """Note a way as walked."""
        self.walked[self.node, way.to] += 1
        self.before, self.node = self.node, way.to
        self.legs += 1

    def hear(self, reading: FloatArray) -> None:
        """Note the level at the crossing from all readings so far (n, 4)."""
        x_m, y_m = self.ground.at_m(self.node)
        near = np.hypot(reading[:, 1] - x_m, reading[:, 2] - y_m) < _NEAR_M
        if np.any(near):
            self.level_dbm[self.node] = float(np.mean(reading[near, 3]))
        else:
            self.level_dbm.setdefault(self.node, _UNHEARD_DBM)

    def ways(self) -> list[Way]:
        return self.ground.ways(self.node)

    def ahead(self) -> Way:
        """The way that turns least."""
        ways = self.ways()
        if self.before is None:
            return ways[int(self.rng.integers(len(ways)))]
        came_m = self.ground.at_m(self.node) - self.ground.at_m(self.before)
        return max(ways, key=lambda way: _cosine(_direction(way), came_m))

    def any_of(self, ways: list[Way]) -> Way:
        return ways[int(self.rng.integers(len(ways)))]

    def new_ways(self, node: Node) -> list[Way]:
        ground = self.ground
        return [w for w in ground.ways(node) if not ground.is_tried(node, w, self.walked)]


def straight(walker: Walker) -> Way:
    """On along the first street."""
    return walker.ahead()


def random(walker: Walker) -> Way:
    """Any way but back."""
    onward = [way for way in walker.ways() if way.to != walker.before]
    return walker.any_of(onward or walker.ways())


def spiral(walker: Walker) -> Way:
    """A square spiral: one block, one, two, two, three, three."""
    left, side = walker.legs, 0
    while left >= 1 + side // 2:
        left -= 1 + side // 2
        side += 1
    return _heading(walker, side)


def block(walker: Walker) -> Way:
    """Around a block, then two on."""
    return _heading(walker, (0, 1, 2, 3, 0, 0)[walker.legs % 6])


def foxhunter(walker: Walker) -> Way:
    """On while it gets louder, else another way from the loudest crossing so far."""
    best = max(walker.level_dbm, key=lambda node: walker.level_dbm[node])
    if best != walker.node:
        return walker.ground.route(walker.node, best)
    fresh = walker.new_ways(walker.node)
    on = walker.ahead()
    return on if _is_among(on, fresh) else walker.any_of(fresh or walker.ways())


def fox2(walker: Walker) -> Way:
    """As the foxhunter, to the loudest crossing that has a way not yet tried.

    100 m of detour count as much as 1 dB.
    """
    here_m = walker.ground.at_m(walker.node)

    def worth(node: Node) -> float:
        away_m = hypot(*(walker.ground.at_m(node) - here_m))
        return walker.level_dbm[node] - away_m / _DETOUR_M_PER_DB

    in_order = sorted(walker.level_dbm, key=worth, reverse=True)
    best = next((node for node in in_order if walker.new_ways(node)), None)
    if best is None:
        return walker.any_of(walker.ways())
    if best != walker.node and hypot(*(walker.ground.at_m(best) - here_m)) >= _NEAR_M:
        return walker.ground.route(walker.node, best)
    fresh = walker.new_ways(walker.node)
    on = walker.ahead()
    return on if _is_among(on, fresh) else walker.any_of(fresh or walker.ways())


def approach(walker: Walker) -> Way:
    """Towards the position that the locator shows; a way walked before counts 60 m more."""
    if walker.best_m is None:
        return walker.ahead()
    best_m = walker.best_m

    def cost_m(way: Way) -> float:
        again = walker.ground.is_tried(walker.node, way, walker.walked)
        return hypot(*(way.line_m[-1] - best_m)) + 60.0 * again

    return min(walker.ways(), key=cost_m)


def one_leg(walker: Walker) -> Way:
    """The next leg with most information about the position for each metre."""
    if walker.posterior is None or walker.before is None:
        return walker.ahead()
    task, tree = walker.posterior
    sample = draw(task, tree, tree.mixture(task.walk.prior), walker.legs)
    forecaster = Forecaster(sample, task.walk.blocks, task.walk.prior)
    came_m = walker.ground.at_m(walker.node) - walker.ground.at_m(walker.before)
    course = Course(azimuth_deg(came_m), np.zeros((0, 2)))
    ways = walker.ways()
    routes = [Route(way.line_m + walker.origin_m) for way in ways]
    best = plans(forecaster, routes, course, has_map=True)[0].route
    return next(way for way, route in zip(ways, routes, strict=True) if route is best)


POLICIES: dict[str, Callable[[Walker], Way]] = {
    "random": random,
    "straight": straight,
    "spiral": spiral,
    "block": block,
    "foxhunter": foxhunter,
    "fox2": fox2,
    "approach": approach,
    "one leg": one_leg,
}
GUIDED = ("routes, compass", "routes, street map")
"""These follow the product's own advice."""


def nearest_way(walker: Walker, azimuth_deg: float, distance_m: float) -> Way:
    """The way that a walker takes who is shown an arrow: the nearest, rather one not yet walked."""
    if isinstance(walker.ground, OpenGround):
        return walker.ground.step(walker.node, np.radians(azimuth_deg), min(distance_m, 100.0))
    shown = np.array([np.sin(np.radians(azimuth_deg)), np.cos(np.radians(azimuth_deg))])

    def worth(way: Way) -> float:
        here, there = walker.node, way.to
        times = walker.walked[here, there] + walker.walked[there, here]
        return _cosine(_direction(way), shown) - _WALKED_BEFORE * times

    return max(walker.ways(), key=worth)


def _heading(walker: Walker, turn: int) -> Way:
    """The way nearest to the first direction turned by quarters of a circle."""
    if walker.heading is None:
        walker.heading = int(walker.rng.integers(DIRECTIONS // 2))
    angle = 0.5 * np.pi * (walker.heading + turn)
    shown = np.array([np.sin(angle), np.cos(angle)])
    return max(walker.ways(), key=lambda way: _cosine(_direction(way), shown))


def _direction(way: Way) -> FloatArray:
    return way.line_m[1] - way.line_m[0]


def _cosine(one: FloatArray, other: FloatArray) -> float:
    return float(one @ other / max(hypot(*one) * hypot(*other), 1e-9))


def _is_among(way: Way, ways: list[Way]) -> bool:
    return any(way.to == one.to for one in ways)
