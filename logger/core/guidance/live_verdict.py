"""The verdict while walking: as at the desktop, within 60 m, and believed after one more leg.

Two transmitters with one identity, and one that jumps or moves, look like one position for a while.
So these are tried, and a location is reported only after the walker has gone on for a block of
houses and it still holds. By then every move of `MotionTest` has been compared with standing. The
device searches few squares with few blocks: the readings are located once more as at the desktop,
and nothing is *located* on the walk that would not be at home.
"""

from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.two_source_test import (
    LIVE,
    MOVES_M,
    Division,
    MotionTest,
    divide,
    divide_in_time,
)
from logger.core.locator.verdict import LIVE_M, Decision, assess, place_text
from logger.core.readings import Readings

CONFIRMED_AFTER = 4
"""Updates, 25 m each: a leg away from the place shows what a place that is wrong cannot explain."""
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


class LiveVerdict:
    """Verdicts of one cell in their order, one for each 25 m."""

    def __init__(self) -> None:
        self._updates = 0
        self._held = 0
        self._division: Division | None = None
        self._motion = MotionTest()

    def update(self, posterior: Posterior, obs: Readings) -> tuple[Decision, Posterior]:
        """The verdict on a posterior, and the posterior that it is about.

        `obs` has readings of the walk in their order.
        """
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
                decision = Decision("cannot tell", [_may_move(moves)], moves)
                is_located = False
        else:
            self._motion = MotionTest()
        self._updates += 1
        self._held = self._held + 1 if is_located else 0
        if is_located and self._held <= CONFIRMED_AFTER:
            reason = f"{decision.reasons[0]}; walk one leg away to confirm it"
            return Decision("cannot tell", [reason], decision.division), posterior
        if self._held == CONFIRMED_AFTER + 1:
            posterior = locate(obs, posterior.prior)
            decision = assess(posterior, obs, self._division, within_m=LIVE_M)
            if decision.verdict != "located":
                self._held = 0
        return decision, posterior


def _may_move(moves: Division) -> str:
    one, other = map(place_text, (moves.one, moves.other))
    return (
        "the levels also fit a transmitter that moves, "
        f"from near {one} to near {other}: come back after some minutes"
    )
