"""What a modem knows at one moment: the cells it hears, and where its receiver says it is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Self

from logger.sim.world import Transmitter

NEIGHBOURS = 6
ACCESS_DBM = -105
"""Level from which access is allowed, where the path loss criterion C1 begins to count."""


@dataclass(frozen=True, slots=True)
class Heard:
    """One cell at its level; not decoded means that the modem knows no more than channel and
    level.
    """

    cell: Transmitter
    level_dbm: float
    decoded: bool

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


@dataclass(frozen=True, slots=True)
class Place:
    """A fix of the modem's own receiver."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    utc: datetime
    speed_mps: float
    course_deg: float


@dataclass(frozen=True, slots=True)
class Air:
    """The strongest decoded cell serves; the others follow by level.

    `place` tells where, None without a fix.
    """

    serving: Heard | None
    others: tuple[Heard, ...]
    place: Callable[[], Place | None]

    @classmethod
    def of(cls, heard: Sequence[Heard], place: Callable[[], Place | None] = lambda: None) -> Self:
        by_level = sorted(heard, key=lambda one: one.level_dbm, reverse=True)
        serving = next((one for one in by_level if one.decoded), None)
        return cls(serving, tuple(one for one in by_level if one is not serving), place)

    @property
    def neighbours(self) -> tuple[Heard, ...]:
        """Those that a modem with a serving cell measures."""
        return self.others[:NEIGHBOURS] if self.serving else ()

    @property
    def decoded_neighbours(self) -> tuple[Heard, ...]:
        return tuple(one for one in self.neighbours if one.decoded)

    @property
    def decoded(self) -> tuple[Heard, ...]:
        """All cells that a full scan can name."""
        return (
            ()
            if self.serving is None
            else (self.serving, *(one for one in self.others if one.decoded))
        )
