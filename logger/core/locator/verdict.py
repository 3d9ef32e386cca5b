"""Located, ambiguous or cannot tell, with reasons, from a posterior and its readings.

1. Two transmitters explain the levels far better than one: cannot tell.
2. The levels do not show a distance (`GUARDS`), however narrow the region: cannot tell.
3. One relevant mode (`relevant_modes`), and 95 % of the probability within `within_m` of the
   position shown: located.
4. Several relevant modes, each with a 95 % ellipse within that radius: ambiguous.
5. Otherwise: cannot tell. What widens the region is listed after that reason.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from logger.core.certainty import metres, share_text, whole_percents
from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, Division
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.places import NO_MAP, Places
from logger.core.readings import Readings
from logger.core.types import Verdict

_FEWEST_READINGS = 8
"""Twice the four unknowns x, y, P0 and eta."""
_SHORTEST_WALK_M = 20.0
"""Shorter walks are within the errors of fixes and the correlation of shadowing."""
_LEAST_SPAN_DB = 6.0
"""Half the distance is 6 dB in free space: over less, noise alone may look like an approach."""
_ETA_RANGE = (1.5, 6.0)
"""Measured walks that are located have 2.0 to 3.7."""
_ETA_SIGMAS = 2.0  # closer to the least exponent it is the prior that makes levels fall
_ONE_SIDED_DEG = 90.0
"""A walk around less than a quarter of the circle cannot bound its distance."""
_PASSING_M = 20.0
"""Distance at which the advice states levels: walking past, not through, a building."""
_CONTRADICTION, _MOST_OUTSIDE = 0.6, 0.2
"""Of the probability without the area, what is outside of it: where the readings contradict it, and
most of it where a location is one by the readings too.

Of 131 measured walks, searched within 100 m, those with the transmitter there had more than the
first in 7 of 57, the others in 49 of 74. A small area has 95 % within a few steps whatever the
readings: by the area alone 18 of those 74 were located where nothing is, with the second bound 2,
and of the 57 with the transmitter there 24 and 16.
"""
DESK_M = 150.0
"""A group of houses, which one more walk can search."""
LIVE_M = 60.0
"""A house and its neighbours: a walker there may look at the roofs and end the walk."""


class Decision(NamedTuple):
    """The verdict, its reasons, and the two transmitters that were tried instead of one.

    `needed_m` is the radius that a location needs where the first reason is a wider region; else
    None.
    """

    verdict: Verdict
    reasons: list[str]
    division: Division | None = None
    needed_m: float | None = None


@dataclass(frozen=True)
class _Case:
    posterior: Posterior
    obs: Readings

    @property
    def modes(self) -> tuple[Mode, ...]:
        return self.posterior.likely_modes

    @cached_property
    def walk_m(self) -> float:
        """Diagonal of the box around the walk."""
        return float(np.hypot(*np.ptp(self.obs.places.xy_m, axis=1)))

    @cached_property
    def azimuths_deg(self) -> float:
        """Part of the circle around the best position that the walk covers."""
        east_m, north_m = self.obs.places.xy_m - self.posterior.place.xy_m
        bearing = np.sort(np.degrees(np.arctan2(east_m, north_m)))
        gaps = np.diff(np.append(bearing, bearing[0] + 360.0))
        return 360.0 - float(np.max(gaps))


def _few_readings(case: _Case) -> str | None:
    if len(case.obs) >= _FEWEST_READINGS:
        return None
    return f"only {len(case.obs)} readings, at least {_FEWEST_READINGS} are needed"


def _short_walk(case: _Case) -> str | None:
    return f"the walk spans only {case.walk_m:.0f} m" if case.walk_m < _SHORTEST_WALK_M else None


def _small_span(case: _Case) -> str | None:
    obs, offsets = case.obs, case.posterior.offsets
    level_dbm = (obs if offsets is None else obs.on_one_scale(offsets.mean_db)).level_dbm
    span_db = float(np.ptp(level_dbm))
    if span_db >= _LEAST_SPAN_DB:
        return None
    return (
        f"the level hardly changes along the walk: it spans {span_db:.0f} of the "
        f"{_LEAST_SPAN_DB:.0f} dB that a location needs"
    )


def _eta_at_bound(case: _Case) -> str | None:
    mode, least = case.modes[0], case.posterior.prior.least_eta
    eta, sigma = float(mode.state[3]), float(np.sqrt(mode.covariance[3, 3]))
    low, high = _ETA_RANGE
    if eta >= high:
        how = "fall too steeply"
    elif eta <= low:
        how = "hardly fall"
    elif eta - _ETA_SIGMAS * sigma < least:
        how = "may hardly fall"
    else:
        return None
    return (
        f"the levels {how} with the distance from the position: "
        f"a path loss exponent of {eta:.1f} ± {sigma:.1f}"
    )


def _unknown_distance(case: _Case) -> str | None:
    if case.posterior.at_limit:
        reach_km = case.posterior.prior.reach_m / 1000
        return f"the transmitter may be farther than the searched {reach_km:.0f} km"
    if not case.posterior.may_be_distant:
        return None
    return (
        "the levels do not bound the distance: they fit a mast kilometres away as well, "
        "and the radii suppose that it is none"
    )


def _one_sided(case: _Case) -> str | None:
    if case.azimuths_deg >= _ONE_SIDED_DEG or len(case.modes) > 1:
        return None
    return (
        "the walk passes the position on one side only: "
        f"seen from there, it covers {case.azimuths_deg:.0f} of 360 degrees"
    )


GUARDS: tuple[Callable[[_Case], str | None], ...] = (_few_readings, _small_span, _eta_at_bound)
"""What makes a region no evidence, whatever its size: a sentence each, or None."""
HINTS: tuple[Callable[[_Case], str | None], ...] = (
    _short_walk,
    _unknown_distance,
    _one_sided,
)
"""What widens a region: a sentence each, or None."""


def assess(
    posterior: Posterior,
    obs: Readings,
    division: Division | None = None,
    *,
    within_m: float = DESK_M,
) -> Decision:
    """Whether the walk locates the transmitter within a radius, and why.

    `division` are two transmitters that were tried instead of one.
    """
    if division is not None and division.log_factor > LEAST_LOG_FACTOR:
        return Decision("cannot tell", [_two_transmitters(division, obs)], division)
    case = _Case(posterior, obs.usable())
    percents = whole_percents(case.modes)
    is_single = len(case.modes) == 1
    radius_m = posterior.r95_m if is_single else _widest_m(case.modes)
    reasons = [why for rule in GUARDS if (why := rule(case))]
    is_wide = radius_m > within_m
    if is_wide:
        reasons.insert(0, _too_wide(case, radius_m, within_m))
    outside, outside_share = outside_text(posterior), posterior.outside_share or 0.0
    contradiction = contradiction_of(posterior)
    if contradiction:
        reasons.insert(0, contradiction)
    elif outside_share > _MOST_OUTSIDE:
        needed = f"{outside}, and a location needs at most {share_text(_MOST_OUTSIDE)}"
        reasons.append(f"the readings do not show that it is in the area: {needed}")
    needed_m = within_m if is_wide and not contradiction else None
    if reasons:
        reasons += [hint for rule in HINTS if (hint := rule(case))]
        verdict: Verdict = "cannot tell"
    elif is_single:
        radius = f"95 % lie within {posterior.r95_m:.0f} m of it"
        verdict, reasons = "located", [f"one position holds {_share_text(percents[0])}; {radius}"]
    else:
        verdict, reasons = "ambiguous", [_shares(case, percents), _advice(case)]
    if outside and outside_share <= _MOST_OUTSIDE:
        reasons.append(outside)
    return Decision(verdict, reasons, division, needed_m)


def may_move(moves: Division) -> Decision:
    """Cannot tell, since a transmitter that moves explains the levels as well."""
    one, other = map(place_text, (moves.one, moves.other))
    why = (
        "the levels also fit a transmitter that moves, "
        f"from near {one} to near {other}: come back after some minutes"
    )
    return Decision("cannot tell", [why], moves)


def contradiction_of(posterior: Posterior) -> str:
    """That the readings contradict the area of the prior; empty where they do not."""
    if (posterior.outside_share or 0.0) <= _CONTRADICTION:
        return ""
    return f"the readings contradict the area: {outside_text(posterior)}"


def outside_text(posterior: Posterior) -> str:
    """How much the area of the prior has left out; empty without one."""
    area, outside = posterior.prior.area, posterior.outside_share
    if area is None or outside is None:
        return ""
    return f"without the area, {share_text(outside)} is not {area.text}"


def _widest_m(modes: Sequence[Mode]) -> float:
    return max(mode.ellipse.semi_major_m for mode in modes)


def _too_wide(case: _Case, radius_m: float, within_m: float) -> str:
    radius = f"{metres(radius_m)}, and a location needs {metres(within_m)}"
    if len(case.modes) == 1:
        return f"95 % lie within {radius}"
    return f"the widest of {len(case.modes)} places reaches over {radius}"


def _two_transmitters(division: Division, obs: Readings) -> str:
    first = place_text(division.one)
    second = place_text(division.other)
    if division.is_in_time and not obs.is_timed:  # those of several walks have no order in time
        return (
            "one position does not explain the data: the transmitter seems to have moved, between "
            f"{first} and {second}"
        )
    if division.is_in_time:
        return (
            "one position does not explain the data: the transmitter seems to have moved, "
            f"from near {first} to near {second}"
        )
    return (
        "one position does not explain the data: two transmitters that share this identity would, "
        f"near {first} and near {second}; "
        "or something else shapes the levels (terrain, a sector antenna)"
    )


def _share_text(percent: int) -> str:
    return share_text(percent / 100.0)


def _shares(case: _Case, percents: Sequence[int]) -> str:
    names = [
        f"{_share_text(percent)} at {place_text(mode.place, mode.ellipse.semi_major_m)}"
        for percent, mode in zip(percents, case.modes, strict=True)
    ]
    rest = 100 - sum(percents)
    elsewhere = [f"{rest} % elsewhere"] if rest > 0 else []
    return f"the levels fit several places: {', '.join(names + elsewhere)}"


def _advice(case: _Case) -> str:
    """Where to walk to decide between the two strongest modes, and the level there."""
    end = case.obs.places[-1]
    near, far = sorted(case.modes[:2], key=lambda mode: mode.place.away_m(end))
    way_m, apart_m = near.place.away_m(end), near.place.away_m(far.place)
    if_near_dbm = _expected_dbm(case, near, _PASSING_M)
    if_far_dbm = _expected_dbm(case, far, apart_m)
    return (
        f"to decide, walk past {place_text(near.place, near.ellipse.semi_major_m)}, "
        f"{metres(way_m)} from where this walk ended: about {if_near_dbm:.0f} dBm there "
        f"if it is this position, {if_far_dbm:.0f} dBm if it is the one {metres(apart_m)} away"
    )


def _expected_dbm(case: _Case, mode: Mode, distance_m: float) -> float:
    """By the posterior's model, for a walk as certain as this one."""
    _, _, p0_dbm, eta = mode.state.tolist()
    height_m, sigma_m = case.posterior.prior.height_m, float(np.median(case.obs.places.sigma_m))
    distance_db = log_distance_db(max(distance_m, _PASSING_M), 0.0, height_m, sigma_m)
    return float(level_dbm(p0_dbm, eta, distance_db))


_NEAR_M = 500.0  # each of two transmitters has half of the readings


def place_text(place: Places, r95_m: float = _NEAR_M) -> str:
    """Latitude and longitude of a place, as reasons name it; on no map x and y in metres."""
    if place.utm == NO_MAP:
        return f"x {place.x_m.item():.0f} m, y {place.y_m.item():.0f} m"
    return place.on_map.within(r95_m)
