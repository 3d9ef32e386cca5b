"""Neighbour lists: empty, naming nobody that can be heard, named by nobody, of another operator."""

from collections.abc import Iterator

from logger.core.latest import Latest
from logger.core.suspicion.countries import GSMR_ARFCNS
from logger.core.suspicion.heard import MOST_CELLS, HeardCell, Memory
from logger.core.suspicion.rule import GSM, Evidence, Rate, ScanRule, on_telephones

_FEWEST_SCANS = 3
_EMPTY_S = 20.0
_STRONG_DBM = -90.0
_FULL_SCAN = 8
"""Cells with an identity in one reply: more than a serving cell's neighbours."""
_FEWEST_LISTS = 3
_FEWEST_LISTED = 2


class _Silence:
    """Since when, and in how many scans, a serving cell is reported without neighbours."""

    of: tuple[str, float, int] | None = None


def _without_neighbours(memory: Memory) -> Iterator[HeardCell]:
    """The serving GSM cell, if it is reported alone by a modem that gave neighbours before."""
    now, serving, silence = memory.now, memory.serving, memory.of(_Silence)
    if serving is None or serving.rat != "GSM" or len(now.cells) != 1:
        silence.of = None
        return
    level_dbm = serving.heard.level_dbm
    if "GSM" not in memory.gave_neighbours or level_dbm is None or level_dbm < _STRONG_DBM:
        return
    name, since_s, n = silence.of or (serving.name, now.t_s, 0)
    if name != serving.name:
        since_s, n = now.t_s, 0
    silence.of = serving.name, since_s, n + 1
    yield serving


@ScanRule(
    id="N1",
    family="neighbours",
    needs=("identity", "neighbours", "level"),
    gate="3 scans and 20 s, serving cell at least -90 dBm, a modem that gave neighbours before",
    sentence="no neighbour was reported for {seconds} s at {level_dbm} dBm",
    harmless="a cell under ground or far from others",
    about=_without_neighbours,
    detection=0.7,
    measured=on_telephones(GSM=(0, 21, 2.0)),
    elsewhere=Rate(0, 21, 2.0, "2 h of GSM in calls"),
    rats=GSM,
)
def _none_for_a_while(memory: Memory, cell: HeardCell) -> Evidence | None:
    silence = memory.of(_Silence).of
    if silence is None or cell.heard.level_dbm is None:
        return None
    _, since_s, n = silence
    if n < _FEWEST_SCANS or memory.now.t_s - since_s < _EMPTY_S:
        return None
    return {
        "seconds": round(memory.now.t_s - since_s),
        "scans": n,
        "level_dbm": round(cell.heard.level_dbm),
    }


class _Lists:
    """Neighbour lists by cell, and whose channel each is, by technology and number."""

    def __init__(self) -> None:
        self.of: Latest[tuple[int, ...]] = Latest(MOST_CELLS)
        self.operator_of: Latest[str] = Latest(1000)
        self._seen: object = None

    def take(self, memory: Memory) -> None:
        if memory.now is self._seen:
            return
        self._seen = memory.now
        for cell in memory.taken:
            if cell.heard.reading.arfcn is not None:
                self.operator_of.put(f"{cell.rat} {cell.heard.reading.arfcn}", cell.operator)
            broadcast = cell.heard.broadcast
            if broadcast is not None and broadcast.neighbour_arfcns is not None:
                self.of.put(cell.name, broadcast.neighbour_arfcns)

    def operators(self, cell: HeardCell) -> list[str]:
        """Operators of the channels in a cell's list, as far as heard."""
        listed = self.of.get(cell.name, ())
        return [name for a in listed if (name := self.operator_of.get(f"{cell.rat} {a}"))]


def _with_lists(memory: Memory) -> Iterator[HeardCell]:
    """Cells of a scan that are not of a railway, once there is a list."""
    lists = memory.of(_Lists)
    lists.take(memory)
    if lists.of:
        for cell in memory.taken:
            if cell.heard.reading.arfcn not in GSMR_ARFCNS:
                yield cell


@ScanRule(
    id="N2",
    family="neighbours",
    needs=("identity", "channel", "neighbour lists"),
    gate="8 cells of the operator identified",
    sentence="none of the {listed} channels of its neighbour list was heard",
    harmless="the walk was too short to hear them",
    about=_with_lists,
    detection=0.4,
    elsewhere=Rate(0, 194, 0.0, "full scans of 197 cells, railways left out"),
    rats=GSM,
)
def _lists_nobody(memory: Memory, cell: HeardCell) -> Evidence | None:
    lists = memory.of(_Lists)
    listed = lists.of.get(cell.name)
    if not listed or lists.operators(cell):
        return None
    if len(memory.of_operator(cell.operator, cell.rat)) < _FULL_SCAN:
        return None
    return {"listed": len(listed), "heard": 0}


@ScanRule(
    id="N4",
    family="neighbours",
    needs=("identity", "channel", "neighbour lists"),
    gate="2 listed channels are another operator's, none its own; not where sites are shared",
    sentence="its neighbour list names {listed} channels of {other_operator} and none of its own",
    harmless="networks that share sites",
    about=_with_lists,
    detection=0.2,
    elsewhere=Rate(0, 196, 0.0, "full scans of 197 cells, a test station left out"),
    rats=GSM,
)
def _lists_others(memory: Memory, cell: HeardCell) -> Evidence | None:
    operators = memory.of(_Lists).operators(cell)
    if len(operators) < _FEWEST_LISTED or cell.operator in operators:
        return None
    if _is_shared(memory, cell.operator, set(operators)):
        return None
    return {"listed": len(operators), "other_operator": min(operators)}


def _is_shared(memory: Memory, operator: str, others: set[str]) -> bool:
    """Whether another cell of an operator lists the others' channels too: they share sites."""
    lists = memory.of(_Lists)
    sharing = 0
    for name in lists.of:
        cell = memory.cells.get(name)
        if cell is not None and cell.operator == operator:
            sharing += bool(others.intersection(lists.operators(cell)))
    return sharing > 1


@ScanRule(
    id="N3",
    family="neighbours",
    needs=("identity", "channel", "level", "neighbour lists"),
    gate="the cell at least -90 dBm, 3 lists of other cells of the operator",
    sentence="channel {channel} is in none of the {lists} neighbour lists of the operator",
    harmless="a new cell, an indoor cell",
    about=_with_lists,
    detection=0.7,
    elsewhere=Rate(1, 197, 0.0, "full scans of 197 cells"),
    rats=GSM,
)
def _listed_by_nobody(memory: Memory, cell: HeardCell) -> Evidence | None:
    arfcn, of = cell.heard.reading.arfcn, memory.of(_Lists).of
    if arfcn is None or cell.best_dbm < _STRONG_DBM:
        return None
    of_operator = memory.of_operator(cell.operator, cell.rat)
    lists = [of[other.name] for other in of_operator if other is not cell and other.name in of]
    if sum(map(bool, lists)) < _FEWEST_LISTS or any(arfcn in listed for listed in lists):
        return None
    return {"channel": arfcn, "lists": len(lists)}
