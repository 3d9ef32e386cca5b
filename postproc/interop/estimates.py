"""Positions, regions and ellipses of each cell, from a summary of `postproc smooth`."""

from collections.abc import Mapping
from dataclasses import dataclass

import msgspec
from msgspec import UNSET, Struct, UnsetType

from logger.core.geo import Utm, check_position
from logger.core.locator.rivals import LEAST_SHARE
from postproc.interop.geometry import LonLat, Rings, ellipse, polygons
from postproc.json_text import as_json
from postproc.result import BATCH, EKF, RTS, Result
from postproc.summary import summarise

_PEERS = (EKF, RTS, BATCH)
"""Without the reference EKF, whose ellipse is wrong."""
_WIDEST_M = 50_000.0
"""GSM reaches 35 km: a wider ellipse contains no information."""


@dataclass(frozen=True, slots=True)
class NamedPosition:
    """A position of a cell; `probability` is None for an estimator with a single one.

    `verdict` is that on the cell for the positions of the answer, None for other estimators.
    """

    name: str
    lon_lat: LonLat
    probability: float | None
    ellipse95: tuple[Rings, ...]
    verdict: str | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """The answer about one cell; no positions where the readings do not determine one.

    `left_out` names the estimators without a position, and why.
    """

    cell: str
    verdict: str
    n: int
    positions: tuple[NamedPosition, ...]
    regions: Mapping[int, tuple[Rings, ...]]
    warnings: tuple[str, ...]
    left_out: tuple[str, ...] = ()


class _Ellipse(Struct):
    semi_major_m: float | None
    semi_minor_m: float | None
    azimuth_deg: float | None


class _State(Struct):
    """A position of an estimator; an earlier version stores no `converged` and no `percent`."""

    lat: float | None = None
    lon: float | None = None
    ellipse95: _Ellipse | None = None
    probability: float | None = None
    percent: int | UnsetType | None = UNSET
    converged: bool | None = None
    bounded: bool = True


class _Mode(_State, kw_only=True):
    """A mode of the posterior always has a position and a probability."""

    lat: float
    lon: float
    probability: float


class _Geometry(Struct):
    coordinates: list[list[list[tuple[float, float]]]]


class _Region(Struct):
    geojson: _Geometry | None


class StoredCell(Struct):
    """The part of `result_json.Cell` that exports need, of this version or of an earlier one."""

    cell: str
    verdict: str
    n: int
    best: _State
    modes: list[_Mode]
    region95: _Region
    region50: _Region
    ekf: _State
    rts: _State
    batch: _State
    warnings: list[str]


class StoredSummary(Struct):
    """A summary as `postproc smooth --json` prints it."""

    cells: list[StoredCell]


def estimates_of(result: Result, utm: Utm, *, every: bool = False) -> list[Estimate]:
    """The answers and their regions; `utm` is the zone of the run.

    With `every` the positions and ellipses of the other estimators besides.
    """
    return estimates(as_json(summarise(result)), utm, every=every)


def estimates(summary: str | bytes, utm: Utm, *, every: bool = False) -> list[Estimate]:
    """Estimates in a summary as `postproc smooth --json` prints it; `utm` is the zone of the run.

    Raises `msgspec.ValidationError` for JSON that is no summary.
    """
    stored = msgspec.json.decode(summary, type=StoredSummary)
    return [_estimate(cell, utm, every) for cell in stored.cells]


def _estimate(cell: StoredCell, utm: Utm, every: bool) -> Estimate:
    outlines = {
        level: tuple(polygons(region.geojson.coordinates))
        for level, region in ((95, cell.region95), (50, cell.region50))
        if region.geojson
    }
    more, left_out = _others(cell, utm) if every else ([], [])
    positions = (*_answer(cell), *more)
    return Estimate(
        cell.cell, cell.verdict, cell.n, positions, outlines, tuple(cell.warnings), tuple(left_out)
    )


def _answer(cell: StoredCell) -> list[NamedPosition]:
    """Positions that the verdict is about: several only where it is "ambiguous"."""
    if cell.verdict == "ambiguous":
        likely = [mode for mode in cell.modes if _is_relevant(mode)]
        return [
            NamedPosition(
                f"possible position {i}", _lon_lat(mode), mode.probability, (), cell.verdict
            )
            for i, mode in enumerate(likely, 1)
        ]
    if cell.best.lat is None:
        return []
    name = "best position" if cell.verdict == "located" else "best guess"
    return [NamedPosition(name, _lon_lat(cell.best), None, (), cell.verdict)]


def _is_relevant(mode: _Mode) -> bool:
    """Whether the verdict counts a mode; an earlier version stores its probability alone."""
    if mode.percent is UNSET:
        return mode.probability >= LEAST_SHARE
    return mode.percent is not None


def _others(cell: StoredCell, utm: Utm) -> tuple[list[NamedPosition], list[str]]:
    """Modes and other estimators with their ellipses, and which have none and why."""
    positions, left_out = [], []
    states: dict[str, _State] = {
        f"posterior, position {i}": mode for i, mode in enumerate(cell.modes, 1)
    }
    states |= {estimator.name: getattr(cell, estimator.json_key) for estimator in _PEERS}
    for name, state in states.items():
        if why := _no_answer(state):
            left_out.append(f"{name} of {cell.cell}: {why}")
        elif state.lat is not None:
            positions.append(
                NamedPosition(name, _lon_lat(state), state.probability, _ellipse(state, utm))
            )
    return positions, left_out


def _no_answer(state: _State) -> str | None:
    """Why an estimator that was run has no position to show; None for every other."""
    if state.converged is False:
        return "it did not converge"
    if state.lat is None:
        return None
    shape = state.ellipse95
    if shape is None or shape.semi_major_m is None:  # null was infinity in an earlier version
        return "it did not converge"
    is_wide = shape.semi_major_m > _WIDEST_M
    return "the readings do not bound it" if is_wide or not state.bounded else None


def _ellipse(state: _State, utm: Utm) -> tuple[Rings, ...]:
    shape = state.ellipse95
    assert shape is not None
    axes_m = float(shape.semi_major_m or 0.0), float(shape.semi_minor_m or 0.0)
    lat_deg, lon_deg = _position(state)
    ring = ellipse(lat_deg, lon_deg, utm, axes_m, float(shape.azimuth_deg or 0.0))
    return tuple(polygons([[ring]]))


def _lon_lat(state: _State) -> LonLat:
    lat_deg, lon_deg = _position(state)
    check_position(lat_deg, lon_deg)
    return lon_deg, lat_deg


def _position(state: _State) -> tuple[float, float]:
    if state.lat is None or state.lon is None:
        raise ValueError("a position without latitude or longitude")
    return state.lat, state.lon
