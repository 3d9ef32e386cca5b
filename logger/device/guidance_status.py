"""The answer about the followed cell for `status.json`, rounded to what a phone shows."""

import numpy as np

from logger.core.answer import DEGREE_DECIMALS, Answer, StrongestReading
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import highest_density
from logger.core.places import Places
from logger.device.status import ModeStatus, PositionStatus, Region

_MOST_SQUARES = 400
"""Squares of the region, 100 bytes each: the page loads them twice a second."""
_REGION_DECIMALS = 5
"""Of degrees: 1 m, which no phone shows."""


def position_status(answer: Answer, posterior: Posterior) -> PositionStatus:
    """The answer, and the region of the posterior that it was made of."""
    place = answer.place
    if place is None:
        return PositionStatus(answer.cell, answer.verdict)
    shown, strongest = place.to_tenth_metre(), place.strongest
    return PositionStatus(
        cell=answer.cell,
        verdict=answer.verdict,
        lat=shown.lat,
        lon=shown.lon,
        r95_m=shown.r95_m,
        r50_m=shown.r50_m,
        area_m2=round(place.area_m2),
        region=_region(posterior),
        modes=tuple(
            ModeStatus(
                round(mode.lat, DEGREE_DECIMALS),
                round(mode.lon, DEGREE_DECIMALS),
                round(mode.probability, 3),
            )
            for mode in place.likely_modes
        ),
        strongest=StrongestReading(
            lat=round(strongest.lat, DEGREE_DECIMALS),
            lon=round(strongest.lon, DEGREE_DECIMALS),
            level_dbm=strongest.level_dbm,
        ),
    )


def _region(posterior: Posterior) -> Region:
    """The 95 % region as a GeoJSON MultiPolygon of squares; the least likely ones are left out."""
    squares, utm = posterior.squares, posterior.place.utm
    chosen = highest_density(squares)[:_MOST_SQUARES]
    half_m = 0.5 * squares.size_m[chosen]
    x_m, y_m = squares.x_m[chosen], squares.y_m[chosen]
    corners = [
        Places.of(x_m + east * half_m, y_m + north * half_m, utm=utm).lat_lon_deg[::-1]
        for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    rings = np.round(np.array(corners), _REGION_DECIMALS).transpose(2, 0, 1)
    return {"type": "MultiPolygon", "coordinates": rings[:, None].tolist()}
