"""Positions, regions and ellipses of each cell, as they are exported."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite

from logger.core.answer import Answer, Mode, PathEnd, Place
from logger.core.ellipse import radii_text
from logger.core.locator.region import HALF, LEVEL
from logger.core.places import Utm
from logger.core.runfile import Run
from postproc.cell_work import Failure, attempt
from postproc.interop.geometry import LonLat, Rings, ellipse, polygons
from postproc.result import BATCH, EKF, RTS, CellResult, Result
from postproc.summary import region_of

_PEERS = (EKF, RTS, BATCH)
"""Without the reference EKF, whose ellipse is wrong."""
_WIDEST_M = 50_000.0
"""GSM reaches 35 km: a wider ellipse contains no information."""


@dataclass(frozen=True, slots=True)
class NamedPosition:
    """A part of an answer by the name that it has in a file.

    `verdict` is that on the cell for the positions of the answer, None for other estimators;
    `radii_m` hold 50 % and 95 % around the first of them.
    """

    name: str
    at: Place | Mode | PathEnd
    verdict: str | None = None
    radii_m: tuple[float, float] | None = None
    ellipse95: tuple[Rings, ...] = ()

    @property
    def lon_lat(self) -> LonLat:
        """Longitude and latitude."""
        return self.at.lon, self.at.lat

    @property
    def probability(self) -> float | None:
        """That of a mode; None for an estimator with a single position."""
        return self.at.probability if isinstance(self.at, Mode) else None

    @property
    def radii_text(self) -> str:
        """The two radii in words, empty where there are none."""
        return radii_text(*self.radii_m) if self.radii_m else ""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The answer about one cell; no positions where the readings do not determine one.

    `regions` are outlines by their percentage. `left_out` names the estimators without a position,
    and why.
    """

    answer: Answer
    positions: tuple[NamedPosition, ...]
    regions: Mapping[int, tuple[Rings, ...]]
    left_out: tuple[str, ...] = ()

    @property
    def error(self) -> str | None:
        """That of the program which ended some of the work on the cell, None where none did."""
        return self.answer.provenance.error


def estimates_of(result: Result, utm: Utm, *, every: bool = False) -> list[Estimate]:
    """The answers and their regions; `utm` is the zone of the run.

    With `every` the positions and ellipses of the other estimators besides.
    """
    runs = [observed.run for observed in result.runs]
    found = []
    for cell in result.cells:
        one = attempt(cell.cell, "its export", partial(_estimate, cell, runs, utm, every))
        if isinstance(one, Failure):
            answer = cell.after(one).answer(runs)
            one = Estimate(answer, (), {}, (f"the answer about {cell.cell}: {one.reason}",))
        found.append(one)
    return found


def _estimate(cell: CellResult, runs: Sequence[Run], utm: Utm, every: bool) -> Estimate:
    regions = {}
    for percent, level in ((95, LEVEL), (50, HALF)):
        if outline := region_of(cell, level).geojson:
            regions[percent] = tuple(polygons(outline.coordinates))
    return estimate_of(cell.answer(runs), regions, utm, every=every)


def estimate_of(
    answer: Answer, regions: Mapping[int, tuple[Rings, ...]], utm: Utm, *, every: bool = False
) -> Estimate:
    """What is exported of one answer; `utm` and `every` as in `estimates_of`."""
    positions, left_out = list(_positions(answer)), []
    if every:
        for name, at in _others(answer).items():
            if why := _no_answer(at):
                left_out.append(f"{name} of {answer.cell}: {why}")
            else:
                positions.append(NamedPosition(name, at, ellipse95=_ellipse(at, utm)))
        left_out += [
            f"{estimator.name} of {answer.cell}: it did not converge"
            for estimator in _PEERS
            if answer.paths and estimator.key in answer.paths.failed
        ]
    if answer.provenance.error is not None:
        left_out.append(f"the answer about {answer.cell}: {answer.reasons[0]}")
    return Estimate(answer, tuple(positions), regions, tuple(left_out))


def _positions(answer: Answer) -> Iterator[NamedPosition]:
    """Positions that the verdict is about: several only where it is "ambiguous"."""
    place = answer.place
    if place is None:
        return
    if answer.verdict == "ambiguous":
        for i, mode in enumerate(place.likely_modes, 1):
            radii_m = (place.r50_m, place.r95_m) if i == 1 else None
            yield NamedPosition(f"possible position {i}", mode, answer.verdict, radii_m)
        return
    name = "best position" if answer.verdict == "located" else "best guess"
    yield NamedPosition(name, place, answer.verdict, (place.r50_m, place.r95_m))


def _others(answer: Answer) -> dict[str, Mode | PathEnd]:
    """Modes, and the ends of the other estimators."""
    modes = answer.place.modes if answer.place else ()
    ends = answer.paths.ends if answer.paths else {}
    named: dict[str, Mode | PathEnd] = {
        f"posterior, position {i}": mode for i, mode in enumerate(modes, 1)
    }
    return named | {one.name: ends[one.key] for one in _PEERS if one.key in ends}


def _no_answer(at: Mode | PathEnd) -> str | None:
    """Why an estimator has no position to show; None where it has one."""
    major_m = at.ellipse95.semi_major_m
    if not (isfinite(at.lat) and isfinite(major_m)):
        return "it did not converge"
    is_bounded = isinstance(at, Mode) or at.is_bounded
    if is_bounded and major_m <= _WIDEST_M:
        return None
    return "the readings do not bound it"


def _ellipse(at: Mode | PathEnd, utm: Utm) -> tuple[Rings, ...]:
    shape = at.ellipse95
    axes_m = shape.semi_major_m, shape.semi_minor_m
    return tuple(polygons([[ellipse(at.lat, at.lon, utm, axes_m, shape.azimuth_deg)]]))
