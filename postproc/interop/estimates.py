"""What was found of each cell, as places, regions and ellipses: from a summary of `postproc smooth`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import msgspec

from logger.core.geo import Utm
from postproc.interop.geometry import LonLat, Rings, ellipse, polygons

_PEERS = {"ekf": "EKF", "rts": "RTS", "batch": "least squares"}
"""The reference EKF is left out: it is documented, and wrong."""


@dataclass(frozen=True, slots=True)
class Place:
    """One place where a cell may stand; `probability` is None for an estimator that knows only one."""

    name: str
    at: LonLat
    probability: float | None
    ellipse95: tuple[Rings, ...]


@dataclass(frozen=True, slots=True)
class Estimate:
    """What was found of one cell; without places where nothing honest can be said."""

    cell: str
    verdict: str
    n: int
    places: tuple[Place, ...]
    regions: Mapping[int, tuple[Rings, ...]]
    warnings: tuple[str, ...]


def estimates(summary: Mapping[str, Any], utm: Utm) -> list[Estimate]:
    """Estimates in a summary as `postproc smooth --json` prints it; `utm` is the zone of the run."""
    return [_estimate(cell, utm) for cell in summary["cells"]]


def stored_summary(path: Path, run_id: str, cells: Sequence[str]) -> dict[str, Any] | None:
    """Summary that `postproc smooth` has left beside the run; None where it is not of this run, or lacks a cell."""
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("run_id") != run_id:
                return None
            summary: dict[str, Any] = msgspec.json.decode(bytes(file["summary"][()]))
    except (OSError, KeyError, ValueError):
        return None
    by_name = {cell["cell"]: cell for cell in summary["cells"]}
    return summary | {"cells": [by_name[name] for name in cells]} if set(cells) <= set(by_name) else None


def _estimate(cell: Mapping[str, Any], utm: Utm) -> Estimate:
    places = [_place(f"place {i}", mode, utm) for i, mode in enumerate(cell["modes"], 1)]
    places += [_place(name, cell[key], utm) for key, name in _PEERS.items() if cell[key]["lat"] is not None]
    regions = {level: cell[f"region{level}"]["geojson"] for level in (95, 50)}
    outlines = {level: tuple(polygons(found["coordinates"])) for level, found in regions.items() if found}
    return Estimate(cell["cell"], cell["verdict"], cell["n"], tuple(places), outlines, tuple(cell["warnings"]))


def _place(name: str, found: Mapping[str, Any], utm: Utm) -> Place:
    shape = found["ellipse95"]
    ring = ellipse(
        found["lat"], found["lon"], utm, (shape["semi_major_m"], shape["semi_minor_m"]), shape["azimuth_deg"]
    )
    return Place(name, (found["lon"], found["lat"]), found.get("probability"), tuple(polygons([[ring]])))
