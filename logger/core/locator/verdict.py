"""The verdict: located, ambiguous or cannot tell, with the reason in plain words.

What is said to be located has to be so with less trust as well: with every correlated noise
believed as little as that of hills and streets. Of 13 measured walks located without that doubt 4
were not where that said, of the 9 left 1.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, log10
from typing import Literal

import numpy as np

from logger.core.locator.posterior import Mode, Posterior, locate
from logger.core.locator.rivals import relevant_modes, whole_percents
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, Division, divide
from logger.core.observations import CellObservations

_FEWEST_READINGS = 8
_SHORTEST_WALK_M = 20.0
_LEAST_CHANGE_DB = 1.0
_ONE_SIDED_DEG = 90.0
_PASSING_M = 20.0
_DOUBTED = 1.25

Verdict = Literal["located", "ambiguous", "cannot tell"]


def judged(
    posterior: Posterior, obs: CellObservations
) -> tuple[Verdict, list[str], Division | None]:
    """The verdict after every check, and the division in two transmitters that was asked about."""
    obs = obs.usable()
    division = divide(obs, posterior)
    told, reasons = verdict(posterior, obs, division)
    if told == "located":
        doubted, why = verdict(
            locate(obs, replace(posterior.prior, stationary_m=0.0)), obs, larger=_DOUBTED
        )
        if doubted != "located":
            told = "cannot tell"
            even = "But that needs shadowing as even as it looks in this walk"
            reasons = [f"{reasons[0]}. {even}; if it is less even, {why[0]}"]
    return told, reasons, division


def verdict(
    posterior: Posterior,
    obs: CellObservations,
    division: Division | None = None,
    *,
    larger: float = 1.0,
) -> tuple[Verdict, list[str]]:
    """Whether the walk locates the transmitter, and in plain words why or why not.

    `division` is what two transmitters would explain, where that was asked; the region may be
    `larger` than usual.
    """
    if division is not None and division.log_factor > LEAST_LOG_FACTOR:
        return "cannot tell", [_two(division, obs)]
    obs = obs.usable()
    reasons = _too_little(posterior, obs, larger)
    if reasons:
        return "cannot tell", reasons
    places = relevant_modes(posterior.modes)
    shares = whole_percents(places)
    if len(places) == 1:
        return "located", [
            f"one place holds {shares[0]}%; 95 % lie within {posterior.r95_m:.0f} m of it"
        ]
    named = [f"{share}% at {_place(mode, obs)}" for share, mode in zip(shares, places, strict=True)]
    elsewhere = [f"{100 - sum(shares)}% elsewhere"] if sum(shares) < 100 else []
    return "ambiguous", [
        f"the levels fit several places: {', '.join(named + elsewhere)}",
        _advice(places, obs),
    ]


def _two(division: Division, obs: CellObservations) -> str:
    (lat1, lon1), (lat2, lon2) = (
        obs.utm.to_latlon(*place) for place in (division.one_m, division.other_m)
    )
    return (
        f"one position does not explain the data: two transmitters that share this identity would, near {lat1:.5f} "
        f"{lon1:.5f} and near {lat2:.5f} {lon2:.5f}; or something else shapes the levels (terrain, a sector antenna)"
    )


def _advice(places: Sequence[Mode], obs: CellObservations) -> str:
    """Where to walk to decide between the two strongest places, and which level there speaks for
    which.
    """
    near, far = sorted(
        places[:2], key=lambda mode: hypot(mode.x_m - obs.x_m[-1], mode.y_m - obs.y_m[-1])
    )
    way_m = hypot(near.x_m - obs.x_m[-1], near.y_m - obs.y_m[-1])
    apart_m = hypot(near.x_m - far.x_m, near.y_m - far.y_m)
    here_dbm, there_dbm = (
        float(m.state[2] - 10.0 * m.state[3] * log10(max(d, _PASSING_M)))
        for m, d in ((near, _PASSING_M), (far, apart_m))
    )
    return (
        f"to decide walk past {_place(near, obs)}, {way_m:.0f} m from where this walk ended: about {here_dbm:.0f} dBm "
        f"there if it is this place, {there_dbm:.0f} dBm if it is the one {apart_m:.0f} m away"
    )


def _place(mode: Mode, obs: CellObservations) -> str:
    lat_deg, lon_deg = obs.utm.to_latlon(mode.x_m, mode.y_m)
    return f"{lat_deg:.5f} {lon_deg:.5f}"


def _too_little(posterior: Posterior, obs: CellObservations, larger: float) -> list[str]:
    """Why the readings do not hold the answer."""
    walk_m = float(np.hypot(np.ptp(obs.x_m), np.ptp(obs.y_m)))
    radius_m = float(np.sqrt(posterior.region_area_m2 / np.pi))
    places = relevant_modes(posterior.modes)
    rivals = len(places) > 1
    # a single place may have a thin far tail, which widens its ellipse but not the radius that
    # holds 95 %
    widest_m = max(mode.ellipse.semi_major_m for mode in places) if rivals else posterior.r95_m
    seen_deg = _azimuths_seen_deg(posterior, obs)
    allowed_m = larger * _allowed_m(posterior, obs, walk_m)
    doubts = {
        f"only {len(obs)} readings, at least {_FEWEST_READINGS} are needed": len(obs)
        < _FEWEST_READINGS,
        f"the walk spans only {walk_m:.0f} m": walk_m < _SHORTEST_WALK_M,
        "the level hardly changes along the walk": float(np.std(obs.level_dbm)) < _LEAST_CHANGE_DB,
        f"the transmitter may be farther than the searched {posterior.prior.reach_m / 1000:.0f} km": posterior.at_limit,
        f"the walk passes the place on one side only: seen from there it covers {seen_deg:.0f} of 360 degrees": (
            seen_deg < _ONE_SIDED_DEG and not rivals
        ),
        f"the region is too large to be called a place: {max(radius_m, widest_m):.0f} m in radius, and a walk like "
        f"this one has to bring it down to {allowed_m:.0f} m": max(radius_m, widest_m) > allowed_m,
    }
    return [reason for reason, holds in doubts.items() if holds]


def _azimuths_seen_deg(posterior: Posterior, obs: CellObservations) -> float:
    """How much of the circle around the best place the walk takes up."""
    bearing = np.sort(np.degrees(np.arctan2(obs.x_m - posterior.x_m, obs.y_m - posterior.y_m)))
    return 360.0 - float(np.max(np.diff(np.append(bearing, bearing[0] + 360.0))))


def _allowed_m(posterior: Posterior, obs: CellObservations, walk_m: float) -> float:
    """Largest radius called a location: half the walk's extent and half the median distance, 30 m
    for a near pass.

    Several places may each be twice as large: what counts there is that they are told apart.
    """
    median_m = float(np.median(np.hypot(obs.x_m - posterior.x_m, obs.y_m - posterior.y_m)))
    share = 1.0 if len(relevant_modes(posterior.modes)) > 1 else 0.5
    return share * min(walk_m, max(median_m, 60.0))
