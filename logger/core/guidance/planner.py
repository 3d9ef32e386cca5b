"""Routes by what they say about the position for each metre, and whether they lead to it."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, degrees
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.guidance.forecast import Forecast, Forecaster, information_nats
from logger.core.guidance.routes import LEG_M, Route
from logger.core.places import Places

_START_M = 30.0
"""Added to each length: else a route of a few steps would be best per metre."""
_BACK_M_DEG = 20.0, 135.0
"""Added to the length of a route that begins with a turn of more than this: people do not like to
turn back."""
_BACK_UNMAPPED_M_DEG = 300.0, 100.0
"""The same where no street map is known: a walker led by an arrow that points behind him would walk
the same street again and again where no other leads to the place."""
_KEPT = 1.3
"""Another way has to be worth this many times the one straight on."""
_NATS_PER_NEARER_M = 0.01
"""Added where a route brings the walker nearer to the transmitter, on average over its positions.

Far off all ways say equally little, so without this a walker who hears it from 800 m wanders.
Guided searches of a rogue that was 590 to 800 m off took 1136 and 1460 s instead of 1997 s and more
than 2308 s.
"""
_WALKED_BEFORE = 0.4
"""Share of the best value that a way walked before costs without a street map."""
_SAME_WAY_M = 30.0
"""Closer than this to an earlier part of the walk it is the same street."""
_AHEAD_DEG = 30.0
_TURN_DEG = 25.0
"""A corner of more than this is a turn; a smaller one is a bend of the street."""


class Course(NamedTuple):
    """Where the walker comes from: azimuth in degrees (None: standing), earlier track (t, 2)."""

    azimuth_deg: float | None
    earlier_m: FloatArray


class Plan(NamedTuple):
    """A route, its information for each kilometre, and the forecast along all routes.

    `points` are the rows of the forecast that belong to the route, in walking order.
    """

    route: Route
    nats_per_km: float
    forecast: Forecast
    points: IntArray


def plans(
    forecaster: Forecaster, routes: Sequence[Route], course: Course, *, has_map: bool
) -> list[Plan]:
    """Some routes, the best first."""
    each = [route.points() for route in routes]
    rounded = np.asarray(np.round(np.concatenate(each), 1), float)
    points, at = np.unique(rounded, axis=0, return_inverse=True)
    forecast = forecaster.at(Places.of(*points.T))
    rows = np.split(np.ravel(at), np.cumsum([len(one) for one in each])[:-1])
    nats = np.array([information_nats(forecast, np.unique(of_route)) for of_route in rows])
    length_m = np.array([route.length_m + _START_M for route in routes])
    value = nats / length_m
    turns = [_turn(route, course) for route in routes]
    back_m, back_deg = _BACK_M_DEG if has_map else _BACK_UNMAPPED_M_DEG
    nearer_m = np.array(
        [max(forecaster.nearer_m(*route.corner_m[[0, -1]]), 0.0) for route in routes]
    )
    worth = nats + _NATS_PER_NEARER_M * nearer_m
    score = worth / (length_m + [back_m if abs(turn) > back_deg else 0.0 for turn in turns])
    if not has_map:
        score -= (
            _WALKED_BEFORE * np.max(score) * np.array([_share_walked(r, course) for r in routes])
        )
    score *= [_KEPT if abs(turn) < _AHEAD_DEG else 1.0 for turn in turns]
    return [
        Plan(routes[k], 1000.0 * float(value[k]), forecast, rows[k])
        for k in np.argsort(-score, kind="stable").tolist()
    ]


def azimuth_deg(way_m: FloatArray) -> float:
    """Direction of a way (2,) clockwise from grid north, 0 to 360 degrees."""
    return degrees(atan2(*way_m.tolist())) % 360.0


def turn_deg(course_deg: float, azimuth_deg: float) -> float:
    """Turn to the right from a course, -180 to 180 degrees."""
    return (azimuth_deg - course_deg + 180.0) % 360.0 - 180.0


def first_turn(route: Route) -> FloatArray:
    """The corner where the walker leaves the first direction, or the end."""
    corner = route.corner_m
    first = azimuth_deg(corner[1] - corner[0])
    for here, after in pairwise(corner[1:]):
        if abs(turn_deg(first, azimuth_deg(after - here))) > _TURN_DEG:
            return np.asarray(here, float)
    return np.asarray(corner[-1], float)


def _turn(route: Route, course: Course) -> float:
    if course.azimuth_deg is None:
        return 0.0
    first = azimuth_deg(route.corner_m[1] - route.corner_m[0])
    return turn_deg(course.azimuth_deg, first)


def _share_walked(route: Route, course: Course) -> float:
    if not len(course.earlier_m):
        return 0.0
    first = route.points()[: round(LEG_M / 25.0)]
    apart_m = np.hypot(*(first[:, None] - course.earlier_m).transpose(2, 0, 1))
    return float(np.mean(np.min(apart_m, axis=1) < _SAME_WAY_M))
