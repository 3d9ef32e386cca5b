"""One walk of one policy through one world, by the engine of `postproc guide`."""

from itertools import pairwise
from math import hypot
from time import process_time
from typing import NamedTuple, Protocol

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.street_atlas import Line
from logger.core.model.prior import Prior
from logger.core.places import Utm
from postproc.guidance.filter import GuideFilter, GuideLine

from .ground import Ground, Node, Way
from .policies import POLICIES, Walker, nearest_way

PASS_M = 50.0
START_LAT_LON = (52.5, 13.4)
_FIRST_READINGS = 3


class Surroundings(Protocol):
    """A world to walk in, simulated or measured; distances in metres from its origin.

    `slack_m` is allowed for the surveyed place of the transmitter.
    """

    seed: int
    noise: str
    ground: str
    trap: str
    longest_m: float
    rat: str
    slack_m: float
    emitter_m: FloatArray
    walked_m: float

    def crossings(self) -> Ground: ...
    def street_lines_m(self) -> list[FloatArray]: ...
    def emitters_now(self) -> FloatArray: ...
    def stand(self, here_m: FloatArray) -> FloatArray: ...
    def walk(self, node: Node, way: Way) -> FloatArray: ...


class Outcome(NamedTuple):
    """How a walk ended.

    `error_m` is that of the position shown, `is_inside` whether the transmitter is within its 95 %
    radius. `located_m`, `is_wrong` and `passed_m` are None where that did not happen.
    """

    policy: str
    noise: str
    ground: str
    trap: str
    seed: int
    start_m: float
    error_m: float
    is_inside: bool
    located_m: float | None
    is_wrong: bool | None
    passed_m: float | None
    walked_m: float
    slowest_row_ms: float


class Loop:
    """The walker, the world and the filter of one walk.

    `rows` are those that the filter has taken, `answer` is its last one.
    """

    def __init__(self, world: Surroundings, policy: str) -> None:
        self.world, self._policy = world, policy
        self._ground = world.crossings()
        rng = np.random.default_rng([world.seed, 5])
        self._walker = Walker(self._ground, rng, self._ground.start())
        self._utm = Utm.at(*START_LAT_LON)
        self._start_m = np.array(self._utm.to_xy(*START_LAT_LON))
        self._walker.origin_m = self._start_m
        lines = self._lines() if policy == "routes, street map" else []
        self.filter = GuideFilter(Prior(), lines=lines)
        self._reading = np.zeros((0, 4))
        self.answer = GuideLine(None)
        self.rows: list[dict[str, str]] = []
        self._slowest_s = 0.0

    def run(self, *, stops_when_located: bool) -> Outcome:
        """Walk until the end."""
        world, walker = self.world, self._walker
        located_m = is_wrong = passed_m = None
        start = self._ground.at_m(walker.node)
        for _ in range(_FIRST_READINGS):
            self._hear(world.stand(start))
        while world.walked_m < world.longest_m:
            walker.hear(self._reading)
            way = self._next_way()
            rows = world.walk(walker.node, way)
            walker.go(way)
            self._hear(rows)
            emitter_m = world.emitters_now()
            if passed_m is None and self._nearest_m(way.line_m, emitter_m) < PASS_M:
                passed_m = world.walked_m
            if located_m is None and self.answer.verdict == "located":
                located_m, is_wrong = world.walked_m, not self._is_inside()
                if stops_when_located:
                    break
        return Outcome(
            self._policy,
            world.noise,
            world.ground,
            world.trap,
            world.seed,
            start_m=round(hypot(*(world.emitter_m[0] - start)), 1),
            error_m=round(self.error_m(), 1),
            is_inside=self._is_inside(),
            located_m=located_m,
            is_wrong=is_wrong,
            passed_m=passed_m,
            walked_m=round(world.walked_m),
            slowest_row_ms=round(1e3 * self._slowest_s, 1),
        )

    def stop(self, seconds: int) -> None:
        """Stand at the end with a position a second and hear nothing more."""
        t_s = float(self.rows[-1]["t_s"])
        for k in range(1, seconds + 1):
            row = {**self.rows[-1], "t_s": f"{t_s + k:.2f}", "rssi_dbm": ""}
            self.rows.append(row)
            self.answer = self.filter.answer(row)

    def _next_way(self) -> Way:
        walker, policy = self._walker, self._policy
        if policy in POLICIES:
            walker.best_m = self._best_m()
            if policy == "one leg":
                walker.posterior = self.filter.locator.last_search()
            return POLICIES[policy](walker)
        advice = self.answer.next
        if advice is None:
            return walker.ahead()
        return nearest_way(walker, advice.azimuth_deg, advice.distance_m)

    def _hear(self, rows: FloatArray) -> None:
        self._reading = np.concatenate([self._reading, rows[np.isfinite(rows[:, 3])]])
        for t_s, x_m, y_m, level_dbm in rows:
            lat_deg, lon_deg = self._utm.to_latlon(*(self._start_m + np.array([x_m, y_m])))
            row = {
                "t_s": f"{t_s:.2f}",
                "lat": f"{lat_deg:.7f}",
                "lon": f"{lon_deg:.7f}",
                "rssi_dbm": "" if np.isnan(level_dbm) else f"{level_dbm:.2f}",
                "rat": self.world.rat,
            }
            self.rows.append(row)
            begun_s = process_time()
            self.answer = self.filter.answer(row)
            self._slowest_s = max(self._slowest_s, process_time() - begun_s)

    def _best_m(self) -> FloatArray | None:
        best = self.answer.best
        return best and self.from_start_m(*self._utm.to_xy(best.lat, best.lon))

    def from_start_m(self, x_m: float, y_m: float) -> FloatArray:
        """A place of the filter's UTM zone, shape (2,), as the world has it."""
        return np.array([x_m, y_m]) - self._start_m

    def error_m(self) -> float:
        """Distance from the position shown to the nearest transmitter."""
        best_m = self._best_m()
        if best_m is None:
            return float("inf")
        return min(hypot(*(best_m - one)) for one in self.world.emitters_now())

    def _is_inside(self) -> bool:
        best = self.answer.best
        return best is not None and self.error_m() <= best.r95_m + self.world.slack_m

    def _nearest_m(self, line_m: FloatArray, emitter_m: FloatArray) -> float:
        along = np.linspace(0.0, 1.0, 21)
        parts = [start + along[:, None] * (end - start) for start, end in pairwise(line_m)]
        point_m = np.concatenate(parts)
        return min(float(np.min(np.hypot(*(point_m - one).T))) for one in emitter_m)

    def _lines(self) -> list[Line]:
        return [
            [self._utm.to_latlon(*(self._start_m + point)) for point in line_m]
            for line_m in self.world.street_lines_m()
        ]
