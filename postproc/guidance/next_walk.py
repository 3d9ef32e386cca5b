"""The next walk after recorded ones: routes by what they would say about one cell.

A route's gain is predicted under the model. On simulated walks a radius that was predicted for 13
of 100 came true in 4: the figures are optimistic, their order is what counts.
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from logger.command_line import late_modules
from logger.core.answer import Answer, Provenance, answer_of
from logger.core.arrays import FloatArray, IntArray
from logger.core.certainty import RADII, metres
from logger.core.document import Column, Degrees, Document, Table
from logger.core.document import Line as TextLine
from logger.core.errors import ConfigError, EstimationError
from logger.core.guidance.forecast import Forecast, Forecaster
from logger.core.guidance.planner import Course, Plan, first_turn, plans
from logger.core.guidance.routes import Route, compass_routes, street_routes
from logger.core.guidance.sample import Cluster, PositionSample, clusters, draw
from logger.core.guidance.sentence import sentence
from logger.core.guidance.street_atlas import Line, StreetAtlas
from logger.core.locator.pipeline import decide, locate, search
from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import prepare
from logger.core.locator.quadtree import Effort
from logger.core.locator.region import highest_density
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings
from postproc.atomic_write import whole_file
from postproc.interop.writers.gpx import NAMESPACE
from postproc.interop.xml_file import add, decimal, write
from postproc.outlines import DECIMALS
from postproc.smoothing import too_few

MOST_ROUTES = 5
"""Routes that are listed; the others differ from these by a leg."""
_SAME_END_M = 20.0  # routes that end closer together have one destination for a receiver

_EFFORT = Effort(most_squares=1500, split_share=0.005, nodes=3, most_blocks=150)
"""Where to walk changes little with finer squares."""
_LOOP_M = (120.0, 300.0)  # sides of squares around a place, where no street map is known
FARTHEST_START_M = 20_000.0
"""Half an hour by car from the walk; a start beyond has latitude and longitude exchanged."""
_DRAWS = 40
"""True positions that the radius after a route is predicted for."""


class RankedRoute(NamedTuple):
    """A route, its information in all and for each kilometre, and the radius predicted after it."""

    route: Route
    nats: float
    nats_per_km: float
    r95_after_m: float


class NextWalk(NamedTuple):
    """Where to walk next for the cell of the answer, the best route first.

    `posterior` is that of the answer.
    """

    answer: Answer
    start: Places
    posterior: Posterior
    routes: tuple[RankedRoute, ...]
    text: str
    forecaster: Forecaster
    walked: Places


def next_walk(
    obs: Readings,
    prior: Prior,
    start: Places | None = None,
    lines: Iterable[Line] = (),
) -> NextWalk:
    """Rank routes from a start (default: where the readings end) by what they say about a cell.

    `lines` are the streets. Raises `ConfigError` without a
    route from there, `EstimationError` for a cell of too few readings.
    """
    everywhere = obs.everywhere()  # the walk, wherever its readings count
    obs = everywhere.usable()
    if why := too_few(everywhere, obs):
        raise EstimationError(f"{why}; walk there")
    task = prepare(obs, prior, _EFFORT)
    tree = search(task)
    posterior = locate(obs, prior)  # the answer is that of every command
    start = _start(everywhere, start)
    mixed = tree.mixture(task.walk.prior)
    places = clusters(tree.squares, mixed.probability, start)
    routes = _routes(start, places, lines)
    sample = draw(task, tree, mixed, turn=0)
    forecaster = Forecaster(sample, task.walk.blocks, task.walk.prior)
    course = Course(None, np.zeros((0, 2)))
    best, *others = plans(forecaster, routes, course, has_map=True)
    distance_m = float(np.hypot(*(first_turn(best.route) - best.route.corner_m[0])))
    verdict, reasons, *_ = decide(posterior, obs)
    named = [mode.place for mode in posterior.likely_modes]
    return NextWalk(
        answer_of(obs.cell, verdict, reasons, Provenance(len(obs)), posterior),
        start,
        posterior,
        tuple(_rank(one, sample, posterior.r95_m) for one in _different([best, *others])),
        sentence(best, sample, named, None, distance_m, task.mean_dbm)[0],
        forecaster,
        everywhere.places,
    )


def _start(obs: Readings, start: Places | None) -> Places:
    """Where the next walk begins; raises `ConfigError` for a place that is nowhere near."""
    if start is None:
        return obs.places[-1]
    start = start.in_zone(obs.utm)
    away_m = start.away_m(obs.places[-1])
    if not away_m <= FARTHEST_START_M:
        raise ConfigError(
            f"--from is {away_m / 1000.0:.0f} km from the end of the walk; latitude comes first"
        )
    return start


def _routes(start: Places, places: Sequence[Cluster], lines: Iterable[Line]) -> list[Route]:
    streets = StreetAtlas(lines).near(start)
    if streets is None:
        loops = [_loop(start, place, side_m) for place in places for side_m in _LOOP_M]
        return [*compass_routes(start, places), *loops]
    routes = street_routes(streets, start, places)
    if not routes:
        at = start.on_map
        raise ConfigError(
            f"no street of the map is near {at.lat:.5f} {at.lon:.5f}: "
            "choose a start with --from, or leave out --streets"
        )
    return routes


def _loop(start: Places, place: Cluster, side_m: float) -> Route:
    start_m, middle = start.xy_m[:, 0], place.place.xy_m[:, 0]
    half_m = 0.5 * side_m
    corner_m = middle + half_m * np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])
    first = int(np.argmin(np.hypot(*(corner_m - start_m).T)))
    around = np.roll(corner_m, -first, axis=0)
    return Route(np.concatenate([[start_m], around, around[:1]]))


def _different(ranked: Sequence[Plan]) -> list[Plan]:
    """The best routes to places of their own that do not begin with a better one or are in one."""
    chosen: list[Plan] = []
    for one in ranked:
        points, end_m = set(one.points.tolist()), one.route.corner_m[-1]
        if all(
            len(points & set(other.points.tolist())) < 0.7 * len(points)
            and np.hypot(*(other.route.corner_m[-1] - end_m)) > _SAME_END_M
            for other in chosen
        ):
            chosen.append(one)
        if len(chosen) == MOST_ROUTES:
            break
    return chosen


def _rank(one: Plan, sample: PositionSample, r95_m: float) -> RankedRoute:
    nats = one.nats_per_km * one.route.length_m / 1000.0
    after_m = _r95_after_m(one.forecast, np.unique(one.points), sample)
    # about the most probable one of few positions: no walk makes the region of today larger
    return RankedRoute(one.route, nats, one.nats_per_km, min(after_m, r95_m))


def _r95_after_m(forecast: Forecast, points: IntArray, sample: PositionSample) -> float:
    """Median over true positions of the radius that holds 95 % after levels were drawn."""
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(forecast.covariance[np.ix_(points, points)])
    white = np.linalg.solve(root, forecast.level_dbm[:, points].T).T
    drawn = rng.choice(len(sample.weight), _DRAWS, p=sample.weight)
    levels = white[drawn] + rng.standard_normal((_DRAWS, len(points)))
    misfit = np.sum((levels[:, None] - white) ** 2, axis=2)
    weight = sample.weight * np.exp(-0.5 * (misfit - misfit.min(axis=1, keepdims=True)))
    weight /= weight.sum(axis=1, keepdims=True)
    best = np.argmax(weight, axis=1)
    away_m = sample.places.part(best).distances_m(sample.places)
    order = np.argsort(away_m, axis=1)
    held = np.cumsum(np.take_along_axis(weight, order, axis=1), axis=1)
    last = np.minimum((held < 0.95).sum(axis=1), len(sample.weight) - 1)
    radius_m = np.take_along_axis(away_m, order, axis=1)[np.arange(_DRAWS), last]
    return float(np.median(radius_m))


with late_modules():  # they draw
    from postproc.pictures import plots

OPTIMISTIC = (
    "The radii after a route are what the model promises. They are optimistic; trust their order."
)
_LEAST_MAP_M, _MARGIN_M, _GRID = 600.0, 100.0, 41
"""Half the side of the map at least, what it shows beyond the best route, and points of each side
that the information is computed for."""
_COLUMNS = (
    Column("route", "d"),
    Column("length", ".0f", "m"),
    Column(f"{RADII[1]}, after it", is_right=True),
    Column("to"),
)


def document_of(walk: NextWalk) -> Document:
    """The answer today, the best route in a sentence, and the ranked routes."""
    return Document(
        content_of(walk), f"{walk.answer.cell}: {walk.answer.sentence}", body=parts_of(walk)
    )


def parts_of(walk: NextWalk) -> Iterator[str | TextLine | Table]:
    """What follows the answer."""
    yield walk.text
    rows = [
        (
            number,
            one.route.length_m,
            metres(one.r95_after_m),
            Degrees(lat_deg, lon_deg),
        )
        for number, one in enumerate(walk.routes, 1)
        for lat_deg, lon_deg in _degrees(walk, one)[-1:]
    ]
    yield Table(_COLUMNS, rows)
    yield OPTIMISTIC


def content_of(walk: NextWalk) -> dict[str, Any]:
    """What the JSON is made of."""
    place = walk.answer.place
    return {
        "cell": walk.answer.cell,
        "verdict": walk.answer.verdict,
        "best": place and place.position,
        "supposition": (place and place.supposition) or None,
        "start": walk.start.on_map,
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
        after = f"{RADII[1]} {metres(one.r95_after_m)} after it"
        add(route, "desc", f"{metres(one.route.length_m)}, {after}")
        for lat_deg, lon_deg in _degrees(walk, one):
            add(route, "rtept", lat=decimal(lat_deg, DECIMALS), lon=decimal(lon_deg, DECIMALS))
    with whole_file(target) as part:
        write(root, part)


def draw_map(walk: NextWalk, target: Path) -> None:
    """Where a reading would say most, with the walk, the 95 % region and the best route."""
    figure = plots.figure_of_size(7.0, 6.4)
    axes = figure.add_subplot()
    start = walk.start.xy_m[:, 0]
    route_m = walk.routes[0].route.corner_m - start
    half_m = max(_LEAST_MAP_M, float(np.max(np.abs(route_m))) + _MARGIN_M)
    at_m = np.linspace(-half_m, half_m, _GRID)
    nats = _information(walk, at_m)
    mesh = axes.pcolormesh(at_m, at_m, nats, shading="auto", cmap="viridis")
    figure.colorbar(mesh, label="what one reading would say about the position")
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


def _information(walk: NextWalk, at_m: FloatArray) -> FloatArray:
    """1/2 ln(1 + Var mu / N) of one reading on a grid `at_m` (n,) north and east of the start."""
    nats = np.empty((len(at_m), len(at_m)))
    for row, north_m in enumerate(at_m):
        y_m = np.full(len(at_m), north_m) + walk.start.y_m
        forecast = walk.forecaster.at(Places.of(at_m + walk.start.x_m, y_m))
        off = forecast.level_dbm - forecast.weight @ forecast.level_dbm
        variance = forecast.weight @ off**2
        nats[row] = 0.5 * np.log1p(variance / np.diag(forecast.covariance))
    return nats


def _degrees(walk: NextWalk, one: RankedRoute) -> list[list[float]]:
    corners = Places.of(*one.route.corner_m.T, utm=walk.start.utm)
    degrees: list[list[float]] = corners.lat_lon_deg.T.tolist()
    return degrees
