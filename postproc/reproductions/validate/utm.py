"""Places on the map: the two the checklist gives, and the edges it names."""

from math import hypot
from typing import NamedTuple

from logger.core.errors import GeoError
from logger.core.geo import Utm, zone_of
from postproc.reproductions.validate.check import Check, Effort, ours, promised, wrong

TOPIC = "UTM"
_ROUNDED_M = 0.06


class _Place(NamedTuple):
    """Claimed and true UTM coordinates; the true ones by PROJ's Transverse Mercator, rounded to 0.1
    m.
    """

    name: str
    lat_deg: float
    lon_deg: float
    zone: int
    claimed_m: tuple[float, float]
    true_m: tuple[float, float]


PLACES = (
    _Place("Tokyo Station", 35.6812, 139.7671, 54, (387773.0, 3950374.0), (388433.4, 3949290.0)),
    _Place(
        "Sydney Opera House", -33.8568, 151.2153, -56, (334873.0, 6252264.0), (334900.6, 6252288.8)
    ),
)


def checks(_: Effort) -> list[Check]:
    """Zone and coordinates of both places, there and back again, and where UTM ends."""
    found = [check for place in PLACES for check in _place(place)]
    return [*found, _edge(), _poles()]


def _place(place: _Place) -> list[Check]:
    zone = zone_of(place.lat_deg, place.lon_deg)
    utm = Utm(zone)
    x_m, y_m = utm.to_xy(place.lat_deg, place.lon_deg)
    right = max(abs(x_m - place.true_m[0]), abs(y_m - place.true_m[1])) < _ROUNDED_M
    off_m = hypot(x_m - place.claimed_m[0], y_m - place.claimed_m[1])
    lat_deg, lon_deg = utm.to_latlon(x_m, y_m)
    back_deg = max(abs(lat_deg - place.lat_deg), abs(lon_deg - place.lon_deg))
    named = f"zone {abs(zone)}{'N' if zone > 0 else 'S'}"
    return [
        Check(
            TOPIC, f"{place.name} is in zone {_zone(place.zone)}", named, ours(zone == place.zone)
        ),
        Check(
            TOPIC,
            f"{place.name} is at about ({place.claimed_m[0]:.0f}, {place.claimed_m[1]:.0f})",
            f"{x_m:.1f} E, {y_m:.1f} N: the claim is {_distance(off_m)} off",
            wrong(right),
        ),
        Check(
            TOPIC,
            f"{place.name}: forward and inverse agree",
            "to 1e-9 deg (0.1 mm)" if back_deg < 1e-9 else f"to {back_deg:.1e} deg",
            ours(back_deg < 1e-9),
        ),
    ]


def _zone(zone: int) -> str:
    return f"{abs(zone)}{'N' if zone > 0 else 'S'}"


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:.2f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _edge() -> Check:
    west, east = Utm(54).to_xy(35.0, 144.0 - 1e-9)[0], Utm(54).to_xy(35.0, 144.0 + 1e-9)[0]
    return Check(
        TOPIC,
        "a walk across the edge of a zone is continuous",
        "the zone of the first fix is kept: no step"
        if abs(east - west) < 1e-3
        else f"{east - west:.3f} m of step",
        ours(abs(east - west) < 1e-3),
    )


def _poles() -> Check:
    try:
        zone_of(89.0, 0.0)
    except GeoError:
        return Check(
            TOPIC,
            "edge cases (poles) are handled",
            "refused beyond 84 deg, where UTM ends",
            promised(True),
        )
    return Check(TOPIC, "edge cases (poles) are handled", "89 deg was given a zone", "fails")
