"""What a simulated run knows about itself: where its transmitters really stand."""

from collections.abc import Sequence
from typing import Any

import shapely
from pyproj import Geod

from logger.core.runfile import Run
from postproc.estimators.region_outline import polygons
from postproc.result import CellResult

_GEOD = Geod(ellps="WGS84")


def truth_of(result: CellResult, runs: Sequence[Run]) -> dict[str, Any] | None:
    """True place of a simulated cell, the error of the best place, and whether the 95 % region
    holds the truth.
    """
    truth = next((t for run in runs for t in run.meta.truth if t.cell == result.cell), None)
    if truth is None:
        return None
    found: dict[str, Any] = {
        "lat": truth.lat_deg,
        "lon": truth.lon_deg,
        "error_m": None,
        "inside_region95": None,
    }
    if result.posterior is not None and result.obs is not None:
        utm = result.obs.utm
        lat, lon = utm.to_latlon(result.posterior.x_m, result.posterior.y_m)
        found["error_m"] = _GEOD.inv(lon, lat, truth.lon_deg, truth.lat_deg)[2]
        place = shapely.Point(utm.to_xy(truth.lat_deg, truth.lon_deg))
        found["inside_region95"] = bool(polygons(result.posterior.squares).intersects(place))
    return found
