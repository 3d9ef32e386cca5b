"""The next walk as a document, as GPX and as a map."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from logger.command_line import late_modules
from logger.core.arrays import FloatArray
from logger.core.document import Column, Degrees, Document, Line, Table
from logger.core.ellipse import radii_text
from logger.core.locator.region import highest_density
from logger.core.places import Places
from postproc.atomic_write import whole_file
from postproc.guidance.next_walk import NextWalk, RankedRoute
from postproc.interop.geometry import DECIMALS
from postproc.interop.writers.gpx import NAMESPACE
from postproc.interop.xml_file import add, decimal, write

with late_modules():  # they draw
    from postproc.pictures import plots, plots_style

OPTIMISTIC = (
    "The radii after a route are what the model promises. They are optimistic; trust their order."
)
_LEAST_MAP_M, _MARGIN_M, _GRID = 600.0, 100.0, 41
"""Half the side of the map at least, what it shows beyond the best route, and points of each side
that the information is computed for."""
_COLUMNS = (
    Column("route", "d"),
    Column("length", ".0f", "m"),
    Column("nats", ".2f"),
    Column("nats/km", ".2f"),
    Column("r95 after", ".0f", "m"),
    Column("to"),
)


def document_of(walk: NextWalk) -> Document:
    """The verdict today, the best route in a sentence, and the ranked routes."""
    return Document(
        content_of(walk), f"{walk.answer.cell}: {walk.answer.verdict}", body=parts_of(walk)
    )


def parts_of(walk: NextWalk) -> Iterator[str | Line | Table]:
    """What follows the verdict."""
    yield walk.text
    rows = [
        (
            number,
            one.route.length_m,
            one.nats,
            one.nats_per_km,
            one.r95_after_m,
            Degrees(*_degrees(walk, one)[-1]),
        )
        for number, one in enumerate(walk.routes, 1)
    ]
    yield Table(_COLUMNS, rows)
    yield f"now {radii_text(walk.posterior.r50_m, walk.posterior.r95_m)}. {OPTIMISTIC}"


def content_of(walk: NextWalk) -> dict[str, Any]:
    """What the JSON is made of."""
    lat_deg, lon_deg = walk.start.first_deg
    return {
        "cell": walk.answer.cell,
        "verdict": walk.answer.verdict,
        "best": walk.answer.place and walk.answer.place.position,
        "start": {"lat": lat_deg, "lon": lon_deg},
        "text": walk.text,
        "routes": [
            {
                "length_m": one.route.length_m,
                "nats": one.nats,
                "nats_per_km": one.nats_per_km,
                "r95_after_m": one.r95_after_m,
                "points": [list(point) for point in _degrees(walk, one)],
            }
            for one in walk.routes
        ],
        "note": OPTIMISTIC,
    }


def write_gpx(walk: NextWalk, target: Path) -> None:
    """The best route to follow with any map program."""
    root = ET.Element("gpx", {"xmlns": NAMESPACE, "version": "1.1", "creator": "cellwalk"})
    for number, one in enumerate(walk.routes, 1):
        route = add(root, "rte")
        add(route, "name", f"{walk.answer.cell} {number}")
        add(route, "desc", f"{one.route.length_m:.0f} m, {one.nats_per_km:.2f} nats/km")
        for lat_deg, lon_deg in _degrees(walk, one):
            add(route, "rtept", lat=decimal(lat_deg, DECIMALS), lon=decimal(lon_deg, DECIMALS))
    with whole_file(target) as part:
        write(root, part)


def draw_map(walk: NextWalk, target: Path) -> None:
    """Where a reading would say most, with the walk, the 95 % region and the best route."""
    figure = plots_style.figure_of_size(7.0, 6.4)
    axes = figure.add_subplot()
    start = walk.start.xy_m[:, 0]
    route_m = walk.routes[0].route.corner_m - start
    half_m = max(_LEAST_MAP_M, float(np.max(np.abs(route_m))) + _MARGIN_M)
    east_m, north_m, nats = _information(walk, half_m)
    mesh = axes.pcolormesh(east_m, north_m, nats, shading="auto", cmap="viridis")
    figure.colorbar(mesh, label="nats that one reading would say")
    squares = walk.posterior.squares
    chosen = highest_density(squares)
    axes.plot(squares.x_m[chosen] - start[0], squares.y_m[chosen] - start[1], "s", color="white",
              markersize=2.0, alpha=0.6, label="95 % region")  # fmt: skip
    axes.plot(*(walk.walked.xy_m - walk.start.xy_m), color="black", linewidth=1.0, label="walked")
    axes.plot(*route_m.T, color="red", label="best route")
    axes.plot(0.0, 0.0, "o", color="red", label="start")
    axes.set_xlim(-half_m, half_m)
    axes.set_ylim(-half_m, half_m)
    axes.set_aspect("equal")
    axes.set_xlabel("east of the start, m")
    axes.set_ylabel("north of the start, m")
    axes.set_title(f"{walk.answer.cell}: where to walk next")
    axes.legend(loc="upper right", facecolor="0.75")  # the region is white
    plots.save_figure(figure, target)


def _information(walk: NextWalk, half_m: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """1/2 ln(1 + Var mu / N) of one reading on a grid around the start."""
    at_m = np.linspace(-half_m, half_m, _GRID)
    east_m, north_m = np.meshgrid(at_m, at_m)
    nats = np.empty_like(east_m)
    for row in range(_GRID):
        x_m, y_m = east_m[row] + walk.start.x_m, north_m[row] + walk.start.y_m
        forecast = walk.forecaster.at(Places.of(x_m, y_m))
        off = forecast.level_dbm - forecast.weight @ forecast.level_dbm
        variance = forecast.weight @ off**2
        nats[row] = 0.5 * np.log1p(variance / np.diag(forecast.covariance))
    return east_m, north_m, nats


def _degrees(walk: NextWalk, one: RankedRoute) -> list[list[float]]:
    corners = Places.of(*one.route.corner_m.T, utm=walk.start.utm)
    degrees: list[list[float]] = corners.lat_lon_deg.T.tolist()
    return degrees
