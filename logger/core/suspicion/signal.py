"""Levels that a station at a fixed place with constant power does not give."""

from collections import deque
from collections.abc import Iterator
from math import hypot
from typing import NamedTuple

from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import HeardCell, Level, Memory, Moment

_JUMP_DB = 20.0
"""Shadowing of 8 dB over a few metres gives less in 10 s (measured: 7 an hour without a gate)."""
_APPEARS_DB = 15.0
"""The limit of what could be missed is itself uncertain by the shadowing."""
_JUMP_S = 10.0
_BEFORE_S = 30.0
"""Three scans of a slow modem."""
_STEADY = 3
"""Readings at the new level: one may be wrong."""
_NEAR_M = 30.0
_PASSED_M = 120.0
"""Way of a car between the scan before a new cell and its third reading."""
_FULL_LIST = 4
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
    """What could have been heard in an earlier scan: a new cell at this level was not there."""

    t_s: float
    x_m: float | None
    y_m: float | None
    rat: str
    limit_dbm: float


class SignalRules:
    """S2, S3, S4 and S8."""

    def __init__(self) -> None:
        self._before: deque[_Before] = deque(maxlen=12)

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        for cell, heard in taken:
            if heard.level_dbm is None:
                continue
            yield from _jump(cell)
            yield from self._appears(cell)
            yield from _above_best(now, cell, heard.level_dbm)
            yield from _above_others(now, memory, cell)
        self._remember(now)

    def _appears(self, cell: HeardCell) -> Iterator[Broken]:
        """S3: a new cell is far stronger than anything that could be missed just before."""
        if cell.n_scans != _STEADY or len(cell.recent) < _STEADY:
            return
        first = cell.recent[0]
        before = [b for b in self._before if b.rat == cell.rat and b.t_s < first.t_s]
        before = [b for b in before[-_STEADY:] if first.t_s - b.t_s <= _BEFORE_S]
        weakest = min(level.level_dbm for level in cell.recent)
        limit_dbm = max((b.limit_dbm for b in before), default=0.0)
        is_near = all(_apart_m(b, cell.recent[-1]) <= _PASSED_M for b in before)
        if len(before) >= 2 and is_near and weakest >= limit_dbm + _APPEARS_DB:
            evidence: Evidence = {
                "level_dbm": round(weakest),
                "limit_dbm": round(limit_dbm),
                "seconds": round(first.t_s - before[-1].t_s),
            }
            yield Broken("S3", cell.name, evidence)

    def _remember(self, now: Moment) -> None:
        for rat in {heard.rat for heard in now.cells}:
            levels = [h.level_dbm for h in now.cells if h.rat == rat and h.level_dbm is not None]
            serving = now.serving
            if len(levels) >= _FULL_LIST:
                self._before.append(_Before(now.t_s, now.x_m, now.y_m, rat, min(levels)))
            elif serving is not None and serving.rat == rat and serving.level_dbm is not None:
                self._before.append(_Before(now.t_s, now.x_m, now.y_m, rat, serving.level_dbm))


def _jump(cell: HeardCell) -> Iterator[Broken]:
    """S2: 20 dB more within 10 s, while the walker hardly moves."""
    if len(cell.recent) < _STEADY + 2:
        return
    levels = list(cell.recent)
    before, after = levels[-_STEADY - 2 : -_STEADY], levels[-_STEADY:]
    rise_db = min(a.level_dbm for a in after) - max(b.level_dbm for b in before)
    seconds = after[0].t_s - before[-1].t_s
    if rise_db >= _JUMP_DB and seconds <= _JUMP_S and _apart_m(before[0], after[-1]) <= _NEAR_M:
        evidence: Evidence = {
            "rise_db": round(rise_db),
            "seconds": round(seconds),
            "level_dbm": round(after[-1].level_dbm),
        }
        yield Broken("S2", cell.name, evidence)


def _above_best(now: Moment, cell: HeardCell, level_dbm: float) -> Iterator[Broken]:
    """S4: far stronger than at any earlier time within 60 m."""
    if now.x_m is None or now.y_m is None or len(cell.recent) < _STEADY:
        return
    weakest = min(level.level_dbm for level in list(cell.recent)[-_STEADY:])
    if weakest < cell.best_dbm - _ABOVE_BEST_DB:
        return
    earlier = [
        spot.best_dbm
        for spot in cell.spots
        if now.t_s - spot.t_s >= _EARLIER_S
        and hypot(spot.x_m - now.x_m, spot.y_m - now.y_m) <= _PLACE_M
    ]
    if len(earlier) >= _STEADY and weakest > max(earlier) + _ABOVE_BEST_DB:
        evidence: Evidence = {"level_dbm": round(level_dbm), "best_dbm": round(max(earlier))}
        yield Broken("S4", cell.name, evidence)


def _above_others(now: Moment, memory: Memory, cell: HeardCell) -> Iterator[Broken]:
    """S8: far stronger than all other cells have been of late."""
    if len(cell.recent) < _STEADY:
        return
    weakest = min(level.level_dbm for level in list(cell.recent)[-_STEADY:])
    if weakest < _STRONG_DBM:
        return
    others = [c.best_dbm for c in memory.cells.values()
              if c is not cell and c.rat == cell.rat and now.t_s - c.last_s <= _LATE_S]  # fmt: skip
    if len(others) >= _STEADY and weakest >= max(others) + _ABOVE_OTHERS_DB:
        evidence: Evidence = {
            "level_dbm": round(weakest),
            "cells": len(others),
            "best_dbm": round(max(others)),
        }
        yield Broken("S8", cell.name, evidence)


def _apart_m(before: _Before | Level, after: Level) -> float:
    """Way between two readings; far where it is unknown."""
    if before.x_m is None or before.y_m is None or after.x_m is None or after.y_m is None:
        return 1e9
    return hypot(after.x_m - before.x_m, after.y_m - before.y_m)
