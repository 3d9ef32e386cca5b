"""How the search for the target goes: until it is located, or given up."""

from math import inf

from logger.core.answer import Answer
from logger.core.guidance.routes import LEG_M
from logger.core.places import Places

FOUND = "located"
_LEGS = 3
_SMALLER = 0.8
"""The region has to shrink by a fifth within `_LEGS` legs, or walking on is of no use.

It is compared with the last that shrank, first with the widest: a few readings have a narrower one,
by the prior.
"""
_LOUDER_DB = 3.0
"""A walker who hears so much more than before comes nearer, while the region may still be wide."""
_LEG_SHARE = 0.25
"""A leg is a block of houses, or far off this share of the 95 % radius."""

_NO_SMALLER = "three legs of walking said nothing more about its place"
_STEP_M = 10.0
"""A walker who stands moves by less: the errors of fixes."""


class Pursuit:
    """The search for one cell since it became the target.

    `give_up_s` is the longest time without a reading, 0 for any. It also bounds the whole search
    for a cell that is neither suspicious nor `is_asked` for, whatever its word: nobody wants to be
    led to the mast of an operator. `given_up` says why it was given up, empty if it was not.
    """

    def __init__(self, cell: str, t_ns: int, give_up_s: float, *, is_asked: bool) -> None:
        self.cell, self.is_asked = cell, is_asked
        self._give_up_ns = give_up_s * 1e9
        self._since_ns = self._heard_ns = t_ns
        self._is_suspicious = False
        self._here: Places | None = None
        self._walked_m = 0.0
        self._area_m2, self._loudest_dbm, self._has_shrunk = 0.0, -inf, False
        self.is_located = False
        self.given_up = ""

    @property
    def over(self) -> str:
        """Why nothing leads to the cell any more: `FOUND`, or `given_up`; empty while it does."""
        return FOUND if self.is_located else self.given_up

    def hear(self, t_ns: int) -> None:
        """Take the time of a reading of the cell."""
        self._heard_ns = t_ns

    def walk(self, t_ns: int, here: Places, *, is_suspicious: bool) -> None:
        """Take a place of the walker; a new word is a reason to search again."""
        if is_suspicious and not self._is_suspicious:
            self.given_up, self._walked_m, self._area_m2, self._has_shrunk = "", 0.0, 0.0, False
        self._is_suspicious = is_suspicious
        stepped_m = 0.0 if self._here is None else here.away_m(self._here)
        if self._here is None or stepped_m >= _STEP_M:
            self._here, self._walked_m = here, self._walked_m + stepped_m
        unheard_ns = t_ns - self._heard_ns
        if is_suspicious or self.is_asked:
            self._since_ns = t_ns
        if unheard_ns > self._give_up_ns:
            self._give_up(f"not heard for {unheard_ns / 60e9:.0f} min")
        elif t_ns - self._since_ns > self._give_up_ns:
            self._give_up("it did not become suspicious")

    def judge(self, answer: Answer) -> None:
        """Take the answer after another part of the walk."""
        self.is_located = answer.verdict == FOUND
        if answer.place is None:
            return
        leg_m = max(LEG_M, _LEG_SHARE * answer.place.r95_m)
        area_m2, level_dbm = answer.place.area_m2, answer.place.strongest.level_dbm
        is_smaller = area_m2 <= _SMALLER * self._area_m2
        if not self._area_m2 or is_smaller or level_dbm >= self._loudest_dbm + _LOUDER_DB:
            self._loudest_dbm, self._walked_m = max(self._loudest_dbm, level_dbm), 0.0
            if self.given_up == _NO_SMALLER:  # what came by itself: the search goes on
                self.given_up = ""
        elif self._walked_m >= _LEGS * leg_m and not self.is_located:
            self._give_up(_NO_SMALLER)
        if is_smaller:
            self._area_m2, self._has_shrunk = area_m2, True
        elif not self._has_shrunk:
            self._area_m2 = max(self._area_m2, area_m2)

    def _give_up(self, why: str) -> None:
        if self._give_up_ns:
            self.given_up = self.given_up or why
