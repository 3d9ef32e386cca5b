"""What every picture of a run shows, in metres east and north of the first fix."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.censoring import levels_dbm
from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.region import Squares
from logger.core.locator.rivals import relevant_modes, share_text, whole_percents
from logger.core.observations import MAX_GAP_S, Track, times_ns
from logger.core.runfile import Run
from logger.core.timebase import TimeBase, fit_run
from postproc.estimators.region_outline import outline
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.result import CellResult, ObservedRun

Rings = list[FloatArray]
"""Outline of a region: closed rings of shape (k, 2), outer ones counterclockwise, holes
clockwise.
"""

_LEAST_WALK_M = 100.0
_MOST_WALKS = 4.0
"""A region wider than this many walks would make a dot of the walk, and is left to reach out of the
picture.
"""
_MARGIN = 0.08


class Box(NamedTuple):
    """Rectangle in local metres."""

    west: float
    south: float
    east: float
    north: float

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

    def wider(self, by_m: float) -> "Box":
        """With a margin on every side."""
        return Box(self.west - by_m, self.south - by_m, self.east + by_m, self.north + by_m)

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a place lies inside."""
        return self.west <= x_m <= self.east and self.south <= y_m <= self.north


class Levels(NamedTuple):
    """Levels of one cell as they were read, with or without a position; arrays of shape (n,) in
    time order.
    """

    cell: str
    t_ns: IntArray
    level_dbm: FloatArray


class Estimate(NamedTuple):
    """One estimator's last word: `x` (4,) with a local position, `p` (4, 4)."""

    key: str
    name: str
    colour: Colour
    x: FloatArray
    p: FloatArray


@dataclass(frozen=True, slots=True)
class Clock:
    """When a run began, and its UTC where GPS told it."""

    started_ns: int
    timebase: TimeBase | None

    def minutes(self, t_ns: IntArray) -> FloatArray:
        """Minutes since the start of the run."""
        return np.asarray((t_ns - self.started_ns) / 60e9, float)


@dataclass(frozen=True, slots=True)
class Picture:
    """A run as it is drawn.

    `focus` is the cell looked at; without a fix there is no `track` and no `box`.

    `track_m` (n, 2) are the fixes, `heard_m` (k, 2) the places where the focus was read with
    `heard_dbm` (k,); `strength_dbm` are the weakest and the strongest level of the colour scale.
    """

    run: Run
    clock: Clock
    levels: tuple[Levels, ...]
    focus: CellResult | None
    track: Track | None
    origin_m: tuple[float, float]
    track_m: FloatArray
    heard_m: FloatArray
    heard_dbm: FloatArray
    strength_dbm: tuple[float, float]
    region95: Rings
    region50: Rings
    estimates: tuple[Estimate, ...]
    truth_m: tuple[float, float] | None
    box: Box | None

    def local(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """UTM positions as local ones, shape (n, 2)."""
        return _local(x_m, y_m, self.origin_m)

    @property
    def strips_m(self) -> list[FloatArray]:
        """The walk, cut where the receiver was silent; strips of shape (n, 2)."""
        if self.track is None:
            return []
        silent = np.flatnonzero(np.diff(self.track.t_ns) > MAX_GAP_S * 1e9) + 1
        return np.split(self.track_m, silent)


def picture_of(observed: ObservedRun, focus: CellResult | None) -> Picture:
    """Gather what is drawn of a run and of the cell `focus`; an empty run gives an empty picture."""
    run, observations = observed.run, observed.observations
    track = observations.track if observations else None
    origin = (float(track.x_m[0]), float(track.y_m[0])) if track else (0.0, 0.0)
    track_m = _local(track.x_m, track.y_m, origin) if track else np.empty((0, 2))
    obs = focus.obs if focus else None
    heard_m = _local(obs.x_m, obs.y_m, origin) if obs else np.empty((0, 2))
    heard_dbm = obs.level_dbm if obs else np.empty(0)
    posterior = focus.posterior if focus else None
    region95, region50 = (
        _rings(posterior.squares, at, origin) if posterior else [] for at in (0.95, 0.5)
    )
    truth_m = _truth(observed, focus, origin)
    return Picture(
        run=run,
        clock=clock_of(run),
        levels=levels_of(run),
        focus=focus,
        track=track,
        origin_m=origin,
        track_m=track_m,
        heard_m=heard_m,
        heard_dbm=heard_dbm,
        strength_dbm=_strength(heard_dbm),
        region95=region95,
        region50=region50,
        estimates=_estimates(focus, origin),
        truth_m=truth_m,
        box=_box(np.vstack([track_m, heard_m]), region95, truth_m) if len(track_m) else None,
    )


def clock_of(run: Run) -> Clock:
    """Times of a run."""
    return Clock(run.meta.started_ns, fit_run(run.meta.origin, run.tables["fixes"]))


def focus_of(cells: Sequence[CellResult]) -> CellResult | None:
    """The cell with most to tell: located ones first, then the one with most readings."""
    return max(cells, key=lambda cell: (cell.verdict == "located", cell.n), default=None)


def headline(result: CellResult) -> str:
    """Verdict in honest words, one line."""
    posterior = result.posterior
    if result.verdict == "located" and posterior is not None:
        return (
            f"located: 95 % of the probability lie within {posterior.r95_m:.0f} m of the best place"
        )
    if result.verdict == "ambiguous" and posterior is not None:
        places = relevant_modes(posterior.modes)
        shares = ", ".join(f"{share}%" for share in whole_percents(places)[:4])
        return (
            f"ambiguous: {len(places)} places fit ({shares}); 95 % radius {posterior.r95_m:.0f} m"
        )
    why = result.warnings[0] if result.warnings else "the readings do not hold the answer"
    return f"{result.verdict}: {why}"


def mode_label(posterior: Posterior, mode: Mode) -> str:
    """Share of the probability of one place among several; "100 %" of a single one would look like
    certainty.
    """
    return share_text(mode.probability) if len(posterior.modes) > 1 else ""


def levels_of(run: Run) -> tuple[Levels, ...]:
    """Levels of every cell with a name, most readings first; a reading is dated to the middle of
    its scan.
    """
    readings = run.tables["readings"]
    level, t_ns = levels_dbm(readings), times_ns(run.tables["scans"], readings)
    kept = np.isfinite(level) & (readings["cell"] != b"")
    names, which = np.unique(readings["cell"][kept], return_inverse=True)
    order = np.lexsort((t_ns[kept], which))
    starts = np.searchsorted(which[order], np.arange(1, len(names)))
    parts = zip(names, *(np.split(v[kept][order], starts) for v in (t_ns, level)), strict=False)
    cells = [
        Levels(name.decode("utf-8", "replace"), times, values) for name, times, values in parts
    ]
    return tuple(sorted(cells, key=lambda cell: -len(cell.t_ns)))


def nice_step(span: float, most: int) -> float:
    """A step of 1, 2 or 5 times a power of ten that divides `span` into at most `most` parts."""
    if span <= 0.0:
        return 1.0
    power = 10.0 ** floor(log10(span / most))
    return next(
        step for step in (power, 2 * power, 5 * power, 10 * power) if span / step <= most + 1e-9
    )


def _local(x_m: FloatArray, y_m: FloatArray, origin_m: tuple[float, float]) -> FloatArray:
    return np.column_stack([x_m - origin_m[0], y_m - origin_m[1]])


def _strength(level_dbm: FloatArray) -> tuple[float, float]:
    """Ends of the colour scale: the levels but for the outermost 2 %, whole dBm, never equal."""
    finite = level_dbm[np.isfinite(level_dbm)]
    if not len(finite):
        return -110.0, -50.0
    low, high = np.percentile(finite, (2.0, 98.0))
    return float(np.floor(low)), float(max(np.ceil(high), np.floor(low) + 1.0))


def _rings(cells: Squares, level: float, origin_m: tuple[float, float]) -> Rings:
    parts = outline(cells, level)
    return [
        np.asarray(ring.coords, float) - origin_m
        for part in parts
        for ring in (part.exterior, *part.interiors)
    ]


def _estimates(focus: CellResult | None, origin_m: tuple[float, float]) -> tuple[Estimate, ...]:
    """Last state of each estimator that has a finite one."""
    if focus is None:
        return ()
    found = []
    for key, name, colour, filtered in (
        ("ekf", "EKF", colours.EKF, focus.ekf),
        ("rts", "RTS", colours.RTS, focus.rts),
        ("reference", "reference EKF (wrong)", colours.REFERENCE, focus.reference),
    ):
        if filtered is not None and len(filtered):
            found.append((key, name, colour, filtered.x[-1, :4], filtered.p[-1, :4, :4]))
    if focus.batch is not None:
        found.append(
            ("batch", "least squares", colours.BATCH, focus.batch.state, focus.batch.covariance)
        )
    shift = np.array([*origin_m, 0.0, 0.0])
    return tuple(
        Estimate(key, name, colour, x - shift, p)
        for key, name, colour, x, p in found
        if np.all(np.isfinite(x)) and np.all(np.isfinite(p))
    )


def _truth(
    observed: ObservedRun, focus: CellResult | None, origin_m: tuple[float, float]
) -> tuple[float, float] | None:
    observations = observed.observations
    known = next((t for t in observed.run.meta.truth if focus and t.cell == focus.cell), None)
    if known is None or observations is None:
        return None
    x_m, y_m = observations.track.utm.to_xy(known.lat_deg, known.lon_deg)
    return x_m - origin_m[0], y_m - origin_m[1]


def _box(track_m: FloatArray, region: Rings, truth_m: tuple[float, float] | None) -> Box:
    """The walk, and around it the region and the truth as far as they do not make it small."""
    box = _around(track_m)
    walk_m = max(box.size, _LEAST_WALK_M)
    box = _squarer(box.wider(0.5 * (walk_m - box.size)))
    more = [np.vstack(region)] if region else []
    if truth_m is not None:
        more.append(np.array([truth_m]))
    for points in more:
        wider = _around(np.vstack([points, [(box.west, box.south), (box.east, box.north)]]))
        if wider.size <= _MOST_WALKS * walk_m:
            box = wider
    return _squarer(box.wider(_MARGIN * box.size))


def _squarer(box: Box) -> Box:
    """With the shorter side at least half the longer one, so that a straight walk has a picture
    too.
    """
    lack_x, lack_y = (max(0.5 * box.size - side, 0.0) / 2.0 for side in (box.width, box.height))
    return Box(box.west - lack_x, box.south - lack_y, box.east + lack_x, box.north + lack_y)


def _around(points_m: FloatArray) -> Box:
    (west, south), (east, north) = points_m.min(axis=0), points_m.max(axis=0)
    return Box(float(west), float(south), float(east), float(north))
