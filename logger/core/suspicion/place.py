"""The place of a station by its levels: one identity at two places, at none, or at another one."""

from functools import partial
from math import inf

from logger.core.latest import Latest
from logger.core.suspicion.heard import MOST_CELLS, HeardCell, Memory
from logger.core.suspicion.rule import Evidence, ScanRule, on_telephones
from logger.core.suspicion.sources import LEAST_EVIDENCE, Sources, compare_sources

_TEST_AGAIN = 0.1
"""New squares until the next test, at least one, as a share of those before. A clone may stop
to show once the coarser squares of a long walk drop what was heard between its two places."""
_FEWEST_SPOTS = 6
_PERHAPS_TWO = 2.0
"""Log evidence for two places from which S9 is a finding; few squares of one cell reach 1.5."""
_TWO_PLACES, _TWO_FAR_PLACES = 3.5, LEAST_EVIDENCE
_FAR_M = 500.0
"""Log evidence for two places from which S5 is a finding, and the lower one for places this far
apart. Hills, reflections and side lobes of one antenna make places 300 to 450 m apart: of the
legitimate cells 1 reaches 3.3 there, and 1 the lower one farther apart; no other has more than 1.2,
and those of simulated cities no more than 1.4."""
_NO_PLACE = 9.0
"""Log evidence from which S6 is a finding; tuned on the legitimate logs."""


_UNLICENSED = range(46790, 54540)
"""Channels of LTE in the unlicensed band (3GPP TS 36.101 5.7.3), whose cells send in bursts and
serve nobody alone: of 3488 cells with one peak, in drives with all neighbours, two of the three
that broke S5 or S6 were there."""


class _Tests:
    """The test is made once a scan for the three rules that ask."""

    def __init__(self) -> None:
        self._due: Latest[int] = Latest(MOST_CELLS)
        self._now: object = None
        self._results: dict[str, Sources | None] = {}

    def result(self, memory: Memory, cell: HeardCell) -> Sources | None:
        if memory.now is not self._now:
            self._now, self._results = memory.now, {}
        if cell.name not in self._results:
            self._results[cell.name] = None  # a test that fails is made for the first rule only
            self._results[cell.name] = self._test(cell)
        return self._results[cell.name]

    def _test(self, cell: HeardCell) -> Sources | None:
        n, arfcn = cell.spots.n, cell.heard.reading.arfcn
        # a range compares None with each of its numbers, which took half of the time of all rules
        if cell.rat == "LTE" and arfcn is not None and arfcn in _UNLICENSED:
            return None
        if n < self._due.get(cell.name, _FEWEST_SPOTS) or len(cell.spots) < _FEWEST_SPOTS:
            return None
        self._due.put(cell.name, n + max(1, int(_TEST_AGAIN * n)))
        return compare_sources(list(cell.spots))


_TWO_SENTENCE = (
    "the levels fit two places {apart_m} apart better than one (log evidence {log_evidence})"
)
# of S5 and S9: of findings with one sentence `words.sentences` prints the strongest
_TWO_HARMLESS = "hills and tall buildings, a repeater, a cell with two antennas"


@ScanRule(
    id="S9",
    family="place",
    needs=("identity", "level", "position"),
    gate="as S5, with less evidence: a second family must confirm it",
    sentence=_TWO_SENTENCE,
    harmless=_TWO_HARMLESS,
    detection=0.8,
    measured=on_telephones(GSM=(1, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(1, 87, 10.1)),
)
def _perhaps_two_places(memory: Memory, cell: HeardCell) -> Evidence | None:
    result = memory.of(_Tests).result(memory, cell)
    if result is None or result.two_places < _PERHAPS_TWO:
        return None
    return _evidence(cell, result, result.two_places)


@ScanRule(
    id="S5",
    family="place",
    needs=("identity", "level", "position"),
    gate="6 squares of 25 m over at least 300 m, not in the unlicensed band of LTE; less evidence "
    "if the places are 500 m apart",
    sentence=_TWO_SENTENCE,
    harmless=_TWO_HARMLESS,
    detection=0.8,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(1, 87, 10.1)),
    strength="suffices",
)
def _two_places(memory: Memory, cell: HeardCell) -> Evidence | None:
    result = memory.of(_Tests).result(memory, cell)
    if result is None:
        return None
    limit = _TWO_FAR_PLACES if result.apart_m >= _FAR_M else _TWO_PLACES
    return _evidence(cell, result, result.two_places) if result.two_places >= limit else None


@ScanRule(
    id="S6",
    family="place",
    needs=("identity", "level", "position"),
    gate="6 squares of 25 m over at least 300 m, not in the unlicensed band of LTE",
    sentence="the levels fit no fixed place (log evidence {log_evidence}): it moves",
    harmless="hills and tall buildings, power that changes with the load",
    detection=0.7,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 87, 10.1)),
    strength="suffices",
)
def _no_place(memory: Memory, cell: HeardCell) -> Evidence | None:
    result = memory.of(_Tests).result(memory, cell)
    if result is None or result.no_place <= _NO_PLACE:
        return None
    return _evidence(cell, result, result.no_place)


def _evidence(cell: HeardCell, result: Sources, log_evidence: float) -> Evidence:
    return {
        "log_evidence": round(log_evidence, 1),
        "apart_m": round(result.apart_m),
        "squares": len(cell.spots),
    }


_MEAN_S = 15.0
_FEWEST_LEVELS = 3
"""Levels of a mean: one may be wrong."""
_CHANGE_DB = 20.0
_FEWEST_MEANS = 4
"""A minute: a receiver whose position is frozen in a tunnel moves on before."""
_STEADY_DB = 10.0
"""Legitimate cells stay within 14 dB of themselves in logs of standing telephones."""
_STEADY_S = 60.0


class _Means:
    """Means of a level over 15 s each: their number, limits and times."""

    __slots__ = (
        *("_n_levels", "_since_s", "_sum", "first_s", "last_s", "n"),
        *("highest", "highest_s", "lowest", "lowest_s"),
    )

    def __init__(self, t_s: float) -> None:
        self._since_s, self._sum, self._n_levels = t_s, 0.0, 0
        self.n, self.first_s, self.last_s = 0, t_s, t_s
        self.lowest, self.highest = inf, -inf
        self.lowest_s = self.highest_s = t_s

    def add(self, t_s: float, level_dbm: float) -> None:
        if t_s - self._since_s >= _MEAN_S:
            if self._n_levels >= _FEWEST_LEVELS:
                self._complete()
            self._since_s, self._sum, self._n_levels = t_s, 0.0, 0
        self._sum += level_dbm
        self._n_levels += 1

    def _complete(self) -> None:
        mean_dbm = self._sum / self._n_levels
        self.first_s = self.first_s if self.n else self._since_s
        self.last_s, self.n = self._since_s, self.n + 1
        if mean_dbm < self.lowest:
            self.lowest, self.lowest_s = mean_dbm, self._since_s
        if mean_dbm > self.highest:
            self.highest, self.highest_s = mean_dbm, self._since_s

    @property
    def spread_db(self) -> float:
        """Highest minus lowest mean; negative before there is one."""
        return self.highest - self.lowest

    def is_beside(self, other: "_Means") -> bool:
        """Whether it was heard long enough, and when the other changed."""
        if self.last_s - self.first_s < _STEADY_S:
            return False
        changed = sorted((other.lowest_s, other.highest_s))
        return self.first_s <= changed[0] and self.last_s >= changed[1]


_STANDING = partial(Latest[_Means], MOST_CELLS)
"""Means of the cells heard since the walker stands here."""


def _heard_while_standing(memory: Memory) -> list[HeardCell]:
    if memory.now.x_m is None or memory.now.still_s < _MEAN_S:
        memory.of(_STANDING).clear()
        return []
    return memory.taken


@ScanRule(
    id="S7",
    family="place",
    needs=("identity", "level", "position"),
    gate="means over 15 s, at least 4, the walker within 30 m; another cell, heard before and "
    "after the change, stays within 10 dB, or half of those that scans list",
    sentence="the level changed by {change_db} dB while the walker stood for {still_s} s and "
    "{cells} other cells changed by at most {other_db} dB: it moves",
    harmless="a telephone that was moved in the house, a door, a vehicle before the antenna",
    about=_heard_while_standing,
    detection=0.7,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 87, 10.1)),
)
def _changes(memory: Memory, cell: HeardCell) -> Evidence | None:
    now, level_dbm, all_means = memory.now, cell.heard.level_dbm, memory.of(_STANDING)
    if level_dbm is None:
        return None
    means = all_means.get(cell.name) or _Means(now.t_s)
    all_means.put(cell.name, means)
    means.add(now.t_s, level_dbm)
    if means.n < _FEWEST_MEANS or means.spread_db < _CHANGE_DB:
        return None
    others = [one for name, one in all_means.items() if name != cell.name and one.is_beside(means)]
    widest_db = max((other.spread_db for other in others), default=inf)
    # where scans list several cells, most of them stay if the walker does
    listed = {heard.name for moment in memory.latest for heard in moment.cells}
    if widest_db > _STEADY_DB or 2 * len(others) < len(listed - {None, cell.name}):
        return None
    return {
        "change_db": round(means.spread_db),
        "still_s": round(now.still_s),
        "other_db": round(widest_db),
        "cells": len(others),
    }
