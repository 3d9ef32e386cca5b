"""When to plan, and the advice that the walker follows until the next one."""

from math import hypot
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.clusters import clusters
from logger.core.guidance.forecast import Forecaster
from logger.core.guidance.planner import Course, Plan, azimuth_deg, plan, turn_deg
from logger.core.guidance.routes import Route, compass_routes
from logger.core.guidance.sample import draw
from logger.core.guidance.street_map import StreetMap
from logger.core.guidance.street_routes import street_routes
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import Tree

AGAIN_M = 25.0
"""A new plan is due after this much walking: a quarter of a block."""
_TRACK_STEP_M = 8.0
"""Points of the track: farther apart than the errors of two fixes in a row."""
_COURSE_M = 20.0
"""The course is the direction of the last metres: fewer are within the errors of fixes."""
_LATEST_M = 60.0
"""The end of the track is not an earlier part of it."""
_TURN_DEG = 25.0
"""A corner of more than this is where the walker turns; a smaller one is a bend of the street."""
LEAST_NATS_PER_KM = 0.5
"""Less than this is not worth walking for."""


class Advice(NamedTuple):
    """Walk to `x_m, y_m`; None as its plan means that no way near here says more."""

    x_m: float
    y_m: float
    plan: Plan


class Guide:
    """Follows the walker and plans the way for one cell; `advice` is the latest."""

    def __init__(self, streets: StreetMap | None = None) -> None:
        self._streets = streets
        self._track: list[tuple[float, float]] = []
        self._planned_m: tuple[float, float] | None = None
        self._plans = 0
        self.advice: Advice | None = None

    def walk(self, x_m: float, y_m: float) -> None:
        """Take a position of the walker."""
        self._here = (x_m, y_m)
        if not self._track or hypot(x_m - self._track[-1][0], y_m - self._track[-1][1]) >= _TRACK_STEP_M:
            self._track.append(self._here)

    @property
    def is_due(self) -> bool:
        """Whether the walker has come far enough for a new plan."""
        if self._planned_m is None:
            return True
        return hypot(self._here[0] - self._planned_m[0], self._here[1] - self._planned_m[1]) >= AGAIN_M

    def decide(self, task: LocatorInput, tree: Tree) -> None:
        """Plan from the posterior that is known now."""
        self._planned_m = self._here
        self._plans += 1
        prior = task.walk.prior
        mixed = tree.mixture(prior)
        sample = draw(task, tree, mixed, self._plans)
        forecaster = Forecaster(sample, task.walk.blocks, prior)
        places = clusters(tree.squares, mixed.probability, self._here)
        routes: list[Route] = []
        if self._streets is not None:
            routes = street_routes(self._streets, self._here, places)
        has_map = bool(routes)
        routes = routes or compass_routes(self._here, places)
        best = plan(forecaster, routes, self._course(), has_map=has_map)
        if best.nats_per_km < LEAST_NATS_PER_KM:
            self.advice = None
            return
        target = _first_turn(best.route)
        self.advice = Advice(float(target[0]), float(target[1]), best)

    def _course(self) -> Course:
        track = np.array([*self._track, self._here])
        along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
        before = track[along_m <= along_m[-1] - _COURSE_M]
        azimuth = None if not len(before) else azimuth_deg(before[-1].tolist(), self._here)
        return Course(azimuth, track[along_m < along_m[-1] - _LATEST_M])


def _first_turn(route: Route) -> FloatArray:
    corner = route.corner_m
    first = azimuth_deg(corner[0].tolist(), corner[1].tolist())
    for here, after in zip(corner[1:], corner[2:], strict=False):
        if abs(turn_deg(first, azimuth_deg(here.tolist(), after.tolist()))) > _TURN_DEG:
            return here
    return corner[-1]
