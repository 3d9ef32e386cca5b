"""What a recording tells: walks, the cells told in full, all cells, and claims; no word of
rerun.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.geo import Utm
from logger.core.observations import Observations, Track
from logger.core.runfile import Run
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import (
    Box,
    Levels,
    Picture,
    focus_of,
    headline,
    levels_of,
    picture_of,
)
from postproc.result import CellResult, ObservedRun, Result
from postproc.verification.run_claims import CellVerdict
from postproc.view.clock import Clock, clock_of
from postproc.view.regions import rings
from postproc.view.timeline import Step

SHARES = {"95": 0.95, "50": 0.5}
"""Regions that are drawn, by name."""


@dataclass(frozen=True, slots=True)
class Walk:
    """One run as it was walked: `t_ns` (n,) and `track_m` (n, 2) are its fixes, in metres from the
    story's origin.
    """

    name: str
    run: Run
    levels: tuple[Levels, ...]
    t_ns: IntArray
    track_m: FloatArray


@dataclass(frozen=True, slots=True)
class Subject:
    """A cell told in full: its picture, how its answer came about, and what was claimed of it.

    `regions` are the outlines of the regions that hold 95 % and 50 %, by step: closed rings (k, 2)
    in local metres.
    """

    picture: Picture
    result: CellResult
    steps: tuple[Step, ...]
    regions: dict[str, list[list[FloatArray]]]
    claims: tuple[CellVerdict, ...]

    @property
    def cell(self) -> str:
        """Its name."""
        return self.result.cell


@dataclass(frozen=True, slots=True)
class Story:
    """One recording for the viewer.

    Places are metres east and north of `origin_m` in `utm`, None without a fix.

    `cells` are those estimated, most readings first; `inks` are the colours of all that were heard.
    """

    walks: tuple[Walk, ...]
    clock: Clock
    inks: dict[str, Colour]
    cells: tuple[CellResult, ...]
    subjects: tuple[Subject, ...]
    warnings: tuple[str, ...]
    utm: Utm | None
    origin_m: tuple[float, float]
    box: Box | None

    @property
    def name(self) -> str:
        """What the viewer calls it."""
        runs = ", ".join(walk.name for walk in self.walks)
        return f"{runs} {self.subjects[0].cell}" if len(self.subjects) == 1 else runs

    def local(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """UTM positions as local ones, shape (n, 2)."""
        return np.column_stack([x_m - self.origin_m[0], y_m - self.origin_m[1]])

    def place_of(self, lat_deg: float, lon_deg: float) -> FloatArray | None:
        """A position on the plan, shape (2,); None without a plan."""
        if self.utm is None:
            return None
        x_m, y_m = self.utm.to_xy(lat_deg, lon_deg)
        return np.array([x_m - self.origin_m[0], y_m - self.origin_m[1]])

    def degrees(self, places_m: FloatArray) -> FloatArray:
        """Latitude and longitude of local places (n, 2)."""
        assert self.utm is not None
        x_m, y_m = places_m[:, 0] + self.origin_m[0], places_m[:, 1] + self.origin_m[1]
        return np.column_stack(self.utm.to_latlon_arrays(x_m, y_m))


@dataclass(frozen=True, slots=True)
class Estimated:
    """What estimating gave, of one run or of several laid end to end; `tracks` by number of the
    run.
    """

    runs: tuple[Run, ...]
    tracks: dict[int, Track]
    observations: Observations | None
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...]


def estimated(result: Result) -> Estimated:
    """One run, or several laid end to end, in the zone of the first that has a position."""
    runs = tuple(observed.run for observed in result.runs)
    observations = [(i, run.observations) for i, run in enumerate(result.runs) if run.observations]
    tracks = {i: found.track for i, found in observations}
    joined = replace(observations[0][1], track=_joined(list(tracks.values()))) if tracks else None
    cells = tuple(_with_shares(cell, runs) for cell in result.cells)
    told = [
        f"{observed.run.path.name}: {text}" if len(runs) > 1 else text
        for observed in result.runs
        for text in observed.warnings
    ]
    return Estimated(runs, tracks, joined, cells, (*result.warnings, *told))


def _with_shares(cell: CellResult, runs: Sequence[Run]) -> CellResult:
    """The answer of all runs; what each gave to it, and the answer without it, are told with the
    warnings.
    """
    told = []
    for share in cell.shares if len(cell.shares) > 1 else ():
        text = f"{runs[share.run].path.name} gave {share.n} readings"
        if share.offset_db and share.sigma_db:
            text += f", heard {share.offset_db:+.1f} ± {share.sigma_db:.1f} dB by its modem"
        without = cell.without.get(share.run)
        told.append(text if without is None else f"{text}; without it {headline(without)}")
    return replace(cell, warnings=(*cell.warnings, *told))


def chosen(found: Estimated, only: Sequence[str] | None) -> list[CellResult]:
    """The cells to be told in full: those named, else the one with most to tell."""
    if only:
        return [cell for name in dict.fromkeys(only) for cell in found.cells if cell.cell == name]
    focus = focus_of(found.cells)
    return [focus] if focus else []


def story_of(
    found: Estimated,
    subjects: Sequence[tuple[CellResult, tuple[Step, ...], tuple[CellVerdict, ...]]],
) -> Story:
    """Gather what is drawn; a run with nothing in it gives an empty story."""
    plain = _without_readings(found)
    pictures = [picture_of(plain, result) for result, _, _ in subjects] or [picture_of(plain, None)]
    origin_m = pictures[0].origin_m
    names = _names([run.path for run in found.runs])
    tracks = [found.tracks.get(i) for i in range(len(names))]
    walks = tuple(_walk(*one, origin_m) for one in zip(found.runs, names, tracks, strict=True))
    told = zip(subjects, pictures, strict=False)
    inks = _inks(
        [levels.cell for walk in walks for levels in walk.levels],
        [result.cell for result, _, _ in subjects],
    )
    return Story(
        walks=walks,
        clock=clock_of(found.runs),
        inks=inks,
        cells=found.cells,
        subjects=tuple(
            Subject(picture, result, steps, _regions(steps, origin_m), claims)
            for (result, steps, claims), picture in told
        ),
        warnings=found.warnings,
        utm=found.observations.track.utm if found.observations else None,
        origin_m=origin_m,
        box=_around([picture.box for picture in pictures if picture.box]),
    )


def _inks(heard: Sequence[str], subjects: Sequence[str]) -> dict[str, Colour]:
    """The first cell told in full in the colour of the walker, the others in turn."""
    names = [name for name in dict.fromkeys([*subjects, *heard]) if name not in subjects[:1]]
    inks = {name: colours.OTHERS[i % len(colours.OTHERS)] for i, name in enumerate(names)}
    return inks | dict.fromkeys(subjects[:1], colours.WALKER)


def _regions(
    steps: Sequence[Step], origin_m: tuple[float, float]
) -> dict[str, list[list[FloatArray]]]:
    return {
        name: [rings(step.posterior.squares, share, origin_m) for step in steps]
        for name, share in SHARES.items()
    }


def _walk(run: Run, name: str, track: Track | None, origin_m: tuple[float, float]) -> Walk:
    if track is None:
        return Walk(name, run, levels_of(run), np.zeros(0, np.int64), np.empty((0, 2)))
    track_m = np.column_stack([track.x_m - origin_m[0], track.y_m - origin_m[1]])
    return Walk(name, run, levels_of(run), track.t_ns, track_m)


def _names(paths: Sequence[Path]) -> list[str]:
    """Of the files, with a number where two are called the same: every logger has a first run."""
    names = [path.name.partition(".")[0] or path.name for path in paths]
    return [
        f"{name} ({names[:i].count(name) + 1})" if name in names[:i] else name
        for i, name in enumerate(names)
    ]


def _without_readings(found: Estimated) -> ObservedRun:
    """What pictures of single cells are made of; levels are gathered by walk, once."""
    run = found.runs[0]
    truth = tuple(dict.fromkeys(known for one in found.runs for known in one.meta.truth))
    tables = {**run.tables, "readings": run.tables["readings"][:0]}
    plain = replace(run, meta=msgspec.structs.replace(run.meta, truth=truth), tables=tables)
    return ObservedRun(plain, found.observations, found.warnings)


def _around(boxes: Sequence[Box]) -> Box | None:
    if not boxes:
        return None
    west, south = (
        min(values) for values in zip(*((box.west, box.south) for box in boxes), strict=True)
    )
    east, north = (
        max(values) for values in zip(*((box.east, box.north) for box in boxes), strict=True)
    )
    return Box(west, south, east, north)


def _joined(tracks: Sequence[Track]) -> Track:
    names = ("t_ns", "seq", "x_m", "y_m", "sigma_m")
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(track, name) for track in tracks]) for name in names
    }
    return replace(tracks[0], **columns)
