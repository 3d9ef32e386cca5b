"""Positions, regions and ellipses of each cell, as they are exported."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, isfinite, pi, radians, sin

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from logger.core.answer import Mode
from logger.core.arrays import FloatArray
from logger.core.ellipse import radii_text
from logger.core.places import Utm
from postproc.cell_work import Failure, attempt
from postproc.result import BATCH, EKF, RTS, Result
from postproc.result_json import Best, Cell, FinalState, LeastSquares
from postproc.summary import summarise

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
    """A position of a cell; `probability` is None for an estimator with a single one.

    `radii_m` hold 50 % and 95 % around the best position.

    `verdict` is that on the cell for the positions of the answer, None for other estimators.
    """

    name: str
    lon_lat: LonLat
    probability: float | None
    ellipse95: tuple[Rings, ...]
    verdict: str | None = None
    radii_m: tuple[float, float] | None = None

    @property
    def radii_text(self) -> str:
        """The two radii in words, empty where there are none."""
        return radii_text(*self.radii_m) if self.radii_m else ""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The answer about one cell; no positions where the readings do not determine one.

    `left_out` names the estimators without a position, and why. `error` is that of the program
    which ended some of the work on the cell, None where none did.
    """

    cell: str
    verdict: str
    n: int
    positions: tuple[NamedPosition, ...]
    regions: Mapping[int, tuple[Rings, ...]]
    warnings: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    error: str | None = None


def estimates_of(result: Result, utm: Utm, *, every: bool = False) -> list[Estimate]:
    """The answers and their regions; `utm` is the zone of the run.

    With `every` the positions and ellipses of the other estimators besides.
    """
    return [_estimate_or_why_not(cell, utm, every=every) for cell in summarise(result).cells]


def _estimate_or_why_not(cell: Cell, utm: Utm, *, every: bool) -> Estimate:
    estimate = attempt(cell.cell, "its export", lambda: estimate_of(cell, utm, every=every))
    if not isinstance(estimate, Failure):
        return estimate
    left_out = (f"the answer about {cell.cell}: {estimate.reason}",)
    return Estimate(
        cell.cell, "cannot tell", cell.n, (), {}, (estimate.reason,), left_out, estimate.error
    )


def estimate_of(cell: Cell, utm: Utm, *, every: bool = False) -> Estimate:
    """The answer about one cell of a summary; `utm` and `every` as in `estimates_of`."""
    outlines = {
        level: tuple(polygons(region.geojson.coordinates))
        for level, region in ((95, cell.region95), (50, cell.region50))
        if region.geojson
    }
    more, left_out = _others(cell, utm) if every else ([], [])
    positions = (*_answer(cell), *more)
    error = cell.error or None
    if error is not None:
        left_out.append(f"the answer about {cell.cell}: {cell.warnings[0]}")
    return Estimate(
        cell.cell,
        cell.verdict,
        cell.n,
        positions,
        outlines,
        tuple(cell.warnings),
        tuple(left_out),
        error,
    )


def _answer(cell: Cell) -> list[NamedPosition]:
    """Positions that the verdict is about: several only where it is "ambiguous"."""
    if cell.verdict == "ambiguous":
        likely = [mode for mode in cell.modes if mode.percent is not None]
        return [
            NamedPosition(
                f"possible position {i}",
                _lon_lat(mode),
                mode.probability,
                (),
                cell.verdict,
                _radii_m(cell) if i == 1 else None,
            )
            for i, mode in enumerate(likely, 1)
        ]
    if cell.best.lat is None:
        return []
    name = "best position" if cell.verdict == "located" else "best guess"
    return [NamedPosition(name, _lon_lat(cell.best), None, (), cell.verdict, _radii_m(cell))]


def _radii_m(cell: Cell) -> tuple[float, float] | None:
    r50_m, r95_m = cell.best.r50_m, cell.best.r95_m
    return None if r50_m is None or r95_m is None else (r50_m, r95_m)


def _others(cell: Cell, utm: Utm) -> tuple[list[NamedPosition], list[str]]:
    """Modes and other estimators with their ellipses, and which have none and why."""
    positions, left_out = [], []
    states: dict[str, Mode | FinalState | LeastSquares] = {
        f"posterior, position {i}": mode for i, mode in enumerate(cell.modes, 1)
    }
    states |= {estimator.name: getattr(cell, estimator.json_key) for estimator in _PEERS}
    for name, state in states.items():
        if why := _no_answer(state):
            left_out.append(f"{name} of {cell.cell}: {why}")
        elif state.lat is not None:
            probability = state.probability if isinstance(state, Mode) else None
            positions.append(
                NamedPosition(name, _lon_lat(state), probability, _ellipse(state, utm))
            )
    return positions, left_out


def _no_answer(state: Mode | FinalState | LeastSquares) -> str | None:
    """Why an estimator that was run has no position to show; None for every other."""
    if not isinstance(state, Mode) and state.converged is False:
        return "it did not converge"
    if state.lat is None:
        return None
    shape = state.ellipse95
    if shape is None or not (isfinite(state.lat) and isfinite(shape.semi_major_m)):
        return "it did not converge"
    is_bounded = not isinstance(state, LeastSquares) or state.bounded is not False
    if is_bounded and shape.semi_major_m <= _WIDEST_M:
        return None
    return "the readings do not bound it"


def _ellipse(state: Mode | FinalState | LeastSquares, utm: Utm) -> tuple[Rings, ...]:
    shape = state.ellipse95
    assert shape is not None
    lon_deg, lat_deg = _lon_lat(state)
    axes_m = shape.semi_major_m, shape.semi_minor_m
    return tuple(polygons([[ellipse(lat_deg, lon_deg, utm, axes_m, shape.azimuth_deg)]]))


def _lon_lat(state: Best | Mode | FinalState | LeastSquares) -> LonLat:
    assert state.lat is not None
    assert state.lon is not None
    return state.lon, state.lat
