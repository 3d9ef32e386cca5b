"""Location and tracking areas: codes that no other cell has, and changes while standing."""

from collections import Counter
from functools import partial
from math import hypot

from logger.core.latest import Latest
from logger.core.suspicion.countries import GSMR_ARFCNS, TEST_MCCS
from logger.core.suspicion.earlier_walks import ground
from logger.core.suspicion.heard import MOST_NETWORKS, HeardCell, Memory, Moment, Walker
from logger.core.suspicion.rule import Evidence, Rate, ScanRule, on_telephones

_LATE_S = 300.0
"""A telephone that names its serving cell alone meets three cells in some minutes."""
_WAIT_S = 20.0
"""At the begin of a walk and at borders a second cell of an area follows soon."""
_BORDER_M, _BORDER_S = 100.0, 80.0
"""What is soon in a car takes longer on foot: the way of a car in `_WAIT_S` in a town, or the time
that a walker takes for it. A walker who stands has not come to a border."""
_FASTEST_MPS = 45.0  # of a car; an aircraft hears many areas at once
_FEWEST_NEIGHBOURS = 3
_FEWEST_CELLS = 10
_FEWEST_AFTER = 3
"""Other cells heard after the first of an area: at a border they are of the new area."""
_ALONE_S = 60.0
_STRONG_DBM = -90.0
_HELD_S = 10.0
_STILL_S = 60.0
_SINGLE_S = 20.0
_KNOWN_WALKS = 2  # that heard a cell of an area here, or one walk two cells: the area is known
_HEARD_DBM = -105.0
"""At a border the network's other cells come as weakly."""
_FEWEST_TO_EXIST = 2  # scans: an identity in one may be damaged


@ScanRule(
    id="L4",
    family="area",
    needs=("identity", "position", "country code"),
    gate="rule P1 holds; heard for 20 s, at least -105 dBm",
    sentence="network {operator} has no other cell here, after {seconds} s",
    harmless="a ship or an aircraft, a private network",
    detection=0.8,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 83, 9.8)),
    elsewhere=Rate(0, 85, 0.0, "88 cells at one place, railways left out"),
)
def _single(memory: Memory, cell: HeardCell) -> Evidence | None:
    since_s, level_dbm = memory.now.t_s - cell.first_s, cell.heard.level_dbm
    if cell.name not in memory.foreign or since_s < _SINGLE_S:
        return None
    if level_dbm is None or level_dbm < _HEARD_DBM:
        return None
    if len(memory.of_operator(cell.operator, cell.rat)) > 1:
        return None
    return {"operator": cell.operator, "seconds": round(since_s)}


_KNOWN = partial(Latest[bool], MOST_NETWORKS)  # areas


def _is_known_area(memory: Memory, cell: HeardCell) -> bool:
    # what was unusual then they did not learn
    area, _, _ = cell.name.rpartition("-")  # of `mcc-mnc-area-cid`
    known = memory.of(_KNOWN)
    for square in () if area in known else ground(memory):
        of_area = [heard for name, heard in square.cells.items() if name.startswith(f"{area}-")]
        if sum(heard.n_walks for heard in of_area) >= _KNOWN_WALKS:
            known.put(area, True)
    return area in known


def _is_of_known_area(memory: Memory, name: str) -> bool:
    # a cell of an invented area never comes where earlier walks know it
    return any(cell.name == name and _is_known_area(memory, cell) for cell in memory.taken)


def _is_past_a_border(memory: Memory, name: str) -> bool:
    # there other cells of the area follow, to an invented one none
    area, cell = name.rpartition("-")[0], memory.cells.get(name)
    is_heard = any(heard is cell for heard in memory.taken)
    if cell is not None and is_heard and _is_far_view(memory, cell):
        return True
    return _is_of_known_area(memory, name) or any(
        other.name.rpartition("-")[0] == area
        and other.name != name
        and other.n_scans >= _FEWEST_TO_EXIST
        and cell is not None
        and cell.rat == other.rat
        for other in memory.taken
    )


@ScanRule(
    id="L1",
    family="area",
    needs=("identity", "area code", "level", "other cells"),
    gate="for 20 s, on foot for 100 m or 80 s, with 3 other cells of the operator within 5 "
    "minutes and since two scans without any; the cell at least -90 dBm; an area of which no other "
    "cell comes later, and that two earlier walks did not hear where a cell of it is heard; not "
    "faster than a car, nor where most areas have one cell",
    sentence="area {area} is that of none of the {neighbours} other cells heard with it",
    harmless="the border of two areas, a small cell in a house or shop",
    detection=0.8,
    # the one of LTE was withdrawn later; on the walk it was an alarm
    measured=on_telephones(GSM=(0, 21, 2.0), LTE=(1, 794, 19.6), WCDMA=(1, 60, 4.9)),
    elsewhere=Rate(0, 197, 0.0, "full scans of 197 cells"),
    strength="suffices",
    refuted_by=_is_past_a_border,
)
def _unlike_neighbours(memory: Memory, cell: HeardCell) -> Evidence | None:
    now, level_dbm = memory.now, cell.heard.level_dbm
    if level_dbm is None or level_dbm < _STRONG_DBM or not _is_past_border(now, cell):
        return None
    if not _has_own_area(memory, cell):
        return None
    late = _others_of_late(memory, cell)
    if len(late) < _FEWEST_NEIGHBOURS:
        return None
    return {
        "area": cell.area or 0,
        "neighbours": len(late),
        "other_area": late[-1].area or 0,
        "level_dbm": round(level_dbm),
    }


def _others_of_late(memory: Memory, cell: HeardCell) -> list[HeardCell]:
    late_s = max(memory.now.t_s - _LATE_S, memory.silent_s)
    return [
        other
        for other in memory.of_operator(cell.operator, cell.rat)
        if other is not cell and other.area is not None and other.last_s > late_s
    ]


def has_others(memory: Memory, rat: str) -> bool:
    # of one network, so that an area of its own stands out
    of_networks = {cell.operator: cell for cell in memory.taken if cell.rat == rat}
    return any(
        len(_others_of_late(memory, cell)) >= _FEWEST_NEIGHBOURS for cell in of_networks.values()
    )


def _is_past_border(now: Moment, cell: HeardCell) -> bool:
    """Whether a cell is too far from its first place for a border just met."""
    since_s = now.t_s - cell.first_s
    if now.x_m is None or now.y_m is None or cell.first_m is None:
        return since_s >= _BORDER_S and now.t_s - now.leapt_s >= Walker.DOUBTFUL_S
    gone_m = hypot(now.x_m - cell.first_m[0], now.y_m - cell.first_m[1])
    if gone_m > _FASTEST_MPS * since_s:
        return False
    return since_s >= _BORDER_S or now.still_s >= since_s or gone_m >= _BORDER_M


@ScanRule(
    id="L2",
    family="area",
    needs=("identity", "area code", "other cells"),
    gate="10 cells of the operator heard, 3 of them after this one; not of a railway; an area as "
    "in L1",
    sentence="area {area} has this cell alone, of {cells} cells of the operator",
    harmless="the border of two areas, a small cell in a house or shop",
    detection=0.8,
    measured=on_telephones(GSM=(0, 21, 2.0), LTE=(0, 794, 19.6), WCDMA=(0, 60, 4.9)),
    elsewhere=Rate(1, 194, 0.0, "full scans of 197 cells, railways left out"),
    refuted_by=_is_past_a_border,
)
def _alone(memory: Memory, cell: HeardCell) -> Evidence | None:
    if memory.now.t_s - cell.first_s < _ALONE_S or cell.operator[:3] in TEST_MCCS:
        return None
    if not _is_past_border(memory.now, cell):
        return None
    if not _has_own_area(memory, cell):
        return None
    of_operator = memory.of_operator(cell.operator, cell.rat)
    with_area = [c for c in of_operator if c is not cell and c.area is not None]
    n_after = sum(c.last_s > cell.first_s for c in with_area)
    if len(with_area) + 1 < _FEWEST_CELLS or n_after < _FEWEST_AFTER:
        return None
    return {"area": cell.area or 0, "cells": len(with_area) + 1}


def _has_own_area(memory: Memory, cell: HeardCell) -> bool:
    """Whether no other cell of the operator has the area code of a cell, after a while."""
    area = cell.area
    if (
        area is None
        or cell.is_renamed
        or cell.heard.reading.arfcn in GSMR_ARFCNS
        or cell.operator.startswith("?")
    ):
        return False
    if memory.now.t_s - cell.first_s < _WAIT_S:
        return False
    for other in memory.of_operator(cell.operator, cell.rat):  # a generator takes twice the time
        if other.area == area and other is not cell:
            return False
    return not _is_known_area(memory, cell) and not _is_far_view(memory, cell)


def _is_far_view(memory: Memory, cell: HeardCell) -> bool:
    # from a mountain or an aircraft one cell is heard of most areas; who changes the area of a
    # station keeps its channel
    arfcn = cell.heard.reading.arfcn
    n_cells = Counter(
        other.area
        for other in memory.of_operator(cell.operator, cell.rat)
        if other is not cell
        and other.area is not None
        and (arfcn is None or other.heard.reading.arfcn != arfcn)
    )
    if n_cells.total() + 1 < _FEWEST_CELLS:  # a telephone that names its serving cell alone
        return False
    return 2 * sum(n == 1 for n in n_cells.values()) > len(n_cells)


class _ServingAreas:
    """Areas of serving cells; `last` is the last network and area.

    By technology, and by technology and network: a log may be of several.
    """

    def __init__(self) -> None:
        self.last: Latest[tuple[str, int]] = Latest(MOST_NETWORKS)
        self.known: set[tuple[str, str, int]] = set()


@ScanRule(
    id="L3",
    family="area",
    needs=("identity", "area code", "position"),
    gate="standing for 60 s, the new area for 10 s, no cell of it heard before; not between "
    "networks of the first 5 minutes; an area as in L1",
    sentence="the area changed from {other_area} to {area} after {still_s} s of standing",
    harmless="the border of two areas, a cell switched off, another card or a roaming network",
    detection=0.4,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 83, 9.8)),
    refuted_by=_is_past_a_border,
)
def _change(memory: Memory, cell: HeardCell) -> Evidence | None:
    now, areas = memory.now, memory.of(_ServingAreas)
    if cell.area is None or cell.heard.reading.arfcn in GSMR_ARFCNS or not cell.heard.is_serving:
        return None
    key = cell.operator, cell.rat, cell.area
    if key in areas.known or now.t_s - cell.since_s < _HELD_S:
        return None
    before = areas.last.get(cell.rat)
    if before is not None and memory.are_apart(cell.operator, before[0]):
        before = areas.last.get(f"{cell.rat} {cell.operator}")
    areas.last.put(cell.rat, (cell.operator, cell.area))
    areas.last.put(f"{cell.rat} {cell.operator}", (cell.operator, cell.area))
    areas.known.add(key)
    is_still = now.x_m is not None and now.still_s >= _STILL_S + _HELD_S
    is_after_change = abs(cell.since_s - memory.changed_rat_s) < _HELD_S
    if before is None or is_after_change or not is_still or cell.is_renamed:
        return None
    if _is_known_area(memory, cell):
        return None
    arrived_s = now.t_s - now.still_s + _STILL_S
    for other in memory.of_operator(cell.operator, cell.rat):  # neighbours of it, at a border
        if other.area == cell.area and other.first_s < arrived_s:
            return None
    return {"area": cell.area, "other_area": before[1], "still_s": round(now.still_s)}
