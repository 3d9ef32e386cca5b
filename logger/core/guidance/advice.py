"""When to plan, and the advice that the walker follows until the next one."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.certainty import relevant_modes
from logger.core.guidance.forecast import Forecaster
from logger.core.guidance.planner import Course, azimuth_deg, first_turn, plans
from logger.core.guidance.routes import Route, compass_routes, street_routes
from logger.core.guidance.sample import Cluster, clusters, draw
from logger.core.guidance.sentence import sentence
from logger.core.guidance.street_map import StreetMap, along_line_m
from logger.core.locator.posterior import Mode
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import Tree
from logger.core.locator.summary import summarise
from logger.core.places import Places, join_places

AGAIN_M = 25.0
"""A new plan is due after this much walking: a quarter of a block."""
LEAST_NATS_PER_KM = 0.5
"""Less than this is not worth walking for, once one place is likely."""

_TRACK_STEP_M = 8.0
"""Points of the track: farther apart than the errors of two fixes in a row."""
_COURSE_M = 20.0
"""The course is the direction of the last metres; fewer are within the errors of fixes."""
_LATEST_M = 60.0
"""The end of the track is not an earlier part of it."""
_NEAR_M, _AROUND_M = 300.0, 150.0
"""Within this distance of the likeliest place the way is planned for the places around it."""
_LIKELY = 0.5
"""A place with so much of the probability is likelier than all others together."""


class Advice(NamedTuple):
    """Walk from `start` to `end`; `why` is the reason, which is part of `text`."""

    start: Places
    end: Places
    nats_per_km: float
    text: str
    why: str


class Guide:
    """Plans the way of one walker for the cell that is followed.

    `advice` is the latest: None before the first plan, and where one place is likely and no way
    near here says more.
    """

    def __init__(self, streets: StreetMap | None = None) -> None:
        self._streets = streets
        self._track: list[Places] = []
        self._here: Places | None = None
        self._planned: Places | None = None
        self._plans = 0
        self.advice: Advice | None = None

    def walk(self, here: Places) -> None:
        """Take a place of the walker."""
        self._here = here
        if not self._track or here.away_m(self._track[-1]) >= _TRACK_STEP_M:
            self._track.append(here)

    @property
    def is_due(self) -> bool:
        """Whether the walker has come far enough for a new plan."""
        if self._here is None:
            return False
        return self._planned is None or self._here.away_m(self._planned) >= AGAIN_M

    def decide(self, task: LocatorInput, tree: Tree, modes: Sequence[Mode] | None = None) -> None:
        """Plan from the posterior that is known now; `modes` are the answer's."""
        here = self._here
        if here is None:
            return
        self._planned = here
        self._plans += 1
        mixed = tree.mixture(task.walk.prior)
        places = clusters(tree.squares, mixed.probability, here)
        near = _near_place(tree, mixed.probability, places, here)
        sample = draw(task, tree, mixed, self._plans, near)
        routes: list[Route] = []
        if self._streets is not None:
            routes = street_routes(self._streets, here, places)
        has_map = bool(routes)
        routes = routes or compass_routes(here, places)
        course = self._course(here)
        forecaster = Forecaster(sample, task.walk.blocks, task.walk.prior)
        best = plans(forecaster, routes, course, has_map=has_map)[0]
        says_little = best.nats_per_km < LEAST_NATS_PER_KM
        if says_little and places and places[0].probability >= _LIKELY:
            self.advice = None
            return
        first = best.route.corner_m[0]
        target = first_turn(best.route)
        distance_m = float(np.hypot(*(target - first)))
        modes = relevant_modes(summarise(task, tree).modes if modes is None else modes)
        named = [mode.place for mode in modes]
        text, why = sentence(best, sample, named, course.azimuth_deg, distance_m, task.mean_dbm)
        if says_little:  # the position is open, so the search has to go on
            why = "no way near here says much"
            text += f"; {why}"
        start, end = (Places.of(*corner, utm=here.utm) for corner in (first, target))
        self.advice = Advice(start, end, best.nats_per_km, text, why)

    def _course(self, here: Places) -> Course:
        track = join_places([*self._track, here]).xy_m.T
        along_m = along_line_m(track)
        before = track[along_m <= along_m[-1] - _COURSE_M]
        azimuth = azimuth_deg(track[-1] - before[-1]) if len(before) else None
        return Course(azimuth, track[along_m < along_m[-1] - _LATEST_M])


def _near_place(
    tree: Tree, probability: FloatArray, places: Sequence[Cluster], here: Places
) -> BoolArray | None:
    """Squares (h,) near the likeliest place, if the walker is near and it holds half.

    The tail far away would otherwise decide where to walk until the end.
    """
    if not places or here.away_m(places[0].place) > _NEAR_M:
        return None
    centre = places[0].place
    around = np.hypot(tree.x_m - centre.x_m, tree.y_m - centre.y_m) < _AROUND_M
    is_likely = float(np.sum(probability[around])) >= _LIKELY
    return np.asarray(around, np.bool_) if is_likely else None
