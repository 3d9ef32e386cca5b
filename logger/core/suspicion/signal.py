"""Levels that a station at a fixed place with constant power does not give."""

from collections import deque
from collections.abc import Iterator
from functools import partial
from math import hypot, log
from statistics import median
from typing import NamedTuple

from logger.core.baseline import best_dbm
from logger.core.suspicion.earlier_walks import FEWEST_WALKS, ground
from logger.core.suspicion.heard import (
    ALL_NETWORKS,
    FULL_LIST,
    STEADY,
    HeardCell,
    Level,
    Memory,
    Moment,
    levels_dbm,
    may_be_same,
)
from logger.core.suspicion.rule import Evidence, Rate, ScanRule, on_telephones

_JUMP_DB = 20.0
"""Shadowing of 8 dB over a few metres gives less in 10 s (measured: 7 an hour without a gate)."""
_APPEARS_DB = 15.0
"""The limit of what could be missed is itself uncertain by the shadowing."""
_JUMP_S = 10.0
_BEFORE_S = 30.0  # three scans of a slow modem, while the walker moves
_NEAR_M = 30.0
_PASSED_M = 120.0
"""Way of a car between the scan before a new cell and its third reading."""
_EARLIER_S = 120.0
_PLACE_M = 60.0
"""Closer than 150 m to a small cell its level changes by more than 15 dB."""
_ABOVE_BEST_DB = 15.0
_STRONG_DBM = -70.0
_ABOVE_OTHERS_DB = 6.0
"""As S3, weak by itself: 10 and 20 dB made more cells unusual and found fewer stations."""
_LATE_S = 300.0
_STOOD_S = 30.0
"""A modem that scans each second has cars move between two readings: S2 is for it."""
_TAKEN_DBM = -75.0
"""A station beside the walker; at the end of the scale telephones print levels that jump."""
_STAYS_DB = 10.0
"""As of S7: the walker has not turned or covered the antenna."""


class _Before(NamedTuple):
    """What could have been heard in an earlier scan: a new cell at this level was not there.

    `operators` are the networks of its cells: a scan of one network alone says nothing of another.
    `is_full` of a list of cells.
    """

    t_s: float
    x_m: float | None
    y_m: float | None
    rat: str
    limit_dbm: float
    operators: frozenset[str]
    is_full: bool
    unnamed: frozenset[tuple[int | None, int | None]]  # channel and code, without an identity

    def lacks(self, cell: HeardCell) -> bool:
        """Whether it could have heard a cell of this network."""
        arfcn = cell.heard.reading.arfcn
        if (
            cell.is_renamed
            or cell.rat != self.rat
            or self.unnamed & {(arfcn, cell.heard.code), (arfcn, None)}
        ):
            return False
        names = self.operators
        if any(not may_be_same(name, other) for name in names for other in names):
            return True
        return all(may_be_same(cell.operator, name) for name in names)


def _steady_dbm(cell: HeardCell) -> float | None:
    """None if this scan has no level or before there are `STEADY`."""
    return None if cell.heard.level_dbm is None else cell.weakest_dbm


@ScanRule(
    id="S2",
    family="signal",
    needs=("identity", "level", "position"),
    gate="3 readings at the new level, the walker within 30 m; a rise that took more than 10 s "
    "counts if the walker has stood since before it; other cells have not risen by 10 dB as well",
    sentence="the level rose by {rise_db} dB within {seconds} s while the walker hardly moved",
    harmless="a door, a car or a street corner between",
    detection=0.4,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(1, 814, 36.1), WCDMA=(0, 87, 10.1)),
)
def _jump(memory: Memory, cell: HeardCell) -> Evidence | None:
    recent, weakest_dbm = cell.recent, _steady_dbm(cell)
    if weakest_dbm is None or len(recent) < STEADY + 2:
        return None
    before = recent[-STEADY - 1]
    rise_db = weakest_dbm - max(recent[-STEADY - 2].level_dbm, before.level_dbm)
    seconds = recent[-STEADY].t_s - before.t_s
    if (
        rise_db < _JUMP_DB
        or before.t_s < memory.silent_s
        or (seconds > _JUMP_S and not _has_stood(memory.now, before.t_s))
    ):
        return None
    old = recent[-STEADY - 2].new or recent[-STEADY - 2]
    if _apart_m(old, recent[-1]) > _NEAR_M:
        return None
    rises_s = memory.of(_RISES)
    if _others_rise_db(memory, cell, recent[-STEADY].t_s) > _STAYS_DB:
        rises_s.append(recent[-STEADY].t_s)
    if rises_s and rises_s[0] > before.t_s:
        return None
    return {
        "rise_db": round(rise_db),
        "seconds": round(seconds),
        "level_dbm": round(recent[-1].level_dbm),
    }


# when all levels rose: the walker has left a house or uncovered the antenna
_RISES = partial(deque[float], maxlen=1)


def _others_rise_db(memory: Memory, cell: HeardCell, since_s: float, fewest: int = 1) -> float:
    # median of the others, or of those of its network: a repeater raises one
    rises_db = []
    for network in (ALL_NETWORKS, cell.operator):
        before: dict[object, float] = {}
        after: dict[object, float] = {}
        for moment in memory.latest:
            (before if moment.t_s < since_s else after).update(levels_dbm(moment, network))
        both = before.keys() & after.keys() - {cell.name}
        if len(both) >= fewest:
            rises_db.append(median([after[key] - before[key] for key in both]))
    return max(rises_db, default=0.0)


_SCANS = partial(deque[_Before], maxlen=12)
"""What could have been heard in the scans before."""


def _new_cells(memory: Memory) -> Iterator[HeardCell]:
    """Cells of a scan that are named for the third time; the scan is remembered after them."""
    for cell in memory.taken:
        if cell.n_scans == STEADY:
            yield cell
    now, serving = memory.now, memory.now.serving
    for rat in dict.fromkeys([heard.rat for heard in now.cells]):
        of_rat = [h for h in now.cells if h.level_dbm is not None and h.rat == rat]
        levels = [h.level_dbm for h in of_rat if h.level_dbm is not None]
        is_full = len(levels) >= FULL_LIST
        if is_full:
            limit_dbm = min(levels)
        elif serving is not None and serving.rat == rat and serving.level_dbm is not None:
            of_rat, limit_dbm = [serving], serving.level_dbm
        else:
            continue
        operators = frozenset([heard.operator for heard in of_rat])
        unnamed = frozenset(
            [(h.reading.arfcn, h.code) for h in now.cells if h.name is None and h.rat == rat]
        )
        before = _Before(now.t_s, now.x_m, now.y_m, rat, limit_dbm, operators, is_full, unnamed)
        memory.of(_SCANS).append(before)


@ScanRule(
    id="S3",
    family="signal",
    needs=("identity", "level", "position"),
    gate="3 readings; 15 dB above what two scans of its network could have missed, and above what "
    "its others have risen by; within 120 m and within 30 s or since the walker stands",
    sentence="appears with {level_dbm} dBm where {limit_dbm} dBm could not be missed {seconds} "
    "s before",
    harmless="a legitimate cell switched on, the exit of a tunnel",
    about=_new_cells,
    detection=0.45,  # so that S3 and N1, which both come under ground, are not enough
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(13, 814, 36.1), WCDMA=(2, 87, 10.1)),
)
def _appears(memory: Memory, cell: HeardCell) -> Evidence | None:
    weakest_dbm = _steady_dbm(cell)
    if weakest_dbm is None:
        return None
    first, silent_s = cell.recent[0], memory.silent_s
    before = [b for b in memory.of(_SCANS) if silent_s < b.t_s < first.t_s and b.lacks(cell)]
    before = [
        b
        for b in before[-STEADY:]
        if first.t_s - b.t_s <= _BEFORE_S or _has_stood(memory.now, b.t_s)
    ]
    limit_dbm = max((b.limit_dbm for b in before), default=0.0)
    is_near = all(_apart_m(b, cell.recent[-1]) <= _PASSED_M for b in before)
    if len(before) < 2 or not is_near or weakest_dbm < limit_dbm + _APPEARS_DB:
        return None
    # what all have risen by since they were heard is of the receiver
    rise_db = _others_rise_db(memory, cell, first.t_s, STEADY)
    if weakest_dbm < limit_dbm + _APPEARS_DB + max(rise_db, 0.0):
        return None
    return {
        "level_dbm": round(weakest_dbm),
        "limit_dbm": round(limit_dbm),
        "seconds": round(first.t_s - before[-1].t_s),
    }


def _rise_nats(memory: Memory, cell: HeardCell) -> float:
    # legitimate cells are switched on too, at a rate that no log shows: alone they are unusual;
    # nobody else takes over a station or its channel
    rule = _rises_while_others_stay
    rate = rule.rate(cell.rat)
    if rate is None or _levels_before(memory, cell) or _takes_channel(memory, cell):
        return rule.nats(cell.rat)
    return log(rule.detection * rate.cells / rate.interval[1])


def _levels_before(memory: Memory, cell: HeardCell) -> list[Level]:
    # since the walker stands, before those that are compared
    since_s = memory.now.t_s - memory.now.still_s
    return [level for level in list(cell.recent)[:-STEADY] if level.t_s >= since_s]


def _takes_channel(memory: Memory, cell: HeardCell) -> bool:
    # where a modem prints no channels, of any cell
    now, arfcn = memory.now, cell.heard.reading.arfcn
    return any(
        other.heard.reading.arfcn == arfcn
        and other.rat == cell.rat
        and now.t_s - now.still_s <= other.last_s < cell.first_s
        for other in memory.cells.values()
    )


@ScanRule(
    id="S12",
    family="signal",
    needs=("identity", "level", "position", "neighbours"),
    gate="the walker has stood for 5 scans over 30 s; 3 readings of at least -75 dBm, 20 dB above "
    "the 2 before or what 2 scans of its network could have missed; 3 others stay within 10 dB, "
    "and over twice as many as rise by more; a cell that appears on a free channel is unusual",
    sentence="{level_dbm} dBm, where it had at most {before_dbm} dBm {seconds} s before, while the "
    "walker stood and {cells} other cells stayed",
    harmless="a cell switched on or repaired, a door, a vehicle that was before the antenna",
    detection=0.9,
    elsewhere=Rate(1, 247, 3.7, "drives with all neighbours while they stood, a scan every 10 s"),
    strength="suffices",
    weigh=_rise_nats,
)
def _rises_while_others_stay(memory: Memory, cell: HeardCell) -> Evidence | None:
    now, weakest_dbm = memory.now, _steady_dbm(cell)
    if weakest_dbm is None or weakest_dbm < _TAKEN_DBM or now.x_m is None:
        return None
    since_s, first_s = now.t_s - now.still_s, cell.recent[-STEADY].t_s
    before = [(level.t_s, level.level_dbm) for level in _levels_before(memory, cell)]
    if not before:
        scans = [b for b in memory.of(_SCANS) if since_s <= b.t_s < first_s]
        before = [(b.t_s, b.limit_dbm) for b in scans if b.is_full and b.lacks(cell)]
    before = before[-2:]
    if len(before) < 2 or now.t_s - before[0][0] < _STOOD_S:
        return None
    if weakest_dbm < max(dbm for _, dbm in before) + _JUMP_DB:
        return None
    others = [other for other in memory.taken if other is not cell]
    n_steady = sum(_stays(other, before[0][0]) for other in others)
    # a lift, or a vehicle that was before the antenna, raises many
    n_raised = sum(_rises(other, first_s) for other in others)
    if n_steady < STEADY or n_steady <= 2 * n_raised:
        return None
    return {
        "level_dbm": round(weakest_dbm),
        "before_dbm": round(max(dbm for _, dbm in before)),
        "seconds": round(first_s - before[-1][0]),
        "cells": n_steady,
    }


def _stays(cell: HeardCell, since_s: float) -> bool:
    """Whether recent levels before and after a time are near."""
    levels_dbm = [level.level_dbm for level in cell.recent]
    is_known = len(levels_dbm) >= STEADY + 1 and cell.recent[0].t_s <= since_s
    return is_known and max(levels_dbm) - min(levels_dbm) <= _STAYS_DB


def _rises(cell: HeardCell, since_s: float) -> bool:
    before = [level.level_dbm for level in cell.recent if level.t_s < since_s]
    after = [level.level_dbm for level in cell.recent if level.t_s >= since_s]
    return bool(before and after) and min(after) > max(before) + _STAYS_DB


@ScanRule(
    id="S4",
    family="signal",
    needs=("identity", "level", "position"),
    gate="3 readings 15 dB above earlier visits within 60 m or earlier walks within 150 m",
    sentence="{level_dbm} dBm, where it had at most {best_dbm} dBm before",
    harmless="an antenna was turned, another height or building",
    detection=0.6,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 87, 10.1)),
    elsewhere=Rate(5, 161, 0.0, "161 surveyed cells"),
)
def _above_best(memory: Memory, cell: HeardCell) -> Evidence | None:
    return _above_earlier_visits(memory.now, cell) or _above_earlier_walks(memory, cell)


def _above_earlier_visits(now: Moment, cell: HeardCell) -> Evidence | None:
    t_s, x_m, y_m, level_dbm = now.t_s, now.x_m, now.y_m, cell.heard.level_dbm
    weakest_dbm = cell.weakest_dbm
    if weakest_dbm is None or level_dbm is None or x_m is None or y_m is None:
        return None
    if weakest_dbm < cell.best_dbm - _ABOVE_BEST_DB:
        return None
    earlier = []
    for spot in cell.spots:
        east_m = spot.x_m - x_m
        if not -_PLACE_M <= east_m <= _PLACE_M or t_s - spot.t_s < _EARLIER_S:
            continue
        if hypot(east_m, spot.y_m - y_m) <= _PLACE_M:
            if weakest_dbm <= spot.best_dbm + _ABOVE_BEST_DB:
                return None
            earlier.append(spot.best_dbm)
    if len(earlier) < STEADY:
        return None
    return {"level_dbm": round(level_dbm), "best_dbm": round(max(earlier))}


def _above_earlier_walks(memory: Memory, cell: HeardCell) -> Evidence | None:
    around, weakest_dbm = ground(memory), cell.weakest_dbm
    if weakest_dbm is None or not around or around[0].n_walks.get(cell.rat, 0) < FEWEST_WALKS:
        return None
    best = best_dbm(around, cell.name)
    if best is None or weakest_dbm <= best + _ABOVE_BEST_DB:
        return None
    return {"level_dbm": round(weakest_dbm), "best_dbm": round(best)}


@ScanRule(
    id="S8",
    family="signal",
    needs=("identity", "level"),
    gate="3 readings of at least -70 dBm, 6 dB above 3 other cells heard in the 5 minutes before",
    sentence="{level_dbm} dBm, where the best of {cells} other cells had {best_dbm} dBm",
    harmless="a walk past the mast of a legitimate cell",
    detection=0.6,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(28, 814, 36.1), WCDMA=(3, 87, 10.1)),
)
def _above_others(memory: Memory, cell: HeardCell) -> Evidence | None:
    t_s, weakest_dbm = memory.now.t_s, _steady_dbm(cell)
    if weakest_dbm is None or weakest_dbm < _STRONG_DBM:
        return None
    others = [c.best_dbm for c in memory.cells.values()
              if c is not cell and c.rat == cell.rat and t_s - c.last_s <= _LATE_S]  # fmt: skip
    if len(others) < STEADY or weakest_dbm < max(others) + _ABOVE_OTHERS_DB:
        return None
    return {"level_dbm": round(weakest_dbm), "cells": len(others), "best_dbm": round(max(others))}


def _has_stood(now: Moment, since_s: float) -> bool:
    # a modem that lists all cells takes longer than a car does
    return now.x_m is not None and now.t_s - now.still_s <= since_s


def _apart_m(before: _Before | Level, after: Level) -> float:
    if before.x_m is None or before.y_m is None or after.x_m is None or after.y_m is None:
        return 1e9
    return hypot(after.x_m - before.x_m, after.y_m - before.y_m)
