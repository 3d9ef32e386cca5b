"""The walks of a result in one frame and on one clock, and rectangles of what is drawn of them.

Positions are metres east and north of the first fix.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot
from typing import NamedTuple

import numpy as np

from logger.core.answer import Word
from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.certainty import OnMap
from logger.core.locator.posterior import Mode
from logger.core.places import Places, Utm
from logger.core.readings import times_ns
from logger.core.rows import levels_dbm, numbered_texts, rows_of_each
from logger.core.runfile import Run
from logger.core.runfile.meta import SIMULATED
from logger.core.timebase import TimeBase, fit_run
from logger.core.types import utc_text
from logger.sim.scenario import CITIES, SCENARIOS, scenario
from postproc.result import Result, split_at_gaps


@dataclass(frozen=True, slots=True)
class Clock:
    """Time since the start of the first run, and UTC where GPS reported it in every run.

    `starts_ns` (k,) are the starts of the runs since boot, ascending; `timebases` map each run's
    time since boot to UTC, None where that is unknown.
    """

    starts_ns: IntArray
    timebases: tuple[TimeBase | None, ...]

    @property
    def has_utc(self) -> bool:
        """Whether UTC is known for every run."""
        return None not in self.timebases

    def elapsed_ns(self, t_ns: IntArray) -> IntArray:
        """Time since the start of the first run, shape as given."""
        return t_ns - int(self.starts_ns[0])

    def minutes(self, t_ns: IntArray) -> FloatArray:
        """Minutes since the start of the first run, shape as given."""
        return np.asarray(self.elapsed_ns(t_ns) / 60e9, float)

    def utc_ns(self, t_ns: IntArray) -> IntArray | None:
        """UTC of times (n,), None where it is unknown for one of the runs."""
        by_run = [base.utc_ns_array(t_ns) for base in self.timebases if base is not None]
        if len(by_run) < len(self.timebases):
            return None
        run = np.clip(np.searchsorted(self.starts_ns, t_ns, side="right") - 1, 0, None)
        return np.asarray(np.stack(by_run)[run, np.arange(len(t_ns))], np.int64)

    def start_text(self, run: int = 0) -> str | None:
        """UTC at the start of a run (ISO 8601), None where it is unknown."""
        timebase = self.timebases[run]
        return utc_text(timebase.utc_ns(int(self.starts_ns[run]))) if timebase else None


def clock_of(runs: Sequence[Run]) -> Clock:
    """The clock of runs that follow each other."""
    return Clock(
        np.array([run.meta.started_ns for run in runs], np.int64),
        tuple(fit_run(run.meta.origin, run.tables["fixes"]) for run in runs),
    )


_LEAST_WALK_M = 100.0
"""A walk on the spot is drawn as if it were this long, or the plan would show GPS noise alone."""
_MOST_WALKS = 4.0
"""A region wider than this many walks extends outside: the walk would shrink to a dot."""
_MARGIN = 0.08
"""Free space around what is drawn, as a share of the longer side."""


class Box(NamedTuple):
    """Rectangle in local metres."""

    west: float
    south: float
    east: float
    north: float

    @classmethod
    def around(cls, points_m: FloatArray) -> "Box":
        """The smallest rectangle that contains points (n, 2)."""
        (west, south), (east, north) = points_m.min(axis=0), points_m.max(axis=0)
        return cls(float(west), float(south), float(east), float(north))

    @property
    def width(self) -> float:
        """East to west."""
        return self.east - self.west

    @property
    def height(self) -> float:
        """North to south."""
        return self.north - self.south

    @property
    def size(self) -> float:
        """The longer side."""
        return max(self.width, self.height)

    @property
    def corners_m(self) -> FloatArray:
        """South-west and north-east corner, shape (2, 2)."""
        return np.array([(self.west, self.south), (self.east, self.north)])

    @property
    def middle_m(self) -> FloatArray:
        """Shape (2,)."""
        return np.asarray(0.5 * np.sum(self.corners_m, axis=0), float)

    def shape(self, pixel_m: float) -> tuple[int, int]:
        """Rows and columns of such pixels."""
        return max(round(self.height / pixel_m), 1), max(round(self.width / pixel_m), 1)

    def enlarge(self, margin_x_m: float, margin_y_m: float | None = None) -> "Box":
        """With a margin on every side; `margin_y_m` only where it differs."""
        margin_y_m = margin_x_m if margin_y_m is None else margin_y_m
        return Box(
            self.west - margin_x_m,
            self.south - margin_y_m,
            self.east + margin_x_m,
            self.north + margin_y_m,
        )

    def apart(self, other: "Box") -> bool:
        """Whether two rectangles share nothing."""
        beside = self.east < other.west or other.east < self.west
        return beside or self.north < other.south or other.north < self.south

    def contains(self, points_m: FloatArray) -> BoolArray:
        """Whether points (..., 2) lie inside, shape (...)."""
        south_west, north_east = self.corners_m
        is_inside = (south_west <= points_m) & (points_m <= north_east)
        return np.asarray(np.all(is_inside, axis=-1), np.bool_)


def plan_box(walked_m: FloatArray, extras_m: Iterable[FloatArray]) -> Box:
    """The plan's rectangle: the walk (n, 2), and each extra (k, 2) that keeps the walk visible."""
    box = Box.around(walked_m)
    walk_m = max(box.size, _LEAST_WALK_M)
    box = _at_least_half_as_wide(box.enlarge(0.5 * (walk_m - box.size)))
    for points_m in extras_m:
        larger = Box.around(np.vstack([points_m, box.corners_m]))
        if larger.size <= _MOST_WALKS * walk_m:
            box = larger
    return _at_least_half_as_wide(box.enlarge(_MARGIN * box.size))


Inset = tuple[Box, Box]
"""What is drawn larger, and the part of the plan that it takes for that."""
_LEAST_ENLARGED = 2.0
"""Less adds nothing."""
_INSET_SIDE = 0.38
"""Side of an inset, as a share of the shorter side of the plan."""
_LEAST_INSET_M = 30.0
_MOST_COVERED = 0.01
"""Of what is drawn: a corner with more than that is not free."""


def with_inset(
    box: Box, answer_m: FloatArray | None, drawn_m: FloatArray
) -> tuple[Box, Inset | None]:
    """The plan with an inset in a free corner, or in room of its own, where the answer is small.

    `answer_m` (k, 2) is shown larger; an inset must not hide `drawn_m` (n, 2).
    """
    around = None if answer_m is None or not len(answer_m) else Box.around(answer_m)
    is_outside = around is None or not np.all(box.contains(around.corners_m))
    if around is None or is_outside:
        return box, None
    half_m = max(0.75 * around.size, 0.5 * _LEAST_INSET_M)
    side_m = _INSET_SIDE * min(box.width, box.height)
    if side_m < _LEAST_ENLARGED * 2.0 * half_m:
        return box, None
    shown = Box(*around.middle_m, *around.middle_m).enlarge(half_m)
    gap_m = 0.015 * box.size
    west, south = box.west + gap_m, box.south + gap_m
    east, north = box.east - gap_m, box.north - gap_m
    for frame in (
        Box(west, south, west + side_m, south + side_m),
        Box(east - side_m, north - side_m, east, north),
    ):
        if np.mean(frame.contains(drawn_m)) <= _MOST_COVERED and frame.apart(shown):
            return box, (shown, frame)
    south = box.south - side_m
    frame = Box(west, south, west + side_m, south + side_m)
    return Box(box.west, south - gap_m, box.east, box.north), (shown, frame)


def _at_least_half_as_wide(box: Box) -> Box:
    """With the shorter side at least half the longer one: a straight walk needs room as well."""
    margins = (0.5 * max(0.5 * box.size - side, 0.0) for side in (box.width, box.height))
    return box.enlarge(*margins)


def evenly_spaced(count: int, most: int) -> IntArray:
    """At most `most` indices out of `count`, evenly spaced, the first and the last among them."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).astype(np.int64))


class Levels(NamedTuple):
    """Levels of one cell, with or without a position; arrays (n,) in time order."""

    cell: str
    t_ns: IntArray
    level_dbm: FloatArray


@dataclass(frozen=True, slots=True)
class Walk:
    """One run: `t_ns` (n,) and `track_m` (n, 2) are its fixes; without a fix both are empty."""

    run: Run
    levels: tuple[Levels, ...]
    t_ns: IntArray
    track_m: FloatArray

    @property
    def strips_m(self) -> list[FloatArray]:
        """The track, cut where the receiver reported no fix; strips (k, 2)."""
        return split_at_gaps(self.t_ns, self.track_m)


@dataclass(frozen=True, slots=True)
class Survey:
    """The walks of a result; `utm` is None where no run has a fix.

    Local positions are metres east and north of `origin_m` (2,). `warnings` are about the runs, not
    about a cell; `words` are those of the cells where suspicion was asked. `streets_m` are the
    streets of a simulated world, lines (k, 2).
    """

    walks: tuple[Walk, ...]
    clock: Clock
    utm: Utm | None
    origin_m: FloatArray
    warnings: tuple[str, ...]
    words: Mapping[str, Word] = field(default_factory=dict)
    streets_m: Sequence[FloatArray] = ()

    def word(self, cell: str) -> str:
        """The word of a cell; empty where suspicion was not asked."""
        return self.words[cell].word if cell in self.words else ""

    @property
    def track_m(self) -> FloatArray:
        """The fixes of all walks, shape (n, 2)."""
        return np.vstack([walk.track_m for walk in self.walks])

    @property
    def levels(self) -> list[Levels]:
        """Those of every cell of each walk."""
        return [levels for walk in self.walks for levels in walk.levels]

    @property
    def is_simulated(self) -> bool:
        """Whether one of the runs is."""
        return any(walk.run.meta.truth for walk in self.walks)

    def local(self, places: Places) -> FloatArray:
        """Local positions (n, 2) of places in the zone of the survey."""
        return np.asarray(places.xy_m.T - self.origin_m, float)

    def modes_m(self, modes: Sequence[Mode]) -> FloatArray:
        """Local positions (n, 2) of modes of a posterior."""
        return np.array([(mode.x_m, mode.y_m) for mode in modes]).reshape(-1, 2) - self.origin_m

    def position_m(self, at: OnMap) -> FloatArray:
        """Local position (2,); one run must have a fix."""
        assert self.utm is not None
        local_m = self.local(Places.of_degrees(at.lat, at.lon, utm=self.utm))
        return np.asarray(local_m[0], float)

    def degrees(self, positions_m: FloatArray) -> FloatArray:
        """Latitude and longitude (n, 2) of local positions (n, 2); one run must have a fix."""
        assert self.utm is not None
        lat_deg, lon_deg = self.utm.to_latlon_arrays(*(positions_m + self.origin_m).T)
        _, middle_deg = self.utm.to_latlon(*self.origin_m)
        # on beyond 180 degrees: no line goes around the world
        lon_deg = middle_deg + (lon_deg - middle_deg + 180.0) % 360.0 - 180.0
        return np.column_stack([lat_deg, lon_deg])


def survey_of(result: Result) -> Survey:
    """The walks of a result, the origin at the first fix of the first run that has one."""
    runs = [observed.run for observed in result.runs]
    tracks = [observed.observations.track for observed in result.runs if observed.observations]
    origin_m = tracks[0].xy_m[:, 0] if tracks else np.zeros(2)
    walks = []
    for observed in result.runs:
        t_ns, track_m = np.zeros(0, np.int64), np.empty((0, 2))
        if observed.observations is not None:
            track = observed.observations.track
            t_ns, track_m = track.t_ns, track.xy_m.T - origin_m
        walks.append(Walk(observed.run, levels_of(observed.run), t_ns, track_m))
    survey = Survey(
        walks=tuple(walks),
        clock=clock_of(runs),
        utm=tracks[0].utm if tracks else None,
        origin_m=origin_m,
        warnings=_warnings(result),
        words=result.words,
    )
    return replace(survey, streets_m=_simulated_streets(survey)) if survey.utm else survey


def _simulated_streets(survey: Survey) -> list[FloatArray]:
    origins = [walk.run.meta.origin for walk in survey.walks if walk.run.meta.truth]
    names = [name.removeprefix(SIMULATED) for name in dict.fromkeys(origins)]
    (here_deg,) = survey.degrees(survey.track_m[:1])  # a run names its scenario, not its city
    nearest = min(
        CITIES, key=lambda name: hypot(*(here_deg - (CITIES[name].lat_deg, CITIES[name].lon_deg)))
    )
    return [
        np.array([survey.position_m(OnMap(lat=lat, lon=lon)) for lat, lon in street])
        for name in names
        if name in SCENARIOS
        for street in scenario(name, city_name=nearest).streets_deg()
    ]


def levels_of(run: Run) -> tuple[Levels, ...]:
    """Levels of every identified cell, most readings first, dated to the middle of their scan."""
    readings = run.named_readings
    level, t_ns = levels_dbm(readings), times_ns(run.tables["scans"], readings)
    usable = np.isfinite(level) & (readings["cell"] != b"")
    names, which = numbered_texts(readings["cell"][usable])
    t_ns, level = t_ns[usable], level[usable]
    cells = []
    for number, some in rows_of_each(which):
        rows = some[np.argsort(t_ns[some], kind="stable")]
        cells.append(Levels(names[number].decode(), t_ns[rows], level[rows]))
    return tuple(sorted(cells, key=lambda cell: -len(cell.t_ns)))


def _warnings(result: Result) -> tuple[str, ...]:
    failed = [f"{cell.cell}: {text}" for cell in result.cells if cell.error
              for text in cell.warnings]  # fmt: skip
    if len(result.runs) == 1:
        return (*failed, *result.warnings, *result.runs[0].warnings)
    by_run = [
        f"{observed.run.name}: {text}" for observed in result.runs for text in observed.warnings
    ]
    return (*failed, *result.warnings, *by_run)
