"""Location and tracking areas: codes that no other cell has, and changes while standing."""

from collections.abc import Iterator
from math import hypot

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.countries import GSMR_ARFCNS, TEST_MCCS
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Heard, HeardCell, Memory, Moment
from logger.core.suspicion.networks import MOST_NETWORKS

_LATE_S = 300.0
"""A telephone that names its serving cell alone meets three cells in some minutes."""
_WAIT_S = 20.0
"""At the begin of a walk and at borders the second cell of an area follows soon."""
_BORDER_M, _BORDER_S = 100.0, 80.0
"""What is soon in a car takes longer on foot: the way of a car in `_WAIT_S` in a town, or the time
that a walker takes for it. A walker who stands has not come to a border."""
_FEWEST_NEIGHBOURS = 3
_FEWEST_CELLS = 10
_FEWEST_AFTER = 3
"""Other cells heard after the first of an area: at a border they belong to the new area."""
_ALONE_S = 60.0
_STRONG_DBM = -90.0
_HELD_S = 10.0
_STILL_S = 60.0
_SINGLE_S = 20.0
_FEWEST_SCANS = 3
_HEARD_DBM = -105.0
"""The other cells of a network beyond the border come as weakly as this one."""


class AreaRules:
    """L1, L2, L3 and L4."""

    def __init__(self) -> None:
        self._serving: Latest[tuple[str, int]] = Latest(MOST_NETWORKS)
        """Network and area of the last serving cell in a new area, of each technology, and of each
        technology and network: a log may be of several."""
        self._areas: set[tuple[str, str, int]] = set()

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        for cell, heard in taken:
            if cell.name in memory.foreign:
                yield from self._single(now, memory, cell, heard)
            if cell.area is None or heard.reading.arfcn in GSMR_ARFCNS:
                continue
            if (
                now.t_s - cell.first_s >= _WAIT_S
                and not heard.operator.startswith("?")
                and not _shares_area(cell, memory)
            ):
                if _is_past_border(now, cell):
                    yield from _unlike_neighbours(now, memory, cell, heard)
                yield from _alone(now, memory, cell)
            if heard.is_serving:
                yield from self._change(now, memory, cell)

    def _single(
        self, now: Moment, memory: Memory, cell: HeardCell, heard: Heard
    ) -> Iterator[Broken]:
        """L4: a network that is not of this place, with a single cell."""
        if now.t_s - cell.first_s < _SINGLE_S:
            return
        is_weak = heard.level_dbm is None or heard.level_dbm < _HEARD_DBM
        if is_weak or cell.n_scans < _FEWEST_SCANS:
            return
        if len(memory.of_operator(cell.operator, cell.rat)) == 1:
            evidence: Evidence = {
                "operator": cell.operator,
                "seconds": round(now.t_s - cell.first_s),
            }
            yield Broken("L4", cell.name, evidence)

    def _change(self, now: Moment, memory: Memory, cell: HeardCell) -> Iterator[Broken]:
        """L3: a new area code while standing."""
        assert cell.area is not None
        key = cell.operator, cell.rat, cell.area
        if key in self._areas or now.t_s - cell.since_s < _HELD_S:
            return
        before = self._serving.get(cell.rat)
        if before is not None and memory.networks.are_apart(cell.operator, before[0]):
            before = self._serving.get(f"{cell.rat} {cell.operator}")
        self._serving.put(cell.rat, (cell.operator, cell.area))
        self._serving.put(f"{cell.rat} {cell.operator}", (cell.operator, cell.area))
        self._areas.add(key)
        is_still = now.x_m is not None and now.still_s >= _STILL_S + _HELD_S
        is_after_change = abs(cell.since_s - memory.changed_rat_s) < _HELD_S
        if before is None or is_after_change or not is_still:
            return
        evidence: Evidence = {
            "area": cell.area,
            "other_area": before[1],
            "still_s": round(now.still_s),
        }
        yield Broken("L3", cell.name, evidence)


def _is_past_border(now: Moment, cell: HeardCell) -> bool:
    """Whether a cell is too far from where it was heard first to be that of a border just met."""
    since_s = now.t_s - cell.first_s
    if now.x_m is None or now.y_m is None or cell.first_m is None:
        return True
    if since_s >= _BORDER_S or now.still_s >= since_s:
        return True
    return hypot(now.x_m - cell.first_m[0], now.y_m - cell.first_m[1]) >= _BORDER_M


def _shares_area(cell: HeardCell, memory: Memory) -> bool:
    """Whether another cell of the operator has the area code of a cell."""
    area = cell.area
    for other in memory.of_operator(cell.operator, cell.rat):  # a generator takes twice the time
        if other.area == area and other is not cell:
            return True
    return False


def _unlike_neighbours(
    now: Moment, memory: Memory, cell: HeardCell, heard: Heard
) -> Iterator[Broken]:
    """L1: an area code that none of at least three cells heard with it has."""
    if heard.level_dbm is None or heard.level_dbm < _STRONG_DBM:
        return
    of_operator = memory.of_operator(cell.operator, cell.rat)
    late = [c for c in of_operator
            if c is not cell and c.area is not None and now.t_s - c.last_s <= _LATE_S]  # fmt: skip
    if len(late) >= _FEWEST_NEIGHBOURS:
        evidence: Evidence = {
            "area": cell.area or 0,
            "neighbours": len(late),
            "other_area": late[-1].area or 0,
            "level_dbm": round(heard.level_dbm),
        }
        yield Broken("L1", cell.name, evidence)


def _alone(now: Moment, memory: Memory, cell: HeardCell) -> Iterator[Broken]:
    """L2: an area with a single cell among at least ten of the operator."""
    if now.t_s - cell.first_s < _ALONE_S or cell.operator[:3] in TEST_MCCS:
        return
    of_operator = memory.of_operator(cell.operator, cell.rat)
    with_area = [c for c in of_operator if c is not cell and c.area is not None]
    n_after = sum(c.last_s > cell.first_s for c in with_area)
    if len(with_area) + 1 >= _FEWEST_CELLS and n_after >= _FEWEST_AFTER:
        evidence: Evidence = {"area": cell.area or 0, "cells": len(with_area) + 1}
        yield Broken("L2", cell.name, evidence)
