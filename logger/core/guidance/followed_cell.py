"""The cell that is followed: the answer, and the way to walk next.

The answer is that of the desktop for the same readings, computed anew after a leg, and where the
device's own posterior changes or has another radius: that one has fewer blocks. Advice is by the
device's own posterior.

A location is within 60 m. On the way it is reported only if it still holds after one more leg, a
block of houses: two transmitters with one identity, and one that jumps or moves, look like one
position for a while. By then every move of `MotionTest` has been compared with standing. Where the
walker stops, the desktop's tests decide at once, all of them: so both programs end with one word.
"""

from collections.abc import Sequence
from math import atan2, cos, degrees, log, nan, radians, remainder
from typing import NamedTuple

import numpy as np

from logger.core.answer import Answer, MultiPolygon, NextWay, Provenance, answer_of
from logger.core.errors import EstimationError
from logger.core.guidance.advice import Advice, Guide
from logger.core.guidance.routes import LEG_M
from logger.core.guidance.street_map import StreetMap
from logger.core.locator.online import OnlineLocator
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.region import coarse_cover
from logger.core.locator.summary import summarise
from logger.core.locator.two_source_test import (
    LIVE,
    MOVES_M,
    Division,
    MotionTest,
    divide,
    divide_in_time,
)
from logger.core.locator.verdict import LIVE_M, Decision, assess, may_move
from logger.core.places import Places
from logger.core.readings import Readings
from logger.core.walker import LiveTrack

CONFIRMED_AFTER = 4
"""Updates, 25 m each: a leg away from a place shows whether it is wrong."""
_DIVIDED_EVERY = 8
"""Two transmitters are tried every 200 m: that takes as long as all plans on the way."""
_MOVES_TRIED = len(MOVES_M) // CONFIRMED_AFTER
"""At each update while it looks located."""
_MOVES_LOG_FACTOR = -1.0
"""Above, a transmitter that moves is too plausible: a third as likely as one that stands.

Guided walks under white noise, 100 each: past one with 0.25 and 0.5 m/s, 15 and 3 were located
where it no longer was (22 and 6 with 0, 7 and 1 with -1.5); past one that stands, 0.91 were located
within 2 km (0.93 with 0, 0.87 with -1.5).
"""
_CHANGED, _APART = 0.2, 0.4
"""Of radii, in nats. An answer takes up to a second here, ten times as long as a plan."""
_LEAST_NS = 15 * 10**9
"""Between answers: a walker needs 18 s for 25 m; in a car a small Pi would do nothing else."""
_STANDS_M = 10.0  # nobody walks so slowly that `_LEAST_NS` take him no farther
_MOST_SQUARES = 400
"""Squares of the region, 100 bytes each: the page loads them twice a second."""
_REGION_DECIMALS = 5
"""Of degrees: 1 m, which no phone shows."""


class LiveVerdict:
    """Verdicts of one cell in order, each 25 m or more after the last."""

    def __init__(self) -> None:
        self._updates = 0
        self._held = 0
        self._division: Division | None = None
        self._motion = MotionTest()

    def update(self, posterior: Posterior, obs: Readings, *, stands: bool = False) -> Decision:
        """The verdict on a posterior; `obs` has readings of the walk in their order.

        Where the walker `stands` it is the desktop's for this radius.
        """
        if stands and assess(posterior, obs, within_m=LIVE_M).verdict == "located":
            decision = decide(posterior, obs, within_m=LIVE_M)
            self._held = CONFIRMED_AFTER + 1 if decision.verdict == "located" else 0
            return decision
        decision = assess(posterior, obs, self._division, within_m=LIVE_M)
        is_located = decision.verdict == "located"
        if self._updates % _DIVIDED_EVERY == 0 or (
            is_located and self._held in {0, CONFIRMED_AFTER}
        ):
            tried = divide(obs, posterior, LIVE), divide_in_time(obs, posterior, LIVE)
            self._division = max((one for one in tried if one), default=None)
            decision = assess(posterior, obs, self._division, within_m=LIVE_M)
            is_located = decision.verdict == "located"
        if is_located:
            self._motion.try_moves(obs, posterior, _MOVES_TRIED)
            moves = self._motion.division()
            if moves is not None and moves.log_factor > _MOVES_LOG_FACTOR:
                decision = may_move(moves)
                is_located = False
        else:
            self._motion = MotionTest()
        self._updates += 1
        self._held = self._held + 1 if is_located else 0
        if is_located and self._held <= CONFIRMED_AFTER:
            reason = f"{decision.reasons[0]}; walk one leg away to confirm it"
            return Decision("cannot tell", [reason], decision.division)
        return decision


class FollowedCell:
    """Answer and advice for one `cell`, renewed as the walker moves, and once where he stops.

    Readings are placed on the smoothed `walk`, as on the desktop. `region` is that of the answer;
    both are None before the first search. `way` is the advice.
    """

    def __init__(
        self, cell: str, streets: StreetMap | None = None, walk: LiveTrack | None = None
    ) -> None:
        self.cell = cell
        self._walk = walk or LiveTrack()
        self._guide = Guide(streets)
        self._verdict = LiveVerdict()
        self._latest: _Latest | None = None
        self._stop: Places | None = None  # where the walker has been since
        self._modes: Sequence[Mode] | None = None  # of the answer
        self.answer: Answer | None = None
        self.region: MultiPolygon | None = None
        self.way: NextWay | None = None

    def update(self, here: Places, locator: OnlineLocator) -> bool:
        """Take a place of the walker; where a new plan is due, ask the cell's locator.

        Returns whether one of them is new.
        """
        self._guide.walk(here)
        if self._stop is None or here.away_m(self._stop) > _STANDS_M:
            self._stop = here
        is_due = self._guide.is_due
        stands = not is_due and self._has_stopped(here)
        last = locator.last_search() if is_due or stands else None
        if last is None:
            return False
        if self._latest is None or not self._latest.is_recent(here):
            quick_m = summarise(*last).r95_m
            if self._latest is None or stands or self._latest.is_outdated(here, quick_m):
                self._latest = _Latest(here, quick_m, self._answer(locator, stands=stands))
        if is_due:
            self._guide.decide(*last, self._modes)
            self.way = next_way(self._guide.advice)
        return True

    def _has_stopped(self, here: Places) -> bool:
        """Whether the walker stands, and the answer is still one of the way here."""
        if self._stop is None or self._latest is None or self._latest.is_recent(here):
            return False
        since_ns = self._stop.t_ns.item() + _LEAST_NS
        return bool(self._latest.here.t_ns.item() < since_ns <= here.t_ns.item())

    def _answer(self, locator: OnlineLocator, *, stands: bool) -> float:
        """Answer by all kept readings; returns the 95 % radius, NaN without an answer."""
        obs = self._walk.place(locator.readings.readings())
        try:
            posterior = locate(obs, locator.prior)
        except EstimationError:  # of few levels within the scale the thinning has dropped all
            return nan
        verdict, reasons, *_ = self._verdict.update(posterior, obs, stands=stands)
        self.region = squares_of_region(posterior)
        self._modes = posterior.modes
        self.answer = answer_of(self.cell, verdict, reasons, Provenance(len(obs)), posterior)
        return posterior.r95_m


class _Latest(NamedTuple):
    """Where the latest answer was computed, its 95 % radius, and the device's own radius then."""

    here: Places
    quick_m: float
    r95_m: float

    def is_recent(self, here: Places) -> bool:
        """Whether it is too early for another one; never without times, which are 0 then."""
        return 0 < here.t_ns.item() - self.here.t_ns.item() < _LEAST_NS

    def is_outdated(self, here: Places, quick_m: float) -> bool:
        """Whether the walker has gone a leg or a fifth of the radius, or the radii say so.

        They do where the device's own has changed or differs from the answer's.
        """
        has_changed = abs(log(quick_m / self.quick_m)) > _CHANGED
        is_apart = abs(log(quick_m / self.r95_m)) > _APART
        gone_m = here.away_m(self.here)
        return has_changed or is_apart or gone_m > min(LEG_M, _CHANGED * self.quick_m)


def next_way(advice: Advice | None) -> NextWay | None:
    """The advice in degrees."""
    if advice is None:
        return None
    end = advice.end.on_map.in_short()
    distance_m = advice.end.away_m(advice.start)
    azimuth_deg = true_azimuth_deg(advice.start, advice.end)
    nats = round(advice.nats_per_km, 2)
    return NextWay(
        azimuth_deg, round(distance_m, 1), end.lat, end.lon, nats, advice.text, advice.why
    )


def true_azimuth_deg(start: Places, end: Places) -> float:
    """Direction from true north, 0 to 360 degrees, over distances of a walk.

    True and grid north differ by up to 3 degrees at the border of a zone.
    """
    here, there = start.on_map, end.on_map
    east_deg = remainder(there.lon - here.lon, 360.0)  # 180 and -180 are one meridian
    east = east_deg * cos(radians(0.5 * (here.lat + there.lat)))
    return round(degrees(atan2(east, there.lat - here.lat)) % 360.0, 1) % 360.0


def squares_of_region(posterior: Posterior) -> MultiPolygon:
    """The 95 % region in few squares."""
    utm = posterior.place.utm
    x_m, y_m, side_m = coarse_cover(posterior.squares, _MOST_SQUARES)
    half_m = 0.5 * side_m
    corners = [
        Places.of(x_m + east * half_m, y_m + north * half_m, utm=utm).lat_lon_deg[::-1]
        for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    rings = np.round(np.array(corners), _REGION_DECIMALS).transpose(2, 0, 1)
    return MultiPolygon(type="MultiPolygon", coordinates=rings[:, None].tolist())
