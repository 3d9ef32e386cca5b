"""The verdict: located, ambiguous or cannot tell, with the reason in plain words."""

from typing import Literal

import numpy as np

from logger.core.observations import CellObservations
from postproc.estimators.posterior import LEAST_PEAK, Mode, Posterior

_MINOR_PLACE = 0.03
_FEWEST_READINGS = 8
_SHORTEST_WALK_M = 20.0
_LEAST_CHANGE_DB = 1.0
_ONE_SIDED_DEG = 90.0

Verdict = Literal["located", "ambiguous", "cannot tell"]


def verdict(posterior: Posterior, obs: CellObservations) -> tuple[Verdict, list[str]]:
    """Whether the walk locates the transmitter, and in plain words why or why not."""
    reasons = _too_little(posterior, obs)
    if reasons:
        return "cannot tell", reasons
    best = posterior.modes[0]
    if not _has_rivals(posterior):
        return "located", [f"one place holds {best.probability:.0%}; 95 % lie within {posterior.r95_m:.0f} m of it"]
    named = ", ".join(f"{mode.probability:.0%} at {_place(mode, obs)}" for mode in posterior.modes)
    return "ambiguous", [f"the levels fit several places: {named}", "a walk that bends near one of them would tell"]


def _place(mode: Mode, obs: CellObservations) -> str:
    lat_deg, lon_deg = obs.utm.to_latlon(mode.x_m, mode.y_m)
    return f"{lat_deg:.5f} {lon_deg:.5f}"


def _too_little(posterior: Posterior, obs: CellObservations) -> list[str]:
    """Why the readings do not hold the answer."""
    walk_m = float(np.hypot(np.ptp(obs.x_m), np.ptp(obs.y_m)))
    radius_m = float(np.sqrt(posterior.region_area_m2 / np.pi))
    rivals = _has_rivals(posterior)
    # a single place may have a thin far tail, which widens its ellipse but not the radius that holds 95 %
    widest_m = (
        max(mode.ellipse.semi_major_m for mode in posterior.modes if _counts(mode)) if rivals else posterior.r95_m
    )
    seen_deg = _azimuths_seen_deg(posterior, obs)
    allowed_m = _allowed_m(posterior, obs, walk_m)
    doubts = {
        f"only {len(obs)} readings, at least {_FEWEST_READINGS} are needed": len(obs) < _FEWEST_READINGS,
        f"the walk spans only {walk_m:.0f} m": walk_m < _SHORTEST_WALK_M,
        "the level hardly changes along the walk": float(np.std(obs.level_dbm)) < _LEAST_CHANGE_DB,
        f"the transmitter may be farther than the searched {posterior.prior.reach_m / 1000:.0f} km": posterior.at_limit,
        f"one-sided walk: it sees the place under {seen_deg:.0f} deg only": seen_deg < _ONE_SIDED_DEG and not rivals,
        f"the region is too large: {max(radius_m, widest_m):.0f} m in radius, where this walk would have to leave "
        f"{allowed_m:.0f} m at most": max(radius_m, widest_m) > allowed_m,
    }
    return [reason for reason, holds in doubts.items() if holds]


def _azimuths_seen_deg(posterior: Posterior, obs: CellObservations) -> float:
    """How much of the circle around the best place the walk takes up."""
    bearing = np.sort(np.degrees(np.arctan2(obs.x_m - posterior.x_m, obs.y_m - posterior.y_m)))
    return 360.0 - float(np.max(np.diff(np.append(bearing, bearing[0] + 360.0))))


def _counts(mode: Mode) -> bool:
    return mode.probability >= _MINOR_PLACE or mode.peak >= LEAST_PEAK


def _has_rivals(posterior: Posterior) -> bool:
    """Whether another place cannot be dismissed: for its mass, or since it fits as well though it is small."""
    return any(_counts(mode) for mode in posterior.modes[1:])


def _allowed_m(posterior: Posterior, obs: CellObservations, walk_m: float) -> float:
    """Largest radius called a location: half the walk's extent and half the median distance, 30 m for a near pass.

    Several places may each be twice as large: what counts there is that they are told apart.
    """
    median_m = float(np.median(np.hypot(obs.x_m - posterior.x_m, obs.y_m - posterior.y_m)))
    share = 1.0 if _has_rivals(posterior) else 0.5
    return share * min(walk_m, max(median_m, 60.0))
