"""Positions, regions and ellipses of each cell, as they are exported."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import cos, isfinite, pi, radians, sin

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from logger.core.answer import Answer, Mode, PathEnd, Place
from logger.core.arrays import FloatArray
from logger.core.ellipse import radii_text
from logger.core.locator.region import HALF, LEVEL
from logger.core.places import Utm
from postproc.cell_work import Failure, attempt
from postproc.result import BATCH, EKF, RTS, CellResult, Result
from postproc.summary import region_of

# RFC 7946 3.1.6 and 3.1.9. A line or ring steps by less than half a turn, so its longitudes can be
# made continuous.

LonLat = tuple[float, float]
Line = list[LonLat]
Rings = list[Line]
"""Outer ring first, then holes; each closed."""

DECIMALS = 7
_ELLIPSE_POINTS = 72


def lines(points: Sequence[LonLat]) -> list[Line]:
    """A line of (lon, lat), cut at the antimeridian; none for fewer than two points."""
    if len(points) < 2:
        return []
    if all(abs(a[0] - b[0]) < 180.0 for a, b in pairwise(points)):
        line = _round(points)
        return [line] if any(point != line[0] for point in line) else []
    unwrapped = LineString(_continuous(np.asarray(points, float)))
    parts = (
        part
        for turn, strip in _strips(unwrapped)
        for part in _shift(turn, shapely.intersection(unwrapped, strip))
    )
    return [
        _round(part.coords) for part in parts if isinstance(part, LineString) and part.length > 0.0
    ]


def polygons(parts: Iterable[Sequence[Sequence[Sequence[float]]]]) -> list[Rings]:
    """Polygons, each a list of rings of (lon, lat), made valid, cut and wound by RFC 7946."""
    polygons_of_rings: list[Rings] = []
    for part in parts:
        outer = _continuous(np.asarray(part[0], float))
        holes = [_continuous(np.asarray(ring, float), outer[0, 0]) for ring in part[1:]]
        polygon = shapely.make_valid(Polygon(outer, holes))
        for turn, strip in _strips(polygon):
            for piece in _shift(turn, shapely.intersection(polygon, strip)):
                if isinstance(piece, Polygon):
                    polygons_of_rings += _rings(piece)
    return polygons_of_rings


def ellipse(
    lat_deg: float, lon_deg: float, utm: Utm, axes_m: tuple[float, float], azimuth_deg: float
) -> Line:
    """Closed ring around a position; azimuth of the major axis clockwise from grid north."""
    x_m, y_m = utm.to_xy(lat_deg, lon_deg)
    sin_a, cos_a = sin(radians(azimuth_deg)), cos(radians(azimuth_deg))
    angle = np.linspace(0.0, 2.0 * pi, _ELLIPSE_POINTS + 1)
    along_m, across_m = axes_m[0] * np.cos(angle), axes_m[1] * np.sin(angle)
    lats, lons = utm.to_latlon_arrays(
        x_m + along_m * sin_a - across_m * cos_a, y_m + along_m * cos_a + across_m * sin_a
    )
    ring = list(zip(lons.tolist(), lats.tolist(), strict=True))
    return [*ring[:-1], ring[0]]


def _continuous(points: FloatArray, near_deg: float | None = None) -> FloatArray:
    """Points with longitudes that do not jump, the first within half a turn of `near_deg`."""
    lon_deg = np.unwrap(points[:, 0], period=360.0)
    if near_deg is not None:
        lon_deg = lon_deg + 360.0 * np.round((near_deg - lon_deg[0]) / 360.0)
    return np.column_stack([lon_deg, points[:, 1]])


def _strips(shape: shapely.Geometry) -> Iterator[tuple[int, Polygon]]:
    """Turns around the Earth that a shape touches, and the strip of each."""
    west, _, east, _ = shapely.bounds(shape).tolist()
    for turn in range(int((west + 180.0) // 360.0), int((east + 180.0) // 360.0) + 1):
        yield turn, shapely.box(-180.0 + 360.0 * turn, -90.0, 180.0 + 360.0 * turn, 90.0)


def _shift(turn: int, shape: shapely.Geometry) -> Iterator[shapely.Geometry]:
    moved = shapely.transform(shape, lambda xy: xy - (360.0 * turn, 0.0)) if turn else shape
    for part in shapely.get_parts(moved).tolist():
        yield from part.geoms if isinstance(part, MultiPolygon) else (part,)


def _rings(polygon: Polygon) -> Iterator[Rings]:
    """Rings of a polygon after rounding, which may divide it or leave nothing."""
    for part in shapely.get_parts(shapely.set_precision(polygon, 10.0**-DECIMALS)).tolist():
        if isinstance(part, Polygon) and not part.is_empty:
            wound = orient(part)
            yield [_round(ring.coords) for ring in (wound.exterior, *wound.interiors)]


def _round(coordinates: Iterable[Sequence[float]]) -> Line:
    return [
        (round(lon, DECIMALS) + 0.0, round(lat, DECIMALS) + 0.0) for lon, lat, *_ in coordinates
    ]


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
    found = []
    for cell in result.cells:
        one = attempt(cell.cell, "its export", partial(_estimate, result, cell, utm, every))
        if isinstance(one, Failure):
            answer = result.answer(cell.after(one))
            one = Estimate(answer, (), {}, (f"the answer about {cell.cell}: {one.reason}",))
        found.append(one)
    return found


def _estimate(result: Result, cell: CellResult, utm: Utm, every: bool) -> Estimate:
    regions = {}
    for percent, level in ((95, LEVEL), (50, HALF)):
        if outline := region_of(cell, level).geojson:
            regions[percent] = tuple(polygons(outline.coordinates))
    return estimate_of(result.answer(cell), regions, utm, every=every)


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
