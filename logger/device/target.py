"""The target for a status line: its live estimate in degrees and metres."""

from logger.core.answer import DEGREE_DECIMALS
from logger.core.ellipse import Ellipse, ellipse95, radius_m
from logger.core.live_cell import EKF, ONE_MODE
from logger.core.places import Utm
from logger.core.types import LiveEstimate
from logger.device.status import TargetStatus


def target_status(cell: str | None, latest: LiveEstimate | None) -> TargetStatus | None:
    """The target and, once there is one, the latest estimate of it."""
    if cell is None:
        return None
    if latest is None or latest.cell != cell:
        return TargetStatus(cell, "cannot tell")
    lat_deg, lon_deg = Utm(latest.utm_zone).to_latlon(latest.x_m, latest.y_m)
    ellipse = ellipse95(latest.p_xx, latest.p_xy, latest.p_yy)
    r50_m, r95_m = (_radius_m(ellipse, level, latest.probability) for level in (0.5, 0.95))
    return TargetStatus(
        cell,
        estimate_verdict(latest),
        latest.n,
        round(latest.probability, 3),
        round(lat_deg, DEGREE_DECIMALS),
        round(lon_deg, DEGREE_DECIMALS),
        round(ellipse.semi_major_m, 1),
        round(ellipse.semi_minor_m, 1),
        round(ellipse.azimuth_deg, 1),
        r50_m,
        r95_m,
    )


def _radius_m(ellipse: Ellipse, level: float, probability: float) -> float | None:
    """Radius with `level` of all probability where the estimate has `probability` of it."""
    found_m = radius_m(ellipse, level / probability) if probability > level else None
    return None if found_m is None else round(found_m, 1)


def estimate_verdict(latest: LiveEstimate) -> str:
    """How sure the live estimate is of its position."""
    if latest.stage == EKF:
        return "one close place"
    return "one place" if latest.probability >= ONE_MODE else "several places"
