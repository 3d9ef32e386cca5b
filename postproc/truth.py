"""True positions of a simulated run's transmitters."""

from collections.abc import Sequence

import shapely
from pyproj import Geod

from logger.core.runfile import Run
from postproc.estimators.region_outline import polygons
from postproc.result import CellResult
from postproc.result_json import TruthCheck

_GEOD = Geod(ellps="WGS84")


def truth_of(result: CellResult, runs: Sequence[Run]) -> TruthCheck | None:
    """True position of a simulated cell and the error of the best one; None for an unknown cell."""
    truth = next((t for run in runs for t in run.meta.truth if t.cell == result.cell), None)
    if truth is None:
        return None
    check = TruthCheck(lat=truth.lat_deg, lon=truth.lon_deg)
    if (place := result.place) and result.posterior is not None and result.obs is not None:
        check.error_m = _GEOD.inv(place.lon, place.lat, truth.lon_deg, truth.lat_deg)[2]
        point = shapely.Point(result.obs.utm.to_xy(truth.lat_deg, truth.lon_deg))
        check.inside_region95 = bool(polygons(result.posterior.squares).intersects(point))
    return check
