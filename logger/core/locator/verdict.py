"""The rules of the verdict: located, ambiguous or cannot tell, with reasons.

`assess` applies them in this order:

1. Two transmitters explain the walk far better than one: cannot tell.
2. Any of `DOUBTS` holds: cannot tell, with all that hold.
3. Several modes are relevant (`rivals.relevant_modes`): ambiguous.
4. Otherwise: located.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Literal, NamedTuple

import numpy as np

from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.rivals import relevant_modes, whole_percents
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, Division
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.observations import CellObservations

Verdict = Literal["located", "ambiguous", "cannot tell"]

_FEWEST_READINGS = 8
"""Twice the four unknowns x, y, P0 and eta."""
_SHORTEST_WALK_M = 20.0
"""Shorter walks are within the errors of a few fixes and the correlation of shadowing."""
_LEAST_CHANGE_DB = 1.0
"""Modems report whole decibels: less change than that may be rounding alone."""
_ONE_SIDED_DEG = 90.0
"""A walk that covers less than a quarter around the position cannot bound its distance."""
_PASSING_M = 20.0
"""Distance at which the advice states levels: walking past, not through, a building."""
_CAUTIOUS_FACTOR = 1.25
"""The region may be this much larger where correlated noise is trusted less."""
_NEAR_PASS_M = 60.0
"""A walk that passes nearer than this need not bring the radius below half of it."""


class Decision(NamedTuple):
    """The verdict, its reasons, and the two transmitters that were tried instead of one."""

    verdict: Verdict
    reasons: list[str]
    division: Division | None = None


@dataclass(frozen=True)
class _Case:
    """A posterior and the usable readings behind it; the region may be `factor` times as large."""

    posterior: Posterior
    obs: CellObservations
    factor: float

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        return relevant_modes(self.posterior.modes)

    @cached_property
    def walk_m(self) -> float:
        """Diagonal of the box around the walk."""
        return float(np.hypot(np.ptp(self.obs.x_m), np.ptp(self.obs.y_m)))

    @cached_property
    def azimuths_deg(self) -> float:
        """Part of the circle around the best position that the walk covers."""
        east_m, north_m = self.obs.x_m - self.posterior.x_m, self.obs.y_m - self.posterior.y_m
        bearing = np.sort(np.degrees(np.arctan2(east_m, north_m)))
        gaps = np.diff(np.append(bearing, bearing[0] + 360.0))
        return 360.0 - float(np.max(gaps))

    @cached_property
    def radius_m(self) -> float:
        """Radius of a circle as large as the region, or of the widest mode if that is larger.

        A single mode may have a thin far tail, which widens its ellipse but not the 95 % radius.
        """
        radius_m = float(np.sqrt(self.posterior.region_area_m2 / np.pi))
        if len(self.modes) == 1:
            return max(radius_m, self.posterior.r95_m)
        return max(radius_m, *(mode.ellipse.semi_major_m for mode in self.modes))

    @cached_property
    def allowed_m(self) -> float:
        """Largest radius of a location: half the walk's extent and half the median distance.

        Several modes may each be twice as large: what counts is that they are distinguished.
        """
        east_m, north_m = self.obs.x_m - self.posterior.x_m, self.obs.y_m - self.posterior.y_m
        median_m = float(np.median(np.hypot(east_m, north_m)))
        share = 1.0 if len(self.modes) > 1 else 0.5
        return self.factor * (share * min(self.walk_m, max(median_m, _NEAR_PASS_M)))


def _few_readings(case: _Case) -> str | None:
    if len(case.obs) >= _FEWEST_READINGS:
        return None
    return f"only {len(case.obs)} readings, at least {_FEWEST_READINGS} are needed"


def _short_walk(case: _Case) -> str | None:
    return f"the walk spans only {case.walk_m:.0f} m" if case.walk_m < _SHORTEST_WALK_M else None


def _constant_level(case: _Case) -> str | None:
    if float(np.std(case.obs.level_dbm)) >= _LEAST_CHANGE_DB:
        return None
    return "the level hardly changes along the walk"


def _beyond_reach(case: _Case) -> str | None:
    if not case.posterior.at_limit:
        return None
    reach_km = case.posterior.prior.reach_m / 1000
    return f"the transmitter may be farther than the searched {reach_km:.0f} km"


def _one_sided(case: _Case) -> str | None:
    if case.azimuths_deg >= _ONE_SIDED_DEG or len(case.modes) > 1:
        return None
    return (
        "the walk passes the position on one side only: "
        f"seen from there, it covers {case.azimuths_deg:.0f} of 360 degrees"
    )


def _large_region(case: _Case) -> str | None:
    if case.radius_m <= case.allowed_m:
        return None
    return (
        f"the region is too large for a location: {case.radius_m:.0f} m in radius, "
        f"at most {case.allowed_m:.0f} m for a walk like this one"
    )


DOUBTS: tuple[Callable[[_Case], str | None], ...] = (
    _few_readings,
    _short_walk,
    _constant_level,
    _beyond_reach,
    _one_sided,
    _large_region,
)
"""Rules that each give the reason why a walk does not locate its transmitter, or None."""


def assess(
    posterior: Posterior,
    obs: CellObservations,
    division: Division | None = None,
    *,
    factor: float = 1.0,
) -> Decision:
    """Whether the walk locates the transmitter, and why or why not.

    `division` are two transmitters that were tried instead of one; the region may be `factor` times
    as large as usual.
    """
    if division is not None and division.log_factor > LEAST_LOG_FACTOR:
        return Decision("cannot tell", [_two_transmitters(division, obs)], division)
    case = _Case(posterior, obs.usable(), factor)
    reasons = [reason for rule in DOUBTS if (reason := rule(case))]
    if reasons:
        return Decision("cannot tell", reasons, division)
    percents = whole_percents(case.modes)
    if len(case.modes) == 1:
        radius = f"95 % lie within {posterior.r95_m:.0f} m of it"
        return Decision("located", [f"one position holds {percents[0]}%; {radius}"], division)
    return Decision("ambiguous", [_shares(case, percents), _advice(case)], division)


def doubt(decision: Decision, cautious: Posterior, obs: CellObservations) -> Decision:
    """The decision "located", unless the `cautious` posterior of the same walk contradicts it."""
    second = assess(cautious, obs, factor=_CAUTIOUS_FACTOR)
    if second.verdict == "located":
        return decision
    reason = (
        f"{decision.reasons[0]}. But that needs shadowing as even as it looks in this walk; "
        f"if it is less even, {second.reasons[0]}"
    )
    return decision._replace(verdict="cannot tell", reasons=[reason])


def _two_transmitters(division: Division, obs: CellObservations) -> str:
    first = _degrees(obs, *division.one_m)
    second = _degrees(obs, *division.other_m)
    return (
        "one position does not explain the data: two transmitters that share this identity would, "
        f"near {first} and near {second}; "
        "or something else shapes the levels (terrain, a sector antenna)"
    )


def _shares(case: _Case, percents: Sequence[int]) -> str:
    names = [
        f"{percent}% at {_degrees(case.obs, mode.x_m, mode.y_m)}"
        for percent, mode in zip(percents, case.modes, strict=True)
    ]
    rest = 100 - sum(percents)
    elsewhere = [f"{rest}% elsewhere"] if rest > 0 else []
    return f"the levels fit several positions: {', '.join(names + elsewhere)}"


def _advice(case: _Case) -> str:
    """Where to walk to decide between the two strongest modes, and the level to expect there."""
    x_m, y_m = float(case.obs.x_m[-1]), float(case.obs.y_m[-1])
    near, far = sorted(case.modes[:2], key=lambda mode: hypot(mode.x_m - x_m, mode.y_m - y_m))
    way_m = hypot(near.x_m - x_m, near.y_m - y_m)
    apart_m = hypot(near.x_m - far.x_m, near.y_m - far.y_m)
    if_near_dbm = _expected_dbm(near, _PASSING_M)
    if_far_dbm = _expected_dbm(far, apart_m)
    return (
        f"to decide, walk past {_degrees(case.obs, near.x_m, near.y_m)}, "
        f"{way_m:.0f} m from where this walk ended: about {if_near_dbm:.0f} dBm there "
        f"if it is this position, {if_far_dbm:.0f} dBm if it is the one {apart_m:.0f} m away"
    )


def _expected_dbm(mode: Mode, distance_m: float) -> float:
    _, _, p0_dbm, eta = mode.state.tolist()
    distance_db = log_distance_db(max(distance_m, _PASSING_M), 0.0)
    return float(level_dbm(p0_dbm, eta, distance_db))


def _degrees(obs: CellObservations, x_m: float, y_m: float) -> str:
    lat_deg, lon_deg = obs.utm.to_latlon(x_m, y_m)
    return f"{lat_deg:.5f} {lon_deg:.5f}"
