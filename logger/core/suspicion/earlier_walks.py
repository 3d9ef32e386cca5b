"""Earlier walks of the same ground: cells that are new, and cells that are gone."""

from collections.abc import Iterable, Iterator
from functools import partial
from math import hypot, log
from statistics import median

from logger.core.baseline import KnownCell, SquareHistory, square_of, squares_around
from logger.core.cell_names import identity_of
from logger.core.latest import Latest
from logger.core.suspicion.heard import FULL_LIST, MOST_CELLS, HeardCell, Memory
from logger.core.suspicion.rule import Evidence, Rate, Rule, ScanRule

FEWEST_WALKS = 7
"""Measured: after one walk 11.8 new cells an hour, after seven 1.7."""
_MANY_WALKS = 15
_NEW_AFTER_MANY = 1 / 228
"""Share of the cells of 31 commutes that 15 others or more of this ground had not heard: with one
reading at the level 1 of 228, with three, as the gate demands, none of 220."""
FEWEST_MOVED = 3  # cells with a new area code: the operator has renumbered
_STRONG_DBM = -95.0
"""A cell that is new and weak was too weak before."""
_PLACE_M = 150.0
_SHARE_OF_WALKS = 0.9
"""One walk in ten may pass a square at its edge."""
_MARGIN_DB = 15.0
"""Two standard deviations of shadowing: below, a legitimate cell may be missed by chance."""
_FEWEST_PLACES = 3
"""One or two may be behind the same house."""
_APART_M = 50.0
"""Shadowing by houses is nearly independent over this distance."""
_FEWEST_COMMON = 3
"""Cells of today and earlier whose levels show that today's antenna is as good."""


class _Visit:
    """What full lists of one technology named in one square today.

    `limits_dbm` has the weakest level that a list named, by place; places are `_APART_M` apart.
    `unnamed_channels` are those of cells without a printed identity. `weaker_db` is by how much
    today's levels are below earlier ones; None without enough cells of both.
    """

    def __init__(self, square: int) -> None:
        self.square = square
        self.limits_dbm: dict[tuple[float, float], float] = {}
        self.unnamed_channels: set[int | None] = set()
        self.weaker_db: float | None = None
        self._sums: Latest[tuple[int, float]] = Latest(MOST_CELLS)

    def add(self, x_m: float, y_m: float, levels_dbm: dict[str, float]) -> None:
        """Add the levels of one list, by cell."""
        places = self.limits_dbm
        near = [at for at in places if hypot(at[0] - x_m, at[1] - y_m) < _APART_M]
        at = near[0] if near else (x_m, y_m)
        places[at] = min(places.get(at, 0.0), *levels_dbm.values())
        for cell, level_dbm in levels_dbm.items():
            n, sum_dbm = self._sums.get(cell, (0, 0.0))
            self._sums.put(cell, (n + 1, sum_dbm + level_dbm))

    def compare(self, earlier: SquareHistory) -> None:
        both = [
            earlier.cells[cell].mean_dbm - sum_dbm / n
            for cell, (n, sum_dbm) in self._sums.items()
            if cell in earlier.cells
        ]
        self.weaker_db = max(median(both), 0.0) if len(both) >= _FEWEST_COMMON else None


class _Here:
    """Squares of earlier walks around, looked up once a scan; the last visit by technology."""

    def __init__(self) -> None:
        self.now: object = None
        self.around: tuple[SquareHistory, ...] = ()
        self.n_walks: dict[tuple[str, str], int] = {}  # by network and technology
        self.numbers: frozenset[tuple[str, int]] | None = None  # of all there, once asked for
        self.visits: dict[str, _Visit] = {}


def ground(memory: Memory) -> tuple[SquareHistory, ...]:
    """Squares of earlier walks within 150 m, the walker's first; empty without walks or place."""
    now, kept = memory.now, memory.of(_Here)
    if now is not kept.now:
        kept.now, kept.around, kept.n_walks, kept.numbers = now, (), {}, None
        if memory.baseline.n_walks and now.lat_deg is not None and now.lon_deg is not None:
            kept.around = squares_around(memory.baseline, now.lat_deg, now.lon_deg, _PLACE_M)
    return kept.around


def walks_of(square: SquareHistory, operator: str, rat: str) -> int:
    # at least: as many as heard the same cell of it; those with another card say nothing about it
    of_network = f"{operator}-"
    heard = [one.n_walks for name, one in square.cells.items() if name.startswith(of_network)]
    return min(max(heard, default=0), square.n_walks.get(rat, 0))


def _n_walks(memory: Memory, cell: HeardCell) -> int:
    around, by_network = ground(memory), memory.of(_Here).n_walks
    network = cell.operator, cell.rat
    if network not in by_network:
        by_network[network] = walks_of(around[0], *network) if around else 0
    return by_network[network]


def _is_renumbered(memory: Memory, name: str) -> bool:
    # nearly no rogue cell has the numbers of several legitimate ones
    cell, around = memory.cells.get(name), ground(memory)
    if cell is None or _is_known(around, name):
        return False
    moved = [
        other.name
        for other in memory.of_operator(cell.operator, cell.rat)
        if other.area == cell.area
        and _has_known_number(memory, other)
        and not _is_known(around, other.name)
    ]
    if name in moved and len(moved) >= FEWEST_MOVED:
        return True
    # nor are most cells rogue where earlier walks knew the network
    answers = memory.of(_ASKED)
    network = _network(cell)
    are_new = [is_new for key, is_new in answers.items() if key.startswith(network)]
    return sum(are_new) >= FEWEST_MOVED and 2 * sum(are_new) > len(are_new)


def _has_known_number(memory: Memory, cell: HeardCell) -> bool:
    kept = memory.of(_Here)
    if kept.numbers is None:
        heard = {heard for square in ground(memory) for heard in square.cells}
        kept.numbers = frozenset(_without_area(one) for one in heard if identity_of(one))
    return (cell.operator, cell.cid) in kept.numbers


def _network(cell: HeardCell) -> str:
    return f"{cell.operator} {cell.rat} "


def _is_known(around: tuple[SquareHistory, ...], name: str) -> bool:
    return any(name in square.cells for square in around)


def _without_area(name: str) -> tuple[str, int]:
    operator, _, cid = name.rsplit("-", 2)  # of `mcc-mnc-area-cid`
    return operator, int(cid)


_UNHEARD = "did not hear this cell here"
_NAMED_NEW = 0.9
_NEW = Rate(4, 233, 0.0, "walks of two routes after 7 to 14 others")


def _new_nats(memory: Memory, cell: HeardCell) -> float:
    is_many = _n_walks(memory, cell) >= _MANY_WALKS
    return log(_NAMED_NEW / (_NEW_AFTER_MANY if is_many else _NEW.per_cell))


# Whether cells are new, about which B1 was asked, by network and name; new ones by channel and
# code, as one station may change its identity.
_ASKED = partial(Latest[bool], MOST_CELLS)


@ScanRule(
    id="B1",
    family="earlier walks",
    needs=("identity", "level", "position", "earlier walks"),
    gate="7 earlier walks with this network and technology here, 3 readings of at least -95 dBm; "
    "from 15 walks on it suffices; not where 3 cells have another area code than then or most are "
    "new",
    sentence="{walks} earlier walks {what}, today it has {level_dbm} dBm",
    harmless="a new cell, a cell that was repaired, one that earlier walks heard and did not learn",
    detection=_NAMED_NEW,
    elsewhere=_NEW,
    strength="suffices",
    weigh=_new_nats,
    refuted_by=_is_renumbered,
)
def _is_new(memory: Memory, cell: HeardCell) -> Evidence | None:
    n_walks, level_dbm, weakest_dbm = _n_walks(memory, cell), cell.heard.level_dbm, cell.weakest_dbm
    if n_walks < FEWEST_WALKS or level_dbm is None or weakest_dbm is None:
        return None
    if weakest_dbm < _STRONG_DBM:
        return None
    is_new = memory.baseline.cell(cell.name) is None
    if not (is_new and _has_known_number(memory, cell)):
        station = cell.pair if is_new and cell.pair else cell.name
        memory.of(_ASKED).put(f"{_network(cell)}{station}", is_new)
    if not is_new:
        return None
    is_doubted = memory.baseline.is_doubted(cell.name)
    what = "did not learn this cell, which was unusual then" if is_doubted else _UNHEARD
    return {"walks": n_walks, "what": what, "level_dbm": round(level_dbm)}


def _always_heard_before(memory: Memory) -> Iterator[KnownCell]:
    """Cells that earlier walks always heard here and this one has not, once it has enough lists."""
    now, baseline, visits = memory.now, memory.baseline, memory.of(_Here).visits
    if not baseline.n_walks or now.lat_deg is None or now.lon_deg is None:
        return
    assert now.x_m is not None
    assert now.y_m is not None
    square = square_of(now.lat_deg, now.lon_deg)
    for rat, levels_dbm in _full_lists(memory.taken).items():
        visit = visits.get(rat)
        if visit is None or visit.square != square:
            visit = visits[rat] = _Visit(square)
        visit.add(now.x_m, now.y_m, levels_dbm)
        unnamed = [heard for heard in now.cells if heard.name is None and heard.rat == rat]
        # one of them may be the cell looked for
        visit.unnamed_channels |= {heard.reading.arfcn for heard in unnamed} - {None}
        if len(visit.limits_dbm) < _FEWEST_PLACES:
            continue
        earlier = baseline.square(square)
        n_walks = earlier.n_walks.get(rat, 0)
        if n_walks < FEWEST_WALKS:
            continue
        visit.compare(earlier)
        for name, heard in earlier.cells.items():
            if heard.n_walks >= _SHARE_OF_WALKS * n_walks and name not in memory.cells:
                known = baseline.cell(name)
                if known is not None and known.rat == rat:
                    yield known


def _is_heard(memory: Memory, name: str) -> bool:
    return any(cell.name == name for cell in memory.taken)


@Rule[Memory, KnownCell](
    id="B3",
    family="earlier walks",
    needs=("identity", "level", "position", "neighbours", "earlier walks"),
    gate="heard by 90 % of 7 earlier walks in this square, 15 dB above what scans of 4 cells "
    "or more at 3 places 50 m apart could have missed; only warns",
    sentence="{walks} of {of} earlier walks heard it here with {level_dbm} dBm; today scans at "
    "{places} places, down to {limit_dbm} dBm, do not name it",
    harmless="a cell switched off or repaired, a modem that lists other bands or networks",
    about=_always_heard_before,
    detection=0.5,
    strength="warns",  # no log of legitimate networks has measured its rate
    refuted_by=_is_heard,
)
def _is_missed(memory: Memory, known: KnownCell) -> Evidence | None:
    visit = memory.of(_Here).visits[known.rat]
    earlier = memory.baseline.square(visit.square)
    heard = earlier.cells[known.name]
    if visit.weaker_db is None:
        return None
    usual_dbm = min(heard.mean_dbm, heard.least_best_dbm)  # each walk had the latter
    lowest_dbm = usual_dbm - visit.weaker_db - _MARGIN_DB
    limits_dbm = [limit for limit in visit.limits_dbm.values() if limit <= lowest_dbm]
    if len(limits_dbm) < _FEWEST_PLACES:
        return None
    if any(channel in visit.unnamed_channels for channel, _ in known.channels):
        return None
    operator = known.name.rsplit("-", 2)[0]  # of `mcc-mnc-area-cid`
    if not memory.of_operator(operator, known.rat):  # today's modem names no cell of the network
        return None
    return {
        "walks": heard.n_walks,
        "of": earlier.n_walks[known.rat],
        "level_dbm": round(usual_dbm),
        "places": len(limits_dbm),
        "limit_dbm": round(max(limits_dbm)),
    }


def _full_lists(taken: Iterable[HeardCell]) -> dict[str, dict[str, float]]:
    by_rat: dict[str, dict[str, float]] = {}
    for cell in taken:
        if cell.heard.level_dbm is not None:
            by_rat.setdefault(cell.rat, {})[cell.name] = cell.heard.level_dbm
    return {rat: levels for rat, levels in by_rat.items() if len(levels) >= FULL_LIST}
