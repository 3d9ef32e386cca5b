"""The advice in one sentence: the turn, the direction, the distance, and the reason.

Beside it is the reason alone, without distances: beside an arrow that has its own.
"""

from collections.abc import Sequence

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.certainty import metres
from logger.core.guidance.forecast import Forecast
from logger.core.guidance.planner import Plan, azimuth_deg, turn_deg
from logger.core.guidance.sample import PositionSample
from logger.core.places import Places

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
_DISTINCT = 2.0  # standard deviations between two levels that a walker can tell apart
_CLOSE_M = 120.0
"""Within a block of the likeliest place the sentence speaks of its other sides."""
_OPEN_M = 500.0  # farther than this around the likeliest place nobody searches
_COUNTS = {2: "two", 3: "three", 4: "four"}
_PASSING, _SAYS_MOST = "passing it says most", "this way says most about it"


def direction(way_m: FloatArray) -> str:
    """Direction of a way (2,) as one of eight points of the compass."""
    return _POINTS[round(azimuth_deg(way_m) / 45.0) % 8]


def direction_from(start: Places, end: Places) -> str:
    """From one place to another."""
    return direction(end.xy_m[:, 0] - start.xy_m[:, 0])


def turn(course_deg: float | None, azimuth: float) -> str:
    """The turn that a walker makes."""
    if course_deg is None:
        return "go"
    return _TURNS[round(turn_deg(course_deg, azimuth) / 45.0) % 8]


def sentence(
    best: Plan,
    sample: PositionSample,
    places: Sequence[Places],
    course_deg: float | None,
    distance_m: float,
    mean_dbm: float,
) -> tuple[str, str]:
    """Advice and reason of a plan; `mean_dbm` was subtracted from levels, `places` the answer's."""
    here = Places.of(*best.route.corner_m[0])
    way_m = best.route.corner_m[1] - best.route.corner_m[0]
    go = f"{turn(course_deg, azimuth_deg(way_m))}, {direction(way_m)}, "
    go += f"{distance_m:.0f} m"
    if len(places) > 1:
        fit = f"{_COUNTS.get(len(places), len(places))} places fit"
        return f"{go}: {fit}, {_two_places(best, sample, places, mean_dbm)}", fit
    where, why = _one_place(sample, places[0], here)
    it = "passing the likeliest place says most" if why == _PASSING else why
    return f"{go}: {where}; {why}", it


def _two_places(
    best: Plan, sample: PositionSample, places: Sequence[Places], mean_dbm: float
) -> str:
    one, other = places[:2]
    apart_m = one.away_m(other)
    fit = f"{metres(apart_m)} apart"
    fit = fit if len(places) == 2 else f"the likeliest {fit}"
    to_one_m, to_other_m = (_away_m(sample, place) for place in (one, other))
    at_one = to_one_m < to_other_m
    if at_one.all() or not at_one.any():
        return fit
    one_dbm, other_dbm = (_mean(best.forecast, part)[best.points] for part in (at_one, ~at_one))
    sigma_db = np.sqrt(np.diag(best.forecast.covariance)[best.points])
    distinct = np.flatnonzero(np.abs(one_dbm - other_dbm) > _DISTINCT * sigma_db)
    if not len(distinct):
        return fit
    k = int(distinct[0])
    name = direction_from(other, one)
    return (
        f"{fit}; on the way about {one_dbm[k] + mean_dbm:.0f} dBm if it is the {name} one, "
        f"{other_dbm[k] + mean_dbm:.0f} dBm if it is the other"
    )


def _one_place(sample: PositionSample, place: Places, here: Places) -> tuple[str, str]:
    """Where it may be; what the way is good for."""
    # without a radius: the answer has one
    away_m = place.away_m(here)
    spread_m = _spread_m(sample, place)
    where = f"{metres(away_m)} {direction_from(here, place)}"
    if away_m < _CLOSE_M and spread_m < _CLOSE_M:
        return f"the likeliest place is {where}", "hear it from another side"
    if spread_m < _OPEN_M:
        return f"the likeliest place is {where}", _PASSING
    return f"the position is open, likeliest {where}", _SAYS_MOST


def _spread_m(sample: PositionSample, place: Places) -> float:
    """Radius with 95 % of the sample."""
    away_m = _away_m(sample, place)
    order = np.argsort(away_m)
    last = int(np.searchsorted(np.cumsum(sample.weight[order]), 0.95))
    return float(away_m[order[min(last, len(order) - 1)]])


def _away_m(sample: PositionSample, place: Places) -> FloatArray:
    return sample.places.distances_m(place)[:, 0]


def _mean(forecast: Forecast, part: BoolArray) -> FloatArray:
    """Mean expected levels (m,) over some of the positions."""
    weight = forecast.weight[part]
    return np.asarray(weight @ forecast.level_dbm[part] / np.sum(weight), float)
