"""Reselection parameters that make a cell more attractive than its operator's others."""

from collections import deque
from functools import partial
from statistics import median

from logger.core.latest import Latest
from logger.core.suspicion.heard import (
    MOST_CELLS,
    Heard,
    HeardCell,
    Memory,
    may_be_same,
    serving_cell,
)
from logger.core.suspicion.rule import GSM, Evidence, Rate, ScanRule, on_telephones

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


class _Left:
    """Readings of the serving cell of late, and the cell that was left for it.

    `other` is the cell now serving, its begin, the level that was left, and its own levels.
    """

    def __init__(self) -> None:
        self.serving: deque[tuple[float, Heard, float]] = deque(maxlen=_STEADY)
        self.other: tuple[str, float, float, list[float]] | None = None


@ScanRule(
    id="C2",
    family="broadcast",
    needs=("identity", "level"),
    gate="3 readings before of at least -85 dBm, 3 after, all within 40 s and of one network; a "
    "cell heard later than the one left",
    sentence="the modem left {left_dbm} dBm for this cell with {level_dbm} dBm",
    harmless="a call that was handed over, another band of the operator",
    about=serving_cell,
    detection=0.4,  # so that it makes no cell unusual by itself, as 12 of 16 false words were
    measured=on_telephones(GSM=(1, 23, 2.7), LTE=(10, 814, 36.1), WCDMA=(4, 87, 10.1)),
)
def _leave_for_weaker(memory: Memory, cell: HeardCell) -> Evidence | None:
    t_s, serving, past = memory.now.t_s, memory.now.serving, memory.of(_Left)
    if serving is None or serving.level_dbm is None:
        return None
    level_dbm = serving.level_dbm
    before = list(past.serving)
    if before and before[-1][1].name != cell.name:
        past.other = None
        is_late = t_s - before[0][0] > _LATE_S
        left = memory.cells.get(before[-1][1].name or "")
        # the way back from a rogue cell that fell silent accuses nobody
        is_newer = left is not None and left.first_s < cell.first_s
        is_compared = is_newer and _are_compared(serving, before[-1][1])
        if len(before) == _STEADY and is_compared and not is_late:
            past.other = cell.name, t_s, min(b[2] for b in before), []
        past.serving.clear()
    past.serving.append((t_s, serving, level_dbm))
    if past.other is None or past.other[0] != cell.name or len(past.other[3]) >= _STEADY:
        return None
    _, since_s, left_dbm, levels = past.other
    levels.append(level_dbm)
    if len(levels) < _STEADY or left_dbm < _GOOD_DBM or t_s - since_s > _LATE_S:
        return None
    if left_dbm - max(levels) < _WEAKER_DB:
        return None
    return {"left_dbm": round(left_dbm), "level_dbm": round(max(levels))}


def _are_compared(serving: Heard, left: Heard) -> bool:
    # between networks no level decides
    return serving.rat == left.rat and may_be_same(serving.operator, left.operator)


_OFFSETS = partial(Latest[float], MOST_CELLS)
_CONFIRMED = partial(Latest[float], MOST_CELLS)
"""Reselection offsets in dB by cell: the last one, and the last that two readings in turn agreed
on; a digit of a single one may be wrong."""


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


@ScanRule(
    id="C1",
    family="broadcast",
    needs=("identity", "C1 and C2"),
    gate="20 dB above every other of at least 3 cells of the operator",
    sentence="its reselection offset is {offset_db} dB, that of the operator's others "
    "{usual_db} dB",
    harmless="an indoor cell or a hot spot of the operator",
    detection=0.6,
    elsewhere=Rate(0, 194, 0.0, "full scans of 197 cells"),
    rats=GSM,
)
def _above_usual(memory: Memory, cell: HeardCell) -> Evidence | None:
    offset_db, confirmed = _offset_db(cell.heard), memory.of(_CONFIRMED)
    if offset_db is None:
        return None
    last_db = memory.of(_OFFSETS).get(cell.name)
    memory.of(_OFFSETS).put(cell.name, offset_db)
    if offset_db != last_db:
        return None
    confirmed.put(cell.name, offset_db)
    others = []
    for other in memory.of_operator(cell.operator, cell.rat):
        other_db = confirmed.get(other.name)
        if other_db is not None and other is not cell:
            if offset_db < other_db + _ABOVE_DB:
                return None
            others.append(other_db)
    if len(others) < _FEWEST_CELLS:
        return None
    return {"offset_db": round(offset_db), "usual_db": round(median(others)), "cells": len(others)}
