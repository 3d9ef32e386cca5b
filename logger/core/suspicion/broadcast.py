"""Reselection parameters that make a cell more attractive than its operator's others."""

from collections import deque
from collections.abc import Iterator
from statistics import median

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Heard, HeardCell, Memory, Moment

_FEWEST_CELLS = 3
_STEADY = 3
_LATE_S = 40.0
_GOOD_DBM = -85.0
_WEAKER_DB = 10.0
"""A modem changes to a cell some dB stronger; in calls and between bands it may be weaker."""
_ABOVE_DB = 20.0
"""Above the largest offset of the operator's other cells here; steps of CRO are 2 dB."""
_SUBTRACTED = 31
"""Penalty time with which the offset makes a cell less attractive (3GPP TS 45.008, 6.4)."""


class BroadcastRules:
    """C1 and C2."""

    def __init__(self) -> None:
        self._last_db: Latest[float] = Latest(128)
        self._offset_db: Latest[float] = Latest(128)
        self._serving: deque[tuple[float, Heard, float]] = deque(maxlen=_STEADY)
        self._left: tuple[str, float, float, list[float]] | None = None

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        yield from self._leave_for_weaker(now, memory)
        for cell, heard in taken:
            offset_db = self._confirmed_db(cell, _offset_db(heard))
            if offset_db is not None:
                yield from self._above_usual(memory, cell, offset_db)

    def _confirmed_db(self, cell: HeardCell, offset_db: float | None) -> float | None:
        """Offset that two readings in turn agree on; a digit of a single one may be wrong."""
        if offset_db is None:
            return None
        last_db = self._last_db.get(cell.name)
        self._last_db.put(cell.name, offset_db)
        if offset_db != last_db:
            return None
        self._offset_db.put(cell.name, offset_db)
        return offset_db

    def _above_usual(self, memory: Memory, cell: HeardCell, offset_db: float) -> Iterator[Broken]:
        """C1: the offset is far above that of the operator's other cells."""
        others = []
        for other in memory.of_operator(cell.operator, cell.rat):
            other_db = self._offset_db.get(other.name)
            if other_db is not None and other is not cell:
                if offset_db < other_db + _ABOVE_DB:
                    return
                others.append(other_db)
        if len(others) >= _FEWEST_CELLS:
            evidence: Evidence = {
                "offset_db": round(offset_db),
                "usual_db": round(median(others)),
                "cells": len(others),
            }
            yield Broken("C1", cell.name, evidence)

    def _leave_for_weaker(self, now: Moment, memory: Memory) -> Iterator[Broken]:
        """C2: the modem leaves a good cell for a much weaker one."""
        serving = now.serving
        if serving is None or serving.name is None or serving.level_dbm is None:
            return
        name, level_dbm = serving.name, serving.level_dbm
        before = list(self._serving)
        if before and before[-1][1].name != name:
            self._left = None
            is_late = now.t_s - before[0][0] > _LATE_S
            is_compared = _are_compared(memory, serving, before[-1][1])
            if len(before) == _STEADY and is_compared and not is_late:
                self._left = name, now.t_s, min(b[2] for b in before), []
            self._serving.clear()
        self._serving.append((now.t_s, serving, level_dbm))
        if self._left is None or self._left[0] != name or len(self._left[3]) >= _STEADY:
            return
        _, since_s, left_dbm, levels = self._left
        levels.append(level_dbm)
        if len(levels) < _STEADY or left_dbm < _GOOD_DBM or now.t_s - since_s > _LATE_S:
            return
        if left_dbm - max(levels) >= _WEAKER_DB:
            yield Broken("C2", name, {"left_dbm": round(left_dbm), "level_dbm": round(max(levels))})


def _are_compared(memory: Memory, serving: Heard, left: Heard) -> bool:
    """Whether a modem compares two cells by level."""
    is_apart = memory.networks.are_apart(serving.operator, left.operator)
    return serving.rat == left.rat and not is_apart


def _offset_db(heard: Heard) -> float | None:
    """C2 - C1, or the broadcast offset itself; negative where it is subtracted."""
    reading = heard.reading
    broadcast = heard.broadcast
    if broadcast is not None and broadcast.cro_db is not None:
        is_subtracted = broadcast.penalty_time == _SUBTRACTED
        return float(-broadcast.cro_db if is_subtracted else broadcast.cro_db)
    if reading.c1 is None or reading.c2 is None:
        return None
    return float(reading.c2 - reading.c1)
