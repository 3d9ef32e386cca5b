"""WGS 84 <-> UTM in one zone for a run: a walk across its border or the equator is continuous.

Transverse Mercator by PROJ (Karney 2011), accurate to nanometres at the distances of a walk, also
far outside the zone.
"""

from dataclasses import dataclass

import numpy as np
from pyproj import Proj

from logger.core.arrays import FloatArray
from logger.core.errors import GeoError

MAX_LATITUDE_DEG = 84.0
"""UTM ends here (NGA.STND.0037); the last degrees belong to polar projections."""


def zone_of(lat_deg: float, lon_deg: float) -> int:
    """UTM zone 1..60 of a position, negative on the southern hemisphere.

    The wider zones of Norway and Svalbard are not applied: any zone nearby serves a walk equally
    well. Raises `GeoError` for a latitude beyond 84 deg or a value that is no position.
    """
    check_position(lat_deg, lon_deg)
    zone = int((lon_deg + 180.0) // 6.0) % 60 + 1
    return zone if lat_deg >= 0.0 else -zone


def check_position(lat_deg: float, lon_deg: float) -> None:
    """Raise `GeoError` unless the position can be mapped."""
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        raise GeoError(f"no position on Earth: latitude {lat_deg}, longitude {lon_deg} deg")
    if abs(lat_deg) > MAX_LATITUDE_DEG:
        raise GeoError(
            f"latitude {lat_deg:.4f} deg is beyond 84 deg, where UTM ends; "
            "cellwalk cannot map this walk"
        )


@dataclass(frozen=True, slots=True)
class Utm:
    """One UTM zone for a complete run; `zone` as returned by `zone_of`."""

    zone: int

    @classmethod
    def at(cls, lat_deg: float, lon_deg: float) -> "Utm":
        """Zone of the first fix of a run."""
        return cls(zone_of(lat_deg, lon_deg))

    def to_xy(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """East and north of one position in metres."""
        check_position(lat_deg, lon_deg)
        x_m, y_m = _proj(self.zone)(lon_deg, lat_deg)
        return float(x_m), float(y_m)

    def to_xy_arrays(
        self, lat_deg: FloatArray, lon_deg: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """East and north in metres, shape as the arguments."""
        if lat_deg.size:
            for values in (lat_deg, lon_deg):
                worst = np.argmax(np.abs(values))
                check_position(float(lat_deg.flat[worst]), float(lon_deg.flat[worst]))
        x_m, y_m = _proj(self.zone)(lon_deg, lat_deg)
        return np.asarray(x_m, float), np.asarray(y_m, float)

    def to_latlon(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Latitude and longitude in degrees of one position."""
        lon_deg, lat_deg = _proj(self.zone)(x_m, y_m, inverse=True)
        return float(lat_deg), float(lon_deg)

    def to_latlon_arrays(self, x_m: FloatArray, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Latitude and longitude in degrees, shape as the arguments."""
        lon_deg, lat_deg = _proj(self.zone)(x_m, y_m, inverse=True)
        return np.asarray(lat_deg, float), np.asarray(lon_deg, float)


_PROJ: dict[int, Proj] = {}


def _proj(zone: int) -> Proj:
    if zone not in _PROJ:
        _PROJ[zone] = Proj(proj="utm", zone=abs(zone), south=zone < 0, ellps="WGS84")
    return _PROJ[zone]
