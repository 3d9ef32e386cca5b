"""What a modem receives at one moment: its cells, and the fix of its receiver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Self

from logger.core.types import Broadcast
from logger.sim.world import Transmitter

NEIGHBOURS = 6
SUBTRACTED = 31
"""Penalty time with which the offset of a cell lowers C2 (3GPP TS 45.008 6.4)."""
ACCESS_DBM = -105
"""Level from which access is allowed, where the path loss criterion C1 begins to count."""


@dataclass(frozen=True, slots=True)
class ReceivedCell:
    """One cell at its level; of one that is not decoded only channel and level are known."""

    cell: Transmitter
    level_dbm: float
    is_decoded: bool

    @property
    def rxlev(self) -> int:
        """Index of the level, 0 below -110 dBm to 63 (3GPP TS 45.008 8.1.4)."""
        return min(max(round(self.level_dbm) + 111, 0), 63)

    @property
    def dbm(self) -> int:
        return round(self.level_dbm)

    @property
    def c1(self) -> int:
        """Path loss criterion: the level above that from which access is allowed."""
        return self.dbm - ACCESS_DBM

    @property
    def c2(self) -> int:
        """Reselection criterion: C1 and the offset of the cell, once its penalty time is over."""
        broadcast = self.cell.broadcast or Broadcast()
        offset_db = broadcast.cro_db or 0
        return self.c1 - offset_db if broadcast.penalty_time == SUBTRACTED else self.c1 + offset_db


@dataclass(frozen=True, slots=True)
class ModemFix:
    """A fix of the modem's GNSS receiver."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    utc: datetime
    speed_mps: float
    course_deg: float


@dataclass(frozen=True, slots=True)
class Air:
    """The strongest decoded cell serves, its offset included; the others follow by level.

    `fix` gives the position, None without one.
    """

    serving: ReceivedCell | None
    others: tuple[ReceivedCell, ...]
    fix: Callable[[], ModemFix | None]

    @classmethod
    def of(
        cls, cells: Sequence[ReceivedCell], fix: Callable[[], ModemFix | None] = lambda: None
    ) -> Self:
        by_level = sorted(cells, key=lambda one: one.level_dbm, reverse=True)
        decoded = [one for one in by_level if one.is_decoded]
        serving = max(decoded, key=_attraction_dbm, default=None)
        return cls(serving, tuple(one for one in by_level if one is not serving), fix)

    @property
    def neighbours(self) -> tuple[ReceivedCell, ...]:
        """Those that a modem measures: on the channels that its serving cell lists, if it does."""
        if self.serving is None:
            return ()
        broadcast = self.serving.cell.broadcast or Broadcast()
        listed = broadcast.neighbour_arfcns
        others = [one for one in self.others if listed is None or one.cell.arfcn in listed]
        return tuple(others[:NEIGHBOURS])

    @property
    def decoded_neighbours(self) -> tuple[ReceivedCell, ...]:
        return tuple(one for one in self.neighbours if one.is_decoded)

    @property
    def decoded_cells(self) -> tuple[ReceivedCell, ...]:
        """All cells that a full scan can name."""
        return (
            ()
            if self.serving is None
            else (self.serving, *(one for one in self.others if one.is_decoded))
        )


def _attraction_dbm(one: ReceivedCell) -> float:
    """Level with the offset that raises C2; one that lowers it is for a moving telephone."""
    return one.level_dbm + max(one.c2 - one.c1, 0)
