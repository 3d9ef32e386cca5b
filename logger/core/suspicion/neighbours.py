"""Neighbour lists: empty, naming nobody that can be heard, named by nobody, of another operator."""

from collections.abc import Iterator

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.countries import GSMR_ARFCNS
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import HeardCell, Memory, Moment

_FEWEST_SCANS = 3
_EMPTY_S = 20.0
_STRONG_DBM = -90.0
_FULL_SCAN = 8
"""Cells with an identity in one reply: more than the neighbours of a serving cell."""
_FEWEST_LISTS = 3
_FEWEST_LISTED = 2
_MOST_LISTS = 128


class NeighbourRules:
    """N1, N2, N3 and N4."""

    def __init__(self) -> None:
        self._empty: tuple[str, float, int] | None = None
        self._lists: Latest[tuple[int, ...]] = Latest(_MOST_LISTS)
        self._operator_of: Latest[str] = Latest(1000)

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        yield from self._no_neighbours(now, memory)
        for cell, heard in taken:
            if heard.reading.arfcn is not None:
                self._operator_of.put(f"{cell.rat} {heard.reading.arfcn}", cell.operator)
            broadcast = heard.broadcast
            if broadcast is not None and broadcast.neighbour_arfcns is not None:
                self._lists.put(cell.name, broadcast.neighbour_arfcns)
        if self._lists:
            for cell, heard in taken:
                if heard.reading.arfcn not in GSMR_ARFCNS:
                    yield from self._check_lists(memory, cell, heard.reading.arfcn)

    def _no_neighbours(self, now: Moment, memory: Memory) -> Iterator[Broken]:
        """N1: the serving GSM cell is reported without neighbours for a while."""
        serving = now.serving
        is_empty = len(now.cells) == 1 and serving is not None and serving.rat == "GSM"
        if serving is None or serving.name is None or not is_empty:
            self._empty = None
            return
        level_dbm = serving.level_dbm
        if "GSM" not in memory.gave_neighbours or level_dbm is None or level_dbm < _STRONG_DBM:
            return
        name, since_s, n = self._empty or (serving.name, now.t_s, 0)
        if name != serving.name:
            since_s, n = now.t_s, 0
        self._empty = serving.name, since_s, n + 1
        if n + 1 >= _FEWEST_SCANS and now.t_s - since_s >= _EMPTY_S:
            evidence: Evidence = {
                "seconds": round(now.t_s - since_s),
                "scans": n + 1,
                "level_dbm": round(level_dbm),
            }
            yield Broken("N1", serving.name, evidence)

    def _check_lists(self, memory: Memory, cell: HeardCell, arfcn: int | None) -> Iterator[Broken]:
        of_operator = memory.of_operator(cell.operator, cell.rat)
        listed = self._lists.get(cell.name)
        if listed:
            heard = [c for a in listed if (c := self._operator_of.get(f"{cell.rat} {a}"))]
            if not heard and len(of_operator) >= _FULL_SCAN:
                yield Broken("N2", cell.name, {"listed": len(listed), "heard": 0})
            if len(heard) >= _FEWEST_LISTED and cell.operator not in heard:
                others = {name for name in heard if name != cell.operator}
                if not self._is_shared(cell.operator, others, memory):
                    evidence: Evidence = {"listed": len(heard), "other_operator": min(others)}
                    yield Broken("N4", cell.name, evidence)
        if arfcn is None or cell.best_dbm < _STRONG_DBM:
            return
        lists = [
            self._lists[c.name] for c in of_operator if c is not cell and c.name in self._lists
        ]
        is_asked = sum(map(bool, lists)) >= _FEWEST_LISTS
        if is_asked and not any(arfcn in neighbours for neighbours in lists):
            yield Broken("N3", cell.name, {"channel": arfcn, "lists": len(lists)})

    def _is_shared(self, operator: str, others: set[str], memory: Memory) -> bool:
        """Whether another cell of an operator lists the others' channels too: they share sites."""
        sharing = 0
        for name, listed in self._lists.items():
            cell = memory.cells.get(name)
            if cell is not None and cell.operator == operator:
                named = {self._operator_of.get(f"{cell.rat} {arfcn}") for arfcn in listed}
                sharing += bool(named & others)
        return sharing > 1
