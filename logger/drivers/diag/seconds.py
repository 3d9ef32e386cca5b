"""One reading a second and cell of the levels that the diagnostic stream has many times a second.

Levels 40 ms apart are of one moment of the channel: as readings of their own they would count the
same evidence again. The reading is their median; their scatter and number stand beside it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import fsum, sqrt
from statistics import median
from typing import Any

from logger.core.cell_names import CODES, Identity
from logger.core.types import Broadcast, CellReading, Rat, Role
from logger.drivers.diag.levels import STAYS_NS, Observation

_SECOND_NS = 10**9
_MOST_LEVELS, _MOST_CELLS = 1000, 128
"""Of one second: a modem has 100 and 20."""

_Cell = tuple[Rat, int, int | None]
_LEVEL: Mapping[Rat, str] = {"GSM": "rssi_dbm", "WCDMA": "rscp_dbm", "LTE": "rsrp_dbm"}


@dataclass(frozen=True, slots=True)
class Second:
    """Readings of one receiver in a second of the modem's clock, at the middle of its records."""

    time_ns: int
    radio_id: int
    readings: tuple[CellReading, ...]


@dataclass(slots=True)
class _Heard:
    role: Role = "neighbour"
    identity: Identity | None = None
    levels_dbm: list[float] = field(default_factory=list)
    reported_dbm: list[float] = field(default_factory=list)
    ta_16ts: int | None = None
    neighbours: tuple[int, ...] | None = None

    def take(self, one: Observation) -> None:
        self.role = "serving" if "serving" in {self.role, one.role} else "neighbour"
        self.identity = one.identity or self.identity
        self.neighbours = self.neighbours if one.neighbours is None else one.neighbours
        self.ta_16ts = self.ta_16ts if one.ta_16ts is None else one.ta_16ts
        levels_dbm = self.reported_dbm if one.is_reported else self.levels_dbm
        if one.level_dbm is not None and len(levels_dbm) < _MOST_LEVELS:
            levels_dbm.append(one.level_dbm)

    def reading(self, cell: _Cell) -> CellReading:
        rat, channel, code = cell
        levels_dbm = self.levels_dbm or self.reported_dbm
        values: dict[str, Any] = {CODES[rat]: code}
        if levels_dbm:
            values[_LEVEL[rat]] = median(levels_dbm)
        if self.identity:
            mcc, mnc, area, cid = self.identity
            values |= {"mcc": mcc, "mnc": mnc, "tac" if rat == "LTE" else "lac": area, "cid": cid}
        if self.neighbours is not None:
            values["broadcast"] = Broadcast(self.neighbours)
        return CellReading(
            self.role,
            rat,
            arfcn=channel,
            ta_16ts=self.ta_16ts,
            level_sd_db=_sd_db(levels_dbm),
            n_levels=len(levels_dbm) or None,
            **values,
        )


class Seconds:
    """Readings of observations in their order; a clock that jumps begins a new second.

    A serving cell keeps its identity for as long as it is heard serving.
    """

    def __init__(self) -> None:
        # by receiver: its unfinished seconds, and who serves it, until when
        self._open: dict[int, dict[int, tuple[list[int], dict[_Cell, _Heard]]]] = {}
        self._serving: dict[tuple[int, Rat], tuple[_Cell, Identity, int]] = {}

    def feed(self, one: Observation) -> list[Second]:
        """Seconds that are complete with this observation."""
        if one.channel is None:
            return []
        second = one.time_ns // _SECOND_NS
        seconds = self._open.setdefault(one.radio_id, {})
        late = [other for other in seconds if not second - 1 <= other <= second + 1]
        complete = [self._close(one.radio_id, other) for other in late]
        times_ns, cells = seconds.setdefault(second, ([], {}))
        cell = one.rat, one.channel, one.code
        if len(cells) < _MOST_CELLS and len(times_ns) < _MOST_LEVELS * _MOST_CELLS:
            times_ns.append(one.time_ns)
            if (heard := cells.get(cell)) is None:
                heard = cells[cell] = _Heard()
            heard.take(self._with_identity(one, cell))
        return [closed for closed in complete if closed is not None]

    def end(self) -> list[Second]:
        """The seconds that are left."""
        left = [(radio_id, second) for radio_id, all_ in self._open.items() for second in all_]
        return [closed for one in left if (closed := self._close(*one)) is not None]

    def _with_identity(self, one: Observation, cell: _Cell) -> Observation:
        if one.role != "serving":
            return one
        key = one.radio_id, one.rat
        identity = one.identity
        if identity is None and key in self._serving:
            last, known, time_ns = self._serving.pop(key)
            if last == cell and abs(one.time_ns - time_ns) <= STAYS_NS:
                identity = known
        if identity is not None:
            self._serving[key] = cell, identity, one.time_ns
        return one if identity is one.identity else one._replace(identity=identity)

    def _close(self, radio_id: int, second: int) -> Second | None:
        times_ns, cells = self._open[radio_id].pop(second)
        every = [heard.reading(cell) for cell, heard in cells.items()]
        readings = tuple(r for r in every if r.n_levels or r.cell or r.ta_16ts is not None)
        return Second(int(median(times_ns)), radio_id, readings) if readings else None


def _sd_db(levels_dbm: list[float]) -> float | None:
    n = len(levels_dbm)
    mean_dbm = fsum(levels_dbm) / max(n, 1)
    squares = fsum((one - mean_dbm) ** 2 for one in levels_dbm)
    return sqrt(squares / (n - 1)) if n > 1 else None
