"""What the rules see: the cells of one scan at one place, and what was heard before."""

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from math import cos, hypot, inf, radians
from statistics import median
from typing import Any, NamedTuple, TypeVar

from logger.core.baseline import NO_BASELINE, Baseline
from logger.core.fix_gate import METRES_PER_DEG, FixGate
from logger.core.latest import Latest
from logger.core.suspicion.spots import Spot, Spots
from logger.core.types import Broadcast, CellReading, Fix, Scan

GAP_S = 15.0
"""A cell not reported for longer is not held: modems print a list every 1 to 10 s."""
_OF_LATE = 128  # cells, and all of the last two scans: one of a large city names more
MOST_CELLS = 1024  # of a scan: GSM has 973 channels, of one cell each
_MOST_PAIRS = 4
STEADY = 3
"""Readings at a new level: one may be wrong."""
FULL_LIST = 4
"""From so many cells on, the weakest level of a scan limits what could be missed."""
PAIR_HELD_S = 10.0
"""Telephones print the old identity with the new channel for some seconds after a handover."""
_MOST_MET, _LATE_S = 4, 300.0  # cells that begin to serve a walker who stands
_LOWEST_DBM = -145.0
"""Below RSRP (-144 dBm, 3GPP TS 36.133 9.1.4): some telephones print -200 for none."""
_TAKES_OVER_DB = 9.0  # of two cells on one channel the weaker cannot be decoded (TS 45.005)
MOST_NETWORKS = 128  # more than all countries near a walk have
_USUAL_S = 300.0
"""A log of several telephones, or of a modem that tries networks in turn, names all of them in the
first minutes."""
_INDOORS_DB, _OUTDOORS_DB = 10.0, -5.0
_REPEATER_DB = 20.0  # three deviations of the median of a few cells round a corner
_DOOR_M = 60.0  # within which a door is passed; indoor positions are as far off
_LEFT_M = 300.0  # where the levels of before are no longer to be compared
_FEWEST_TO_COMPARE = 3  # cells of two scans
ALL_NETWORKS = "?-?"
_NO_AREA = frozenset({0, 0xFFFE, 0xFFFF})
"""Area codes of a cell that is not registered with (3GPP TS 23.003 4.1)."""


class Heard(NamedTuple):
    """One cell of a scan; `operator` is `mcc-mnc`, `code` BSIC, PSC or PCI, None is unknown.

    `broadcast` is what the cell broadcasts, once the modem has printed it twice.
    """

    name: str | None
    reading: CellReading
    rat: str
    operator: str
    area: int | None
    code: int | None
    level_dbm: float | None
    is_serving: bool
    broadcast: Broadcast | None


def heard_of(reading: CellReading) -> Heard:
    """A reading as the rules see it; a doubtful identity is no identity."""
    area = reading.tac if reading.lac is None else reading.lac
    code = reading.bsic
    if code is None:
        code = reading.pci if reading.psc is None else reading.psc
    level_dbm = reading.level_dbm
    broadcast = reading.broadcast
    return Heard(
        None if reading.identity_unsure or reading.cid is None else reading.cell,
        reading,
        reading.rat or "",
        f"{reading.mcc or '?'}-{reading.mnc or '?'}",
        None if area in _NO_AREA else area,
        code,
        level_dbm if level_dbm is not None and level_dbm > _LOWEST_DBM else None,
        reading.role == "serving",
        None if broadcast is None or broadcast.broadcast_unsure else broadcast,
    )


class Level(NamedTuple):
    """A level of late, with time and place (metres, None if unknown)."""

    t_s: float
    level_dbm: float
    x_m: float | None
    y_m: float | None
    new: "Level | None" = None  # its first: of a neighbour a modem repeats an old one


@dataclass(slots=True)
class HeardCell:
    """Memory of one cell.

    `heard` is its reading in the last scan that named it, `since_s` the begin of the present
    uninterrupted reception, `first_m` the place of the first. `weakest_dbm` is the weakest of the
    last `STEADY` levels, None before there are so many. `twin`: another channel in the same
    scans, since when and in which scan.
    """

    heard: Heard
    name: str
    rat: str
    operator: str
    area: int | None
    cid: int | None
    first_s: float
    last_s: float
    since_s: float
    n_scans: int = 0
    best_dbm: float = -200.0
    weakest_dbm: float | None = None
    pair: tuple[int, int] | None = None
    pair_last_s: float = 0.0
    held_s: dict[tuple[int, int], float] = field(default_factory=dict)
    spots: Spots = field(default_factory=Spots)
    recent: deque[Level] = field(default_factory=lambda: deque(maxlen=6))
    rings: list[tuple[float, float, int]] = field(default_factory=list)
    longest_s: float = 0.0
    first_m: tuple[float, float] | None = None
    twin: tuple[int, float, int] | None = None
    is_renamed: bool = False  # the station was heard before, under another area code

    def take(self, now: "Moment", heard: Heard, is_changed: bool) -> None:
        """Remember a reading; indoors or beside a repeater without its level."""
        self.heard = heard
        t_s = now.t_s
        if t_s - self.last_s > GAP_S:
            self.since_s = t_s
        self.last_s = t_s
        self.longest_s = max(self.longest_s, t_s - self.since_s)
        self.n_scans += 1
        if self.first_m is None and now.x_m is not None and now.y_m is not None:
            self.first_m = now.x_m, now.y_m
        arfcn, code = heard.reading.arfcn, heard.code
        if arfcn is not None and code is not None:
            self._take_pair(t_s, (arfcn, code))
        if heard.level_dbm is not None:
            self._take_level(now, heard.level_dbm, is_changed, heard.is_serving)

    def take_twin(self, t_s: float, heard: Heard) -> None:
        # a second reading of one scan; since when without a scan that has one alone
        channel, own = heard.reading.arfcn, self.heard.reading.arfcn
        if channel is None or own is None or channel == own or heard.rat != self.rat:
            return
        _, since_s, n = self.twin or (channel, t_s, 0)
        self.twin = channel, t_s if n < self.n_scans - 1 else since_s, self.n_scans

    def _take_pair(self, t_s: float, pair: tuple[int, int]) -> None:
        """Channel and colour code are held for a while: after a handover they are mixed."""
        if pair != self.pair or self.since_s > self.pair_last_s:
            self.pair, self.pair_last_s = pair, t_s
        if pair in self.held_s or len(self.held_s) < _MOST_PAIRS:
            self.held_s[pair] = self.held_s.get(pair, 0.0) + t_s - self.pair_last_s
        self.pair_last_s = t_s

    @property
    def usual_pair(self) -> tuple[int, int] | None:
        """Channel and colour code it had for longest, at least `PAIR_HELD_S`."""
        held_s = self.held_s
        if not held_s:
            return None
        pair = max(held_s, key=held_s.__getitem__) if len(held_s) > 1 else next(iter(held_s))
        return None if held_s[pair] < PAIR_HELD_S else pair

    @property
    def held_channels(self) -> list[int]:
        """Channels it had for at least `PAIR_HELD_S`, in their order."""
        held = [pair[0] for pair, held_s in self.held_s.items() if held_s >= PAIR_HELD_S]
        return list(dict.fromkeys(held))

    def _take_level(
        self, now: "Moment", level_dbm: float, is_changed: bool, is_serving: bool
    ) -> None:
        self.best_dbm = max(self.best_dbm, level_dbm)
        recent, new = self.recent, None
        if recent and recent[-1].level_dbm == level_dbm and not is_serving:
            new = recent[-1].new or recent[-1]
        recent.append(Level(now.t_s, level_dbm, now.x_m, now.y_m, new))
        if len(recent) >= STEADY:
            last = recent[-1].level_dbm, recent[-2].level_dbm, recent[-3].level_dbm
            self.weakest_dbm = min(last)
        if now.x_m is not None and now.y_m is not None and not is_changed:
            self.spots.add(now.x_m, now.y_m, level_dbm, now.t_s)


class Moment(NamedTuple):
    """One scan: time in seconds since boot, place, and its cells, each once.

    `x_m, y_m` are east and north of the first fix; `still_s` how long the walker has stood here.
    `serving` is its first serving cell, `leapt_s` the last leap of position.
    """

    t_ns: int
    t_s: float
    lat_deg: float | None
    lon_deg: float | None
    x_m: float | None
    y_m: float | None
    still_s: float
    cells: tuple[Heard, ...]
    serving: Heard | None
    leapt_s: float


class Walker:
    """Place of the receiver in metres from its first fix, and how long it has been there."""

    STILL_M = 30.0
    """Positions of a standing receiver in a street scatter by this much."""
    DOUBTFUL_S = 70.0  # before and after a leap: reflections displace a receiver for a minute

    def __init__(self, max_fix_age_s: float) -> None:
        self._max_age_s = max_fix_age_s
        self._origin: tuple[float, float] | None = None
        self._last: tuple[float, float, float] | None = None
        self._still = (0.0, 0.0, 0.0)
        self._gate = FixGate()

    def add(self, t_ns: int, fix: Fix) -> None:
        """Take a fix; one that cannot be true changes nothing, as one without a position."""
        if not self._gate.passes(t_ns, fix):
            return
        t_s = t_ns / 1e9
        if not fix.valid or fix.lat_deg is None or fix.lon_deg is None:
            return
        self._origin = self._origin or (fix.lat_deg, fix.lon_deg)
        is_first = self._last is None
        self._last = t_s, fix.lat_deg, fix.lon_deg
        x_m, y_m = self._to_metres(fix.lat_deg, fix.lon_deg)
        if is_first or hypot(x_m - self._still[1], y_m - self._still[2]) > self.STILL_M:
            self._still = t_s, x_m, y_m

    def at(self, t_ns: int, scan: Scan) -> Moment:
        """A scan at the last fix, without a place if that is too old."""
        t_s = t_ns / 1e9
        cells = tuple([heard_of(reading) for reading in scan.readings])
        serving = next((heard for heard in cells if heard.is_serving), None)
        leapt_s = (self._gate.leapt_ns or -inf) / 1e9
        is_doubtful = t_s - leapt_s < self.DOUBTFUL_S
        if self._last is None or is_doubtful or t_s - self._last[0] > self._max_age_s:
            return Moment(t_ns, t_s, None, None, None, None, 0.0, cells, serving, leapt_s)
        _, lat_deg, lon_deg = self._last
        x_m, y_m = self._to_metres(lat_deg, lon_deg)
        still_s = t_s - self._still[0]
        return Moment(t_ns, t_s, lat_deg, lon_deg, x_m, y_m, still_s, cells, serving, leapt_s)

    def _to_metres(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        lat0_deg, lon0_deg = self._origin or (lat_deg, lon_deg)
        turn_deg = (lon_deg - lon0_deg + 180.0) % 360.0 - 180.0
        x_m = turn_deg * METRES_PER_DEG * cos(radians(lat0_deg))
        return x_m, (lat_deg - lat0_deg) * METRES_PER_DEG


def may_be_same(operator: str, other: str) -> bool:
    """Whether two networks `mcc-mnc` may be one; `?` is a code that the modem did not print."""
    pairs = zip(operator.split("-"), other.split("-"), strict=False)
    return all("?" in pair or pair[0] == pair[1] for pair in pairs)


def levels_dbm(now: Moment, network: str = ALL_NETWORKS) -> dict[object, float]:
    """By cell, or channel and code."""
    levels = {
        heard.name or (heard.rat, heard.reading.arfcn, heard.code): heard.level_dbm
        for heard in now.cells
        if network == ALL_NETWORKS or may_be_same(heard.operator, network)
    }
    return {key: level_dbm for key, level_dbm in levels.items() if level_dbm is not None}


def _change_db(before: Moment, now: Moment, network: str) -> float | None:
    # what all cells have in common; a new cell or one that moves has no say
    old_dbm = levels_dbm(before, network)
    new = [(key, dbm) for key, dbm in levels_dbm(now, network).items() if key in old_dbm]
    if len(new) < _FEWEST_TO_COMPARE:
        return None
    return median([level_dbm - old_dbm[key] for key, level_dbm in new])


def _is_near(before: Moment | Level, now: Moment, way_m: float) -> bool:
    # a place that is not known may be near
    if before.x_m is None or before.y_m is None or now.x_m is None or now.y_m is None:
        return True
    return hypot(now.x_m - before.x_m, now.y_m - before.y_m) <= way_m


def _is_brief(raised: Moment, now: Moment) -> bool:
    return now.t_s - raised.t_s <= _LATE_S and _is_near(raised, now, _LEFT_M)


State = TypeVar("State")


class Memory:
    """All that the rules see: the scan `now`, the `latest`, cells of late, earlier walks.

    `taken` are the named cells of the scan, each once, and `serving` the one that serves, if it is
    named. `foreign` are cells whose network is not of this place. What a rule keeps itself it gets
    by `of`.
    """

    now: Moment

    def __init__(self, baseline: Baseline = NO_BASELINE) -> None:
        self.baseline = baseline
        self.latest: deque[Moment] = deque(maxlen=2 * STEADY)
        self.taken: list[HeardCell] = []
        self.serving: HeardCell | None = None
        self.cells: Latest[HeardCell] = Latest(MOST_CELLS)
        self.gave_neighbours: set[str] = set()
        self.foreign: Latest[None] = Latest(MOST_CELLS)
        self.changed_rat_s = -1e9
        self.silent_s = -1e9  # when two scans in turn heard nothing at last
        self._serving_rat: str | None = None
        self._served: Latest[None] = Latest(MOST_CELLS)
        self._met_s: deque[float] = deque(maxlen=_MOST_MET)
        self._by_operator: dict[tuple[str, str], dict[str, HeardCell]] = {}
        self._first_s: float | None = None
        self._usual: set[str] = set()
        self._of: dict[Callable[[], Any], Any] = {}
        # by network, as a repeater serves one; the first is all of them
        self._beside: dict[str, deque[Moment]] = {}
        self._outdoors: dict[str, Moment] = {}
        self._raised: dict[str, Moment] = {}

    def take(self, now: Moment) -> None:
        """Remember a scan."""
        now = self._at_rest(now)
        self.now = now
        self.latest.append(now)
        self._take_serving(now)
        networks = {heard.operator for heard in now.cells if heard.name}
        for network in (ALL_NETWORKS, *(networks if len(networks) > 1 else ())):
            self._take_walls(now, network)
        changed = self._outdoors.keys() | self._raised.keys()
        taken: dict[str, HeardCell] = {}
        for heard in now.cells:
            name = heard.name
            if name is None:
                continue
            if name in taken:
                taken[name].take_twin(now.t_s, heard)
                continue
            cell = self.cells.get(name)
            if cell is None or cell.rat != heard.rat:
                self._take_network(now.t_s, heard.operator)
                self._forget(cell)
                cid, t_s = heard.reading.cid, now.t_s
                cell = HeardCell(
                    heard, name, heard.rat, heard.operator, heard.area, cid, t_s, t_s, t_s
                )
                cell.is_renamed = self._is_renamed(now, heard)
            cell.take(now, heard, ALL_NETWORKS in changed or heard.operator in changed)
            cell.area = heard.area if cell.area is None else cell.area
            self._put(cell)
            taken[name] = cell
        self.taken = list(taken.values())
        serving = now.serving
        self.serving = None if serving is None or serving.name is None else taken[serving.name]

    def _is_renamed(self, now: Moment, heard: Heard) -> bool:
        # the operator has renumbered; one who takes over a channel is stronger
        pair, level_dbm = (heard.reading.arfcn, heard.code), heard.level_dbm
        if level_dbm is None or None in pair:
            return False
        names = [other.name for other in now.cells]
        for cell in self.of_operator(heard.operator, heard.rat):
            if cell.cid != heard.reading.cid or cell.pair != pair or cell.name in names:
                continue
            last = cell.recent[-1] if cell.recent else None
            if last is not None and abs(level_dbm - last.level_dbm) < _TAKES_OVER_DB:
                return _is_near(last, now, _DOOR_M)
        return False

    def _take_walls(self, now: Moment, network: str) -> None:
        # what all levels lose or gain at one place is of the receiver, not of one cell
        if network not in self._beside and len(self._beside) == MOST_NETWORKS:
            return
        before = self._beside.setdefault(network, deque(maxlen=2 * STEADY))
        outdoors = self._outdoors.get(network)
        raised = self._raised.get(network)
        if raised is not None and not _is_brief(raised, now):
            del self._raised[network]
        if before and now.leapt_s > before[-1].leapt_s:
            # nobody knows since when they were displaced
            self._forget_spots(network, lambda _: True)
        if outdoors is not None:
            change_db = _change_db(outdoors, now, network)
            is_out = change_db is not None and change_db >= _OUTDOORS_DB
            if is_out or not _is_near(outdoors, now, _LEFT_M):
                del self._outdoors[network]
                before.clear()
        elif (first := next((m for m in before if _is_near(m, now, _DOOR_M)), None)) is not None:
            change_db = _change_db(first, now, network) or 0.0
            least_db = _INDOORS_DB if network == ALL_NETWORKS else _REPEATER_DB  # walls are of all
            if abs(change_db) >= least_db:
                before.clear()
            if change_db <= -least_db and self._raised.pop(network, None) is None:
                self._outdoors[network] = first
            elif change_db >= least_db:
                self._take_rise(now, network, change_db)
        before.append(now)

    def _take_rise(self, now: Moment, network: str, change_db: float) -> None:
        # the walk began indoors; or a repeater in a car comes, and goes
        if now.x_m is None or now.y_m is None:
            return
        x_m, y_m = now.x_m, now.y_m
        self._forget_spots(network, lambda s: hypot(s.x_m - x_m, s.y_m - y_m) <= _DOOR_M)
        is_more = change_db >= _REPEATER_DB
        if is_more and any(len(cell.spots) for cell in self.cells.values()):
            self._raised[network] = now

    def _forget_spots(self, network: str, is_wrong: Callable[[Spot], bool]) -> None:
        for cell in self.cells.values():
            if network in (ALL_NETWORKS, cell.operator):
                cell.spots.forget(is_wrong)

    def _at_rest(self, now: Moment) -> Moment:
        # a receiver may repeat its position in a train: who stands meets few new cells, and hears
        # some; who hears none is in a lift or a tunnel, or the modem has failed once
        if not now.cells and self.latest and not self.latest[-1].cells:
            self.silent_s = now.t_s
        name = None if now.serving is None else now.serving.name
        if name is not None:
            if name not in self._served:
                self._met_s.append(now.t_s)
            self._served.put(name, None)
        met_s = [t_s for t_s in self._met_s if t_s > now.t_s - min(now.still_s, _LATE_S)]
        moved_s = max(self.silent_s, met_s[-1] if len(met_s) == _MOST_MET else -inf)
        return now._replace(still_s=min(now.still_s, now.t_s - moved_s))

    def of(self, make: Callable[[], State]) -> State:
        """What the rules of a family keep, made by this class or function when first asked for."""
        if make not in self._of:
            self._of[make] = make()
        state: State = self._of[make]
        return state

    def of_operator(self, operator: str, rat: str) -> Collection[HeardCell]:
        """Cells of an operator with one technology, the last heard at the end."""
        return self._by_operator.get((operator, rat), {}).values()

    def are_apart(self, operator: str, before: str) -> bool:
        """Whether a cell of a network says nothing about the one `before`.

        They are other networks and the log is of both from its first minutes; one that comes later
        has to be explained.
        """
        return operator in self._usual and not may_be_same(operator, before)

    def _take_network(self, t_s: float, operator: str) -> None:
        if self._first_s is None:
            self._first_s = t_s
        if t_s - self._first_s < _USUAL_S and len(self._usual) < MOST_NETWORKS:
            self._usual.add(operator)

    def _put(self, cell: HeardCell) -> None:
        """If there are too many cells, those heard longest ago give way."""
        before_s = self.latest[-2].t_s if len(self.latest) > 1 else self.now.t_s
        while cell.name not in self.cells and len(self.cells) >= _OF_LATE:
            oldest = next(iter(self.cells.values()))
            if oldest.last_s >= before_s and len(self.cells) < MOST_CELLS:
                break
            self._forget(oldest)
            del self.cells[oldest.name]
        self.cells.put(cell.name, cell)
        of_operator = self._by_operator.setdefault((cell.operator, cell.rat), {})
        of_operator.pop(cell.name, None)
        of_operator[cell.name] = cell

    def _forget(self, cell: HeardCell | None) -> None:
        if cell is not None:
            of_operator = self._by_operator[cell.operator, cell.rat]
            del of_operator[cell.name]
            if not of_operator:
                del self._by_operator[cell.operator, cell.rat]

    def _take_serving(self, now: Moment) -> None:
        serving = now.serving
        if serving is None:
            return
        if self._serving_rat is not None and serving.rat != self._serving_rat:
            self.changed_rat_s = now.t_s
        self._serving_rat = serving.rat
        if len(now.cells) > 1:
            self.gave_neighbours.add(serving.rat)


def cells_of_scan(memory: Memory) -> list[HeardCell]:
    """The named cells of a scan: whom most rules are about."""
    return memory.taken


def serving_cell(memory: Memory) -> list[HeardCell]:
    """The named cell that serves."""
    return [] if memory.serving is None else [memory.serving]
