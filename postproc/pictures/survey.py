"""The walks of a result in one local frame: metres east and north of the first fix."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.censoring import levels_dbm
from logger.core.locator.posterior import Mode
from logger.core.places import Utm
from logger.core.readings import times_ns
from logger.core.runfile import Run
from postproc.pictures.clock import Clock, clock_of
from postproc.pictures.geometry import split_at_gaps
from postproc.result import Result


class Levels(NamedTuple):
    """Levels of one cell, with or without a position; arrays (n,) in time order."""

    cell: str
    t_ns: IntArray
    level_dbm: FloatArray


@dataclass(frozen=True, slots=True)
class Walk:
    """One run: `t_ns` (n,) and `track_m` (n, 2) are its fixes; without a fix both are empty."""

    name: str
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

    Local positions are metres east and north of `origin_m`. `warnings` are about the runs, not
    about a cell.
    """

    walks: tuple[Walk, ...]
    clock: Clock
    utm: Utm | None
    origin_m: tuple[float, float]
    warnings: tuple[str, ...]

    @property
    def track_m(self) -> FloatArray:
        """The fixes of all walks, shape (n, 2)."""
        return np.vstack([walk.track_m for walk in self.walks])

    @property
    def is_simulated(self) -> bool:
        """Whether one of the runs is."""
        return any(walk.run.meta.truth for walk in self.walks)

    def local(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Local positions (n, 2) of UTM coordinates (n,)."""
        return np.column_stack([x_m, y_m]) - self.origin_m

    def modes_m(self, modes: Sequence[Mode]) -> FloatArray:
        """Local positions (n, 2) of modes of a posterior."""
        return np.array([(mode.x_m, mode.y_m) for mode in modes]).reshape(-1, 2) - self.origin_m

    def position_m(self, lat_deg: float, lon_deg: float) -> FloatArray:
        """Local position (2,) of latitude and longitude; one run must have a fix."""
        assert self.utm is not None
        return np.array(self.utm.to_xy(lat_deg, lon_deg)) - self.origin_m

    def degrees(self, positions_m: FloatArray) -> FloatArray:
        """Latitude and longitude (n, 2) of local positions (n, 2); one run must have a fix."""
        assert self.utm is not None
        return np.column_stack(self.utm.to_latlon_arrays(*(positions_m + self.origin_m).T))


def survey_of(result: Result) -> Survey:
    """The walks of a result, the origin at the first fix of the first run that has one."""
    runs = [observed.run for observed in result.runs]
    tracks = [observed.observations.track for observed in result.runs if observed.observations]
    origin_m = (float(tracks[0].x_m[0]), float(tracks[0].y_m[0])) if tracks else (0.0, 0.0)
    walks = []
    for observed, name in zip(
        result.runs, _distinct_names([run.path for run in runs]), strict=True
    ):
        t_ns, track_m = np.zeros(0, np.int64), np.empty((0, 2))
        if observed.observations is not None:
            track = observed.observations.track
            t_ns, track_m = track.t_ns, np.column_stack([track.x_m, track.y_m]) - origin_m
        walks.append(Walk(name, observed.run, levels_of(observed.run), t_ns, track_m))
    return Survey(
        walks=tuple(walks),
        clock=clock_of(runs),
        utm=tracks[0].utm if tracks else None,
        origin_m=origin_m,
        warnings=_warnings(result),
    )


def levels_of(run: Run) -> tuple[Levels, ...]:
    """Levels of every identified cell, most readings first, dated to the middle of their scan."""
    readings = run.tables["readings"]
    level, t_ns = levels_dbm(readings), times_ns(run.tables["scans"], readings)
    usable = np.isfinite(level) & (readings["cell"] != b"")
    names, which = np.unique(readings["cell"][usable], return_inverse=True)
    order = np.lexsort((t_ns[usable], which))
    starts = np.searchsorted(which[order], np.arange(1, len(names)))
    columns = (np.split(column[usable][order], starts) for column in (t_ns, level))
    cells = [
        Levels(name.decode("utf-8", "replace"), times, values)
        for name, times, values in zip(names, *columns, strict=False)
    ]
    return tuple(sorted(cells, key=lambda cell: -len(cell.t_ns)))


def _distinct_names(paths: Sequence[Path]) -> list[str]:
    """Names of the files, numbered where two have the same: every logger has a first run."""
    names = [path.name.partition(".")[0] or path.name for path in paths]
    return [
        f"{name} ({names[:i].count(name) + 1})" if name in names[:i] else name
        for i, name in enumerate(names)
    ]


def _warnings(result: Result) -> tuple[str, ...]:
    failed = [f"{cell.cell}: {text}" for cell in result.cells if cell.error
              for text in cell.warnings]  # fmt: skip
    if len(result.runs) == 1:
        return (*failed, *result.warnings, *result.runs[0].warnings)
    by_run = [
        f"{observed.run.path.name}: {text}"
        for observed in result.runs
        for text in observed.warnings
    ]
    return (*failed, *result.warnings, *by_run)
