"""What the rules see: the cells of one scan at one place, and what was heard before."""

from collections import deque
from dataclasses import dataclass, field
from math import cos, hypot, radians
from typing import NamedTuple

from logger.core.latest import Latest
from logger.core.suspicion.spots import Spots
from logger.core.types import Broadcast, CellReading, Fix, Scan

GAP_S = 15.0
"""A cell that is not reported for longer is not held: modems print a list every 1 to 10 s."""
_MOST_CELLS = 128
_MOST_PAIRS = 4
PAIR_HELD_S = 10.0
"""Telephones print the old identity with the new channel for some seconds after a handover."""
_LOWEST_DBM = -145.0
"""Below the scale of RSRP (-144 dBm, 3GPP TS 36.133 9.1.4): some telephones print -200 for none."""
_METRES_PER_DEG = 111_320.0
_NO_AREA = frozenset({0, 0xFFFE, 0xFFFF})
"""Area codes of a cell that is not registered with (3GPP TS 23.003 4.1)."""


class Heard(NamedTuple):
    """One cell of a scan; `operator` is `mcc-mnc`, `code` BSIC, PSC or PCI, None is unknown."""

    name: str | None
    reading: CellReading
    rat: str
    operator: str
    area: int | None
    code: int | None
    level_dbm: float | None

    @property
    def broadcast(self) -> Broadcast | None:
        """What the cell broadcasts, once the modem has printed it twice."""
        broadcast = self.reading.broadcast
        return None if broadcast is None or broadcast.broadcast_unsure else broadcast

    @property
    def is_serving(self) -> bool:
        return self.reading.role == "serving"


def heard_of(reading: CellReading) -> Heard:
    """A reading as the rules see it; a doubtful identity is no identity."""
    area = reading.tac if reading.lac is None else reading.lac
    code = next((c for c in (reading.bsic, reading.psc, reading.pci) if c is not None), None)
    return Heard(
        None if reading.identity_unsure or reading.cid is None else reading.cell,
        reading,
        reading.rat or "",
        f"{reading.mcc or '?'}-{reading.mnc or '?'}",
        None if area in _NO_AREA else area,
        code,
        _level_dbm(reading),
    )


def _level_dbm(reading: CellReading) -> float | None:
    """Level, None for what no receiver measures."""
    level_dbm = reading.level_dbm
    return level_dbm if level_dbm is not None and level_dbm > _LOWEST_DBM else None


class Level(NamedTuple):
    """A level of late, with time and place (metres, None if unknown)."""

    t_s: float
    level_dbm: float
    x_m: float | None
    y_m: float | None


@dataclass(slots=True)
class HeardCell:
    """Memory of one cell. `since_s` is when the present uninterrupted reception began."""

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
    pair: tuple[int, int] | None = None
    pair_last_s: float = 0.0
    held_s: dict[tuple[int, int], float] = field(default_factory=dict)
    spots: Spots = field(default_factory=Spots)
    recent: deque[Level] = field(default_factory=lambda: deque(maxlen=6))
    rings: list[tuple[float, float, int]] = field(default_factory=list)
    longest_s: float = 0.0

    def take(self, now: "Moment", heard: Heard) -> None:
        """Remember a reading."""
        if now.t_s - self.last_s > GAP_S:
            self.since_s = now.t_s
        self.last_s = now.t_s
        self.longest_s = max(self.longest_s, now.t_s - self.since_s)
        self.n_scans += 1
        pair = heard.reading.arfcn, heard.code
        if pair[0] is not None and pair[1] is not None:
            self._take_pair(now.t_s, (pair[0], pair[1]))
        if heard.level_dbm is not None:
            self._take_level(now, heard.level_dbm)

    def _take_pair(self, t_s: float, pair: tuple[int, int]) -> None:
        """Channel and colour code; held for a while, as after a handover they are mixed."""
        if pair != self.pair or self.since_s > self.pair_last_s:
            self.pair, self.pair_last_s = pair, t_s
        if pair in self.held_s or len(self.held_s) < _MOST_PAIRS:
            self.held_s[pair] = self.held_s.get(pair, 0.0) + t_s - self.pair_last_s
        self.pair_last_s = t_s

    @property
    def usual_pair(self) -> tuple[int, int] | None:
        """Channel and colour code it had for longest, at least `PAIR_HELD_S`."""
        pair = max(self.held_s, key=lambda pair: self.held_s[pair], default=None)
        return None if pair is None or self.held_s[pair] < PAIR_HELD_S else pair

    @property
    def held_channels(self) -> list[int]:
        """Channels it had for at least `PAIR_HELD_S`, in their order."""
        held = [pair[0] for pair, held_s in self.held_s.items() if held_s >= PAIR_HELD_S]
        return list(dict.fromkeys(held))

    def _take_level(self, now: "Moment", level_dbm: float) -> None:
        self.best_dbm = max(self.best_dbm, level_dbm)
        self.recent.append(Level(now.t_s, level_dbm, now.x_m, now.y_m))
        if now.x_m is not None and now.y_m is not None:
            self.spots.add(now.x_m, now.y_m, level_dbm, now.t_s)


class Moment(NamedTuple):
    """One scan: time in seconds since boot, place, and its cells, each once.

    `x_m, y_m` are east and north of the first fix; `still_s` how long the walker has stood here.
    """

    t_ns: int
    t_s: float
    lat_deg: float | None
    lon_deg: float | None
    x_m: float | None
    y_m: float | None
    still_s: float
    cells: tuple[Heard, ...]

    @property
    def identities(self) -> tuple[Heard, ...]:
        return tuple(heard for heard in self.cells if heard.name is not None)

    @property
    def serving(self) -> Heard | None:
        return next((heard for heard in self.cells if heard.is_serving), None)


class Walker:
    """Place of the receiver in metres from its first fix, and how long it has been there."""

    STILL_M = 30.0
    """Positions of a standing receiver in a street scatter by this much."""

    def __init__(self, max_fix_age_s: float) -> None:
        self._max_age_s = max_fix_age_s
        self._origin: tuple[float, float] | None = None
        self._last: tuple[float, float, float] | None = None
        self._still = (0.0, 0.0, 0.0)

    def add(self, t_s: float, fix: Fix) -> None:
        """Take a fix; one without a position ends the validity of the last."""
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
        cells = tuple(heard_of(reading) for reading in scan.readings)
        if self._last is None or t_s - self._last[0] > self._max_age_s:
            return Moment(t_ns, t_s, None, None, None, None, 0.0, cells)
        _, lat_deg, lon_deg = self._last
        x_m, y_m = self._to_metres(lat_deg, lon_deg)
        return Moment(t_ns, t_s, lat_deg, lon_deg, x_m, y_m, t_s - self._still[0], cells)

    def _to_metres(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        lat0_deg, lon0_deg = self._origin or (lat_deg, lon_deg)
        turn_deg = (lon_deg - lon0_deg + 180.0) % 360.0 - 180.0
        x_m = turn_deg * _METRES_PER_DEG * cos(radians(lat0_deg))
        return x_m, (lat_deg - lat0_deg) * _METRES_PER_DEG


class Memory:
    """All cells of the run of late; `foreign` are those whose network is not of this place."""

    def __init__(self) -> None:
        self.cells: Latest[HeardCell] = Latest(_MOST_CELLS)
        self.gave_neighbours: set[str] = set()
        self.foreign: Latest[None] = Latest(_MOST_CELLS)
        self.changed_rat_s = -1e9
        self._serving_rat: str | None = None
        self._by_operator: dict[tuple[str, str], list[HeardCell]] = {}

    def take(self, now: Moment) -> list[tuple[HeardCell, Heard]]:
        """Remember a scan; returns its named cells with their memory, each once."""
        self._take_serving(now)
        self._by_operator = {}
        taken: dict[str, tuple[HeardCell, Heard]] = {}
        for heard in now.identities:
            name = heard.name
            if name is None or name in taken:
                continue
            cell = self.cells.get(name)
            if cell is None or cell.rat != heard.rat:
                cell = _new(name, heard, now.t_s)
            cell.take(now, heard)
            cell.area = heard.area if cell.area is None else cell.area
            self.cells.put(name, cell)
            taken[name] = cell, heard
        return list(taken.values())

    def of_operator(self, operator: str, rat: str) -> list[HeardCell]:
        """Cells of an operator with one technology."""
        if not self._by_operator:
            for cell in self.cells.values():
                self._by_operator.setdefault((cell.operator, cell.rat), []).append(cell)
        return self._by_operator.get((operator, rat), [])

    def _take_serving(self, now: Moment) -> None:
        serving = now.serving
        if serving is None:
            return
        if self._serving_rat is not None and serving.rat != self._serving_rat:
            self.changed_rat_s = now.t_s
        self._serving_rat = serving.rat
        if len(now.cells) > 1:
            self.gave_neighbours.add(serving.rat)


def _new(name: str, heard: Heard, t_s: float) -> HeardCell:
    cid = heard.reading.cid
    return HeardCell(name, heard.rat, heard.operator, heard.area, cid, t_s, t_s, t_s)
