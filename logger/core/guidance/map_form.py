"""Region and advice in degrees."""

from math import atan2, cos, degrees, radians, remainder

import numpy as np

from logger.core.answer import DEGREE_DECIMALS, MultiPolygon
from logger.core.guidance.advice import Advice
from logger.core.guidance.next_way import NextWay
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import highest_density
from logger.core.places import Places

_MOST_SQUARES = 400
"""Squares of the region, 100 bytes each: the page loads them twice a second."""
_REGION_DECIMALS = 5
"""Of degrees: 1 m, which no phone shows."""


def next_way(advice: Advice | None) -> NextWay | None:
    """The advice in degrees."""
    if advice is None:
        return None
    lat, lon = (round(angle, DEGREE_DECIMALS) for angle in advice.end.first_deg)
    distance_m = advice.end.away_m(advice.start)
    azimuth_deg = true_azimuth_deg(advice.start, advice.end)
    nats = round(advice.nats_per_km, 2)
    return NextWay(azimuth_deg, round(distance_m, 1), lat, lon, nats, advice.text, advice.why)


def true_azimuth_deg(start: Places, end: Places) -> float:
    """Direction from true north, 0 to 360 degrees, over distances of a walk.

    True and grid north differ by up to 3 degrees at the border of a zone.
    """
    lat_deg, lon_deg = start.first_deg
    to_lat_deg, to_lon_deg = end.first_deg
    east_deg = remainder(to_lon_deg - lon_deg, 360.0)  # 180 and -180 are one meridian
    east = east_deg * cos(radians(0.5 * (lat_deg + to_lat_deg)))
    return round(degrees(atan2(east, to_lat_deg - lat_deg)) % 360.0, 1) % 360.0


def squares_of_region(posterior: Posterior) -> MultiPolygon:
    """The squares of the 95 % region; of very many the least likely ones are left out."""
    squares, utm = posterior.squares, posterior.place.utm
    chosen = highest_density(squares)[:_MOST_SQUARES]
    half_m = 0.5 * squares.size_m[chosen]
    x_m, y_m = squares.x_m[chosen], squares.y_m[chosen]
    corners = [
        Places.of(x_m + east * half_m, y_m + north * half_m, utm=utm).lat_lon_deg[::-1]
        for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    rings = np.round(np.array(corners), _REGION_DECIMALS).transpose(2, 0, 1)
    return MultiPolygon(type="MultiPolygon", coordinates=rings[:, None].tolist())
