"""What was found of each cell, as places, regions and ellipses: from a summary of `postproc
smooth`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from shapely.errors import ShapelyError

from logger.core.errors import FieldLoggerError
from logger.core.geo import Utm, check_position
from logger.core.locator.rivals import LEAST_SHARE
from logger.core.runfile.hdf5_reading import stored_summary
from postproc.interop.geometry import LonLat, Rings, ellipse, polygons

_PEERS = {"ekf": "EKF", "rts": "RTS", "batch": "least squares"}
"""The reference EKF is left out: it is documented, and wrong."""
_WIDEST_M = 50_000.0
"""No transmitter is heard that far away, and a UTM zone is not true for much more: a wider ellipse
says nothing.
"""


@dataclass(frozen=True, slots=True)
class Place:
    """One place where a cell may stand; `probability` is None for an estimator that knows only one.

    `verdict` is that on the cell for the places of the answer, None for those of other estimators.
    """

    name: str
    at: LonLat
    probability: float | None
    ellipse95: tuple[Rings, ...]
    verdict: str | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """What was found of one cell; without places where nothing honest can be said.

    `left_out` says in words which estimators have no place here, and why.
    """

    cell: str
    verdict: str
    n: int
    places: tuple[Place, ...]
    regions: Mapping[int, tuple[Rings, ...]]
    warnings: tuple[str, ...]
    left_out: tuple[str, ...] = ()


def estimates(summary: Mapping[str, Any], utm: Utm, *, every: bool = False) -> list[Estimate]:
    """Estimates in a summary as `postproc smooth --json` prints it; `utm` is the zone of the run.

    The answer and its region, or with `every` the places and ellipses of the other estimators
    besides.
    """
    return [_estimate(cell, utm, every) for cell in summary["cells"]]


def stored_estimates(
    path: Path, run_id: str, cells: Sequence[str], utm: Utm, *, every: bool = False
) -> list[Estimate] | None:
    """Estimates that `postproc smooth` has left beside the run.

    None where they are not of this run, lack a cell, or are not as we write them: they can be
    computed.
    """
    try:
        summary = msgspec.json.decode(stored_summary(path, run_id))
        by_name = {cell["cell"]: cell for cell in summary["cells"]}
        return estimates(summary | {"cells": [by_name[name] for name in cells]}, utm, every=every)
    except (
        FieldLoggerError,
        ShapelyError,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        RecursionError,
    ):
        return None


def _estimate(cell: Mapping[str, Any], utm: Utm, every: bool) -> Estimate:
    regions = {level: cell[f"region{level}"]["geojson"] for level in (95, 50)}
    outlines = {
        level: tuple(polygons(found["coordinates"])) for level, found in regions.items() if found
    }
    more, left_out = _others(cell, utm) if every else ([], [])
    places = [*_answer(cell), *more]
    return Estimate(
        cell["cell"],
        cell["verdict"],
        cell["n"],
        tuple(places),
        outlines,
        tuple(cell["warnings"]),
        tuple(left_out),
    )


def _answer(cell: Mapping[str, Any]) -> list[Place]:
    """Places that the verdict is about: several only where it says that there are several."""
    verdict, best = cell["verdict"], cell["best"]
    if verdict == "ambiguous":
        likely = [mode for mode in cell["modes"] if _counts(mode)]
        return [
            Place(f"possible place {i}", _at(mode), mode["probability"], (), verdict)
            for i, mode in enumerate(likely, 1)
        ]
    if best["lat"] is None:
        return []
    return [
        Place("best place" if verdict == "located" else "best guess", _at(best), None, (), verdict)
    ]


def _counts(mode: Mapping[str, Any]) -> bool:
    """Whether the verdict names a place; a summary of an earlier version does not say it."""
    if "percent" in mode:
        return mode["percent"] is not None
    return bool(mode["probability"] >= LEAST_SHARE)


def _others(cell: Mapping[str, Any], utm: Utm) -> tuple[list[Place], list[str]]:
    """Places with ellipses: the posterior's by Gaussians, and those of the other estimators; and
    who has none.
    """
    places, left_out = [], []
    modes = {f"posterior, place {i}": mode for i, mode in enumerate(cell["modes"], 1)}
    for name, found in {**modes, **{name: cell[key] for key, name in _PEERS.items()}}.items():
        if why := _no_answer(found):
            left_out.append(f"{name} of {cell['cell']}: {why}")
        elif found["lat"] is not None:
            places.append(Place(name, _at(found), found.get("probability"), _ellipse(found, utm)))
    return places, left_out


def _no_answer(found: Mapping[str, Any]) -> str | None:
    """Why an estimator that was asked has no place to show; None where it has one or was not
    asked.
    """
    if found.get("converged") is False:
        return "it did not converge"
    shape = found["ellipse95"]
    if found["lat"] is not None and (shape is None or None in shape.values()):
        return "it did not converge"  # a summary of an earlier version, in which infinity is null
    wide = shape is not None and shape["semi_major_m"] > _WIDEST_M
    return "the readings do not bound it" if wide or found.get("bounded") is False else None


def _ellipse(found: Mapping[str, Any], utm: Utm) -> tuple[Rings, ...]:
    shape = found["ellipse95"]
    axes_m = (shape["semi_major_m"], shape["semi_minor_m"])
    return tuple(
        polygons([[ellipse(found["lat"], found["lon"], utm, axes_m, shape["azimuth_deg"])]])
    )


def _at(found: Mapping[str, Any]) -> LonLat:
    lat_deg, lon_deg = float(found["lat"]), float(found["lon"])
    check_position(lat_deg, lon_deg)
    return lon_deg, lat_deg
