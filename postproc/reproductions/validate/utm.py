"""Map coordinates: the two examples of the checklist, and the edges it names."""

from math import hypot
from typing import NamedTuple

from logger.core.errors import GeoError
from logger.core.places import Utm, zone_of
from postproc.reproductions.validate.check import (
    Check,
    Effort,
    Line,
    checks_of,
    ours,
    theirs,
    wrong,
)

_ROUNDING_M = 0.06  # of the true coordinates, which have one decimal
_EXACT_DEG = 1e-9  # 0.1 mm


class Example(NamedTuple):
    """Claimed and true UTM coordinates; the true ones by PROJ's Transverse Mercator, to 0.1 m."""

    name: str
    lat_deg: float
    lon_deg: float
    zone: int
    claimed_m: tuple[float, float]
    true_m: tuple[float, float]


EXAMPLES = (
    Example("Tokyo Station", 35.6812, 139.7671, 54, (387773.0, 3950374.0), (388433.4, 3949290.0)),
    Example(
        "Sydney Opera House", -33.8568, 151.2153, -56, (334873.0, 6252264.0), (334900.6, 6252288.8)
    ),
)


def checks(_: Effort) -> list[Check]:
    """Zone and coordinates of both examples, there and back again, and where UTM ends."""
    examples = [line for example in EXAMPLES for line in _example(example)]
    return checks_of("UTM", *examples, _edge(), _poles())


def _example(example: Example) -> list[Line]:
    name, claimed_m = example.name, example.claimed_m
    zone = zone_of(example.lat_deg, example.lon_deg)
    utm = Utm(zone)
    x_m, y_m = utm.to_xy(example.lat_deg, example.lon_deg)
    error_m = max(abs(x_m - example.true_m[0]), abs(y_m - example.true_m[1]))
    off_m = hypot(x_m - claimed_m[0], y_m - claimed_m[1])
    lat_deg, lon_deg = utm.to_latlon(x_m, y_m)
    back_deg = max(abs(lat_deg - example.lat_deg), abs(lon_deg - example.lon_deg))
    agrees = back_deg < _EXACT_DEG
    return [
        Line(
            f"{name} is in zone {_zone(example.zone)}",
            f"zone {_zone(zone)}",
            ours(zone == example.zone),
        ),
        Line(
            f"{name} is at about ({claimed_m[0]:.0f}, {claimed_m[1]:.0f})",
            f"{x_m:.1f} E, {y_m:.1f} N: the claim is {_distance(off_m)} off",
            wrong(error_m < _ROUNDING_M),
        ),
        Line(
            f"{name}: forward and inverse agree",
            "to 1e-9 deg (0.1 mm)" if agrees else f"to {back_deg:.1e} deg",
            ours(agrees),
        ),
    ]


def _zone(zone: int) -> str:
    return f"{abs(zone)}{'N' if zone > 0 else 'S'}"


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:.2f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _edge() -> Line:
    west, east = (Utm(54).to_xy(35.0, 144.0 + side)[0] for side in (-_EXACT_DEG, _EXACT_DEG))
    step_m = abs(east - west)
    measured = "the zone of the first fix is kept: no step"
    if step_m >= 1e-3:
        measured = f"a step of {step_m:.3f} m"
    return Line("a walk across the edge of a zone is continuous", measured, ours(step_m < 1e-3))


def _poles() -> Line:
    claim = "edge cases (poles) are handled"
    try:
        zone_of(89.0, 0.0)
    except GeoError:
        return Line(claim, "refused beyond 84 deg, where UTM ends", theirs(True))
    return Line(claim, "89 deg was given a zone", "fails")
