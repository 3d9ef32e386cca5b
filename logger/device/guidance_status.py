"""Position and next way of the followed cell for `status.json`, in degrees."""

import numpy as np

from logger.core.guidance.followed_cell import LivePosition
from logger.core.guidance.map_form import degrees_of
from logger.core.locator.region import highest_density
from logger.core.locator.rivals import relevant_modes
from logger.core.places import Places
from logger.device.status import ModeStatus, PositionStatus, Region, StrongestStatus

_MOST_SQUARES = 400
"""Squares of the region, 100 bytes each: the page loads them twice a second."""
_DECIMALS = 5
"""Of degrees: 1 m, which no phone shows."""


def position_status(cell: str, position: LivePosition) -> PositionStatus:
    """The posterior of the cell that is followed."""
    posterior = position.posterior
    lat, lon = degrees_of(posterior.place)
    strongest = posterior.strongest
    return PositionStatus(
        cell=cell,
        verdict=position.decision.verdict,
        lat=lat,
        lon=lon,
        r95_m=round(posterior.r95_m, 1),
        r50_m=round(posterior.r50_m, 1),
        area_m2=round(posterior.region_area_m2),
        region=_region(position),
        modes=tuple(
            ModeStatus(*degrees_of(mode.place), round(mode.probability, 3))
            for mode in relevant_modes(posterior.modes)
        ),
        strongest=StrongestStatus(*degrees_of(strongest.places), strongest.level_dbm.item()),
    )


def _region(position: LivePosition) -> Region:
    """The 95 % region as a GeoJSON MultiPolygon of squares; the least likely ones are left out."""
    squares, utm = position.posterior.squares, position.posterior.place.utm
    chosen = highest_density(squares)[:_MOST_SQUARES]
    half_m = 0.5 * squares.size_m[chosen]
    x_m, y_m = squares.x_m[chosen], squares.y_m[chosen]
    corners = [
        Places.of(x_m + east * half_m, y_m + north * half_m, utm=utm).lat_lon_deg[::-1]
        for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    rings = np.round(np.array(corners), _DECIMALS).transpose(2, 0, 1)
    return {"type": "MultiPolygon", "coordinates": rings[:, None].tolist()}
