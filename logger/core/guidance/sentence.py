"""The advice in one sentence: the turn, the direction, the distance, and the reason."""

from collections.abc import Sequence
from math import hypot

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.guidance.clusters import Cluster
from logger.core.guidance.forecast import Forecast
from logger.core.guidance.planner import Plan, azimuth_deg, turn_deg
from logger.core.guidance.sample import PositionSample

_TURNS = (
    "straight on",
    "half right",
    "turn right",
    "sharp right",
    "turn back",
    "sharp left",
    "turn left",
    "half left",
)
_POINTS = (
    "north",
    "north-east",
    "east",
    "south-east",
    "south",
    "south-west",
    "west",
    "north-west",
)
_DISTINCT = 2.0
"""Standard deviations between two expected levels that a walker can tell apart."""
_LEAST_PLACE = 0.1
"""Places with less probability are not named."""
_CLOSE_M = 120.0
"""Within a block of the likeliest place the sentence speaks of its other sides."""
_OPEN_M = 500.0
"""Farther than this around the likeliest place nobody searches."""


def direction(from_m: Sequence[float], to_m: Sequence[float]) -> str:
    """Direction as one of eight points of the compass."""
    return _POINTS[round(azimuth_deg(from_m, to_m) / 45.0) % 8]


def turn(course_deg: float | None, azimuth: float) -> str:
    """The turn that a walker makes."""
    if course_deg is None:
        return "go"
    return _TURNS[round(turn_deg(course_deg, azimuth) / 45.0) % 8]


def sentence(
    best: Plan,
    sample: PositionSample,
    places: Sequence[Cluster],
    course_deg: float | None,
    distance_m: float,
    mean_dbm: float,
) -> str:
    """The advice for a plan; `mean_dbm` has been subtracted from the levels of the forecast."""
    here = best.route.corner_m[0].tolist()
    first = best.route.corner_m[1].tolist()
    go = f"{turn(course_deg, azimuth_deg(here, first))}, {direction(here, first)}, "
    go += f"{distance_m:.0f} m"
    named = [place for place in places if place.probability >= _LEAST_PLACE]
    if len(named) > 1:
        return f"{go}: {_two_places(best, sample, named, mean_dbm)}"
    return f"{go}: {_one_place(sample, named or places, here)}"


def _two_places(
    best: Plan, sample: PositionSample, places: Sequence[Cluster], mean_dbm: float
) -> str:
    """The levels that decide between the two likeliest places, where the way tells them apart."""
    one, other = places[:2]
    apart_m = hypot(one.x_m - other.x_m, one.y_m - other.y_m)
    fit = f"{_count(len(places))} places fit, "
    fit += f"{apart_m:.0f} m apart" if len(places) == 2 else f"the likeliest {apart_m:.0f} m apart"
    at_one = np.hypot(sample.x_m - one.x_m, sample.y_m - one.y_m) < np.hypot(
        sample.x_m - other.x_m, sample.y_m - other.y_m
    )
    if at_one.all() or not at_one.any():
        return fit
    one_dbm, other_dbm = (_mean(best.forecast, part)[best.points] for part in (at_one, ~at_one))
    sigma_db = np.sqrt(np.diag(best.forecast.covariance)[best.points])
    distinct = np.flatnonzero(np.abs(one_dbm - other_dbm) > _DISTINCT * sigma_db)
    if not len(distinct):
        return fit
    k = int(distinct[0])
    name = direction((other.x_m, other.y_m), (one.x_m, one.y_m))
    return (
        f"{fit}; on the way about {one_dbm[k] + mean_dbm:.0f} dBm if it is the {name} one, "
        f"{other_dbm[k] + mean_dbm:.0f} dBm if it is the other"
    )


def _one_place(sample: PositionSample, places: Sequence[Cluster], here: Sequence[float]) -> str:
    if not places:
        return "the position is open; this way says most about it"
    place = places[0]
    away_m = hypot(place.x_m - here[0], place.y_m - here[1])
    spread_m = _spread_m(sample, place)
    where = f"{away_m:.0f} m {direction(here, (place.x_m, place.y_m))}"
    if away_m < _CLOSE_M and spread_m < _CLOSE_M:
        return f"it is within {spread_m:.0f} m of a place {where}; hear it from another side"
    if spread_m < _OPEN_M:
        return f"the likeliest place is {where}, known to {spread_m:.0f} m; passing it says most"
    return f"the position is open, likeliest {where}; this way says most about it"


def _spread_m(sample: PositionSample, place: Cluster) -> float:
    """Radius around a place with 95 % of the sample."""
    away_m = np.hypot(sample.x_m - place.x_m, sample.y_m - place.y_m)
    order = np.argsort(away_m)
    last = int(np.searchsorted(np.cumsum(sample.weight[order]), 0.95))
    return float(away_m[order[min(last, len(order) - 1)]])


def _mean(forecast: Forecast, part: BoolArray) -> FloatArray:
    """Mean expected levels (m,) over some of the positions."""
    weight = forecast.weight[part]
    return np.asarray(weight @ forecast.level_dbm[part] / np.sum(weight), float)


def _count(number: int) -> str:
    return {2: "two", 3: "three", 4: "four"}[number]
