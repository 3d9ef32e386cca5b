"""Levels that a station at a fixed place with constant power does not give."""

from collections import deque
from collections.abc import Iterator
from math import hypot
from typing import NamedTuple

from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import STEADY, HeardCell, Level, Memory, Moment
from logger.core.suspicion.networks import Networks

_JUMP_DB = 20.0
"""Shadowing of 8 dB over a few metres gives less in 10 s (measured: 7 an hour without a gate)."""
_APPEARS_DB = 15.0
"""The limit of what could be missed is itself uncertain by the shadowing."""
_JUMP_S = 10.0
_BEFORE_S = 30.0
"""Three scans of a slow modem."""
_NEAR_M = 30.0
_PASSED_M = 120.0
"""Way of a car between the scan before a new cell and its third reading."""
FULL_LIST = 4
"""Cells of a scan from which on its weakest level is a limit of what could be missed."""
_EARLIER_S = 120.0
_PLACE_M = 60.0
"""Closer to a small cell than 150 m its level changes by more than 15 dB."""
_ABOVE_BEST_DB = 15.0
_STRONG_DBM = -70.0
_ABOVE_OTHERS_DB = 6.0
"""As S3, weak by itself: with 10 and 20 dB, more cells were unusual and fewer stations found."""
_LATE_S = 300.0


class _Before(NamedTuple):
    """What could have been heard in an earlier scan: a new cell at this level was not there.

    `operators` are the networks of its cells: a scan of one network alone says nothing of another.
    """

    t_s: float
    x_m: float | None
    y_m: float | None
    rat: str
    limit_dbm: float
    operators: frozenset[str]

    def could_name(self, cell: HeardCell, networks: Networks) -> bool:
        """Whether the scan had named a cell of this network if it had heard it."""
        if cell.rat != self.rat:
            return False
        names = self.operators
        return len(names) > 1 or not any(networks.are_apart(cell.operator, name) for name in names)


class SignalRules:
    """S2, S3, S4 and S8."""

    def __init__(self) -> None:
        self._before: deque[_Before] = deque(maxlen=12)

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        for cell, heard in taken:
            weakest_dbm = cell.weakest_dbm
            if heard.level_dbm is None or weakest_dbm is None:
                continue
            yield from _jump(cell, weakest_dbm)
            if cell.n_scans == STEADY:
                yield from self._appears(memory, cell, weakest_dbm)
            if weakest_dbm >= cell.best_dbm - _ABOVE_BEST_DB:
                yield from _above_best(now, cell, heard.level_dbm, weakest_dbm)
            if weakest_dbm >= _STRONG_DBM:
                yield from _above_others(now, memory, cell, weakest_dbm)
        self._remember(now)

    def _appears(self, memory: Memory, cell: HeardCell, weakest_dbm: float) -> Iterator[Broken]:
        """S3: a new cell is far stronger than anything that could be missed just before."""
        first = cell.recent[0]
        networks = memory.networks
        before = [b for b in self._before if b.t_s < first.t_s and b.could_name(cell, networks)]
        before = [b for b in before[-STEADY:] if first.t_s - b.t_s <= _BEFORE_S]
        limit_dbm = max((b.limit_dbm for b in before), default=0.0)
        is_near = all(_apart_m(b, cell.recent[-1]) <= _PASSED_M for b in before)
        if len(before) >= 2 and is_near and weakest_dbm >= limit_dbm + _APPEARS_DB:
            evidence: Evidence = {
                "level_dbm": round(weakest_dbm),
                "limit_dbm": round(limit_dbm),
                "seconds": round(first.t_s - before[-1].t_s),
            }
            yield Broken("S3", cell.name, evidence)

    def _remember(self, now: Moment) -> None:
        serving = now.serving
        for rat in dict.fromkeys([heard.rat for heard in now.cells]):
            of_rat = [h for h in now.cells if h.level_dbm is not None and h.rat == rat]
            levels = [h.level_dbm for h in of_rat if h.level_dbm is not None]
            if len(levels) >= FULL_LIST:
                limit_dbm = min(levels)
            elif serving is not None and serving.rat == rat and serving.level_dbm is not None:
                of_rat, limit_dbm = [serving], serving.level_dbm
            else:
                continue
            operators = frozenset([heard.operator for heard in of_rat])
            self._before.append(_Before(now.t_s, now.x_m, now.y_m, rat, limit_dbm, operators))


def _jump(cell: HeardCell, weakest_dbm: float) -> Iterator[Broken]:
    """S2: 20 dB more within 10 s, while the walker hardly moves."""
    recent = cell.recent
    if len(recent) < STEADY + 2:
        return
    before = recent[-STEADY - 1]
    rise_db = weakest_dbm - max(recent[-STEADY - 2].level_dbm, before.level_dbm)
    if rise_db < _JUMP_DB:
        return
    seconds = recent[-STEADY].t_s - before.t_s
    if seconds <= _JUMP_S and _apart_m(recent[-STEADY - 2], recent[-1]) <= _NEAR_M:
        evidence: Evidence = {
            "rise_db": round(rise_db),
            "seconds": round(seconds),
            "level_dbm": round(recent[-1].level_dbm),
        }
        yield Broken("S2", cell.name, evidence)


def _above_best(
    now: Moment, cell: HeardCell, level_dbm: float, weakest_dbm: float
) -> Iterator[Broken]:
    """S4: far stronger than at any earlier time within 60 m."""
    t_s, x_m, y_m = now.t_s, now.x_m, now.y_m
    if x_m is None or y_m is None:
        return
    earlier = []
    for spot in cell.spots:
        east_m = spot.x_m - x_m
        if not -_PLACE_M <= east_m <= _PLACE_M or t_s - spot.t_s < _EARLIER_S:
            continue
        if hypot(east_m, spot.y_m - y_m) <= _PLACE_M:
            if weakest_dbm <= spot.best_dbm + _ABOVE_BEST_DB:
                return
            earlier.append(spot.best_dbm)
    if len(earlier) >= STEADY:
        evidence: Evidence = {"level_dbm": round(level_dbm), "best_dbm": round(max(earlier))}
        yield Broken("S4", cell.name, evidence)


def _above_others(
    now: Moment, memory: Memory, cell: HeardCell, weakest_dbm: float
) -> Iterator[Broken]:
    """S8: far stronger than all other cells have been of late."""
    others = [c.best_dbm for c in memory.cells.values()
              if c is not cell and c.rat == cell.rat and now.t_s - c.last_s <= _LATE_S]  # fmt: skip
    if len(others) >= STEADY and weakest_dbm >= max(others) + _ABOVE_OTHERS_DB:
        evidence: Evidence = {
            "level_dbm": round(weakest_dbm),
            "cells": len(others),
            "best_dbm": round(max(others)),
        }
        yield Broken("S8", cell.name, evidence)


def _apart_m(before: _Before | Level, after: Level) -> float:
    """Way between two readings; far where it is unknown."""
    if before.x_m is None or before.y_m is None or after.x_m is None or after.y_m is None:
        return 1e9
    return hypot(after.x_m - before.x_m, after.y_m - before.y_m)
