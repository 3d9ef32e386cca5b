"""What a rule is and what it finds."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from typing import Literal

Word = Literal["nothing unusual", "unusual", "suspicious"]
WORDS: tuple[Word, ...] = ("nothing unusual", "unusual", "suspicious")

Family = Literal[
    "plan", "area", "neighbours", "signal", "place", "timing", "broadcast", "technology",
    "earlier walks",
]  # fmt: skip
Need = Literal[
    "position", "country code", "identity", "area code", "channel", "colour code", "level",
    "neighbours", "neighbour lists", "timing advance", "C1 and C2",
    "second technology", "earlier walks", "cell database",
]  # fmt: skip
Value = float | int | str
Evidence = Mapping[str, Value]

_NONE_SEEN = 3.0
"""Without an alarm among n cells, the rate is below 3/n with 95 % probability."""


@dataclass(frozen=True, slots=True)
class Rate:
    """Legitimate cells that a rule accused, of those it was applied to, and where."""

    alarms: int
    cells: int
    where: str

    @property
    def per_cell(self) -> float:
        """Share of cells; its upper bound (95 %) if there was no alarm."""
        return min((self.alarms or _NONE_SEEN) / self.cells, 1.0)


@dataclass(frozen=True, slots=True)
class HourRate:
    """Legitimate cells that earned a word, in so many hours."""

    alarms: int
    hours: float

    @property
    def per_hour(self) -> float:
        """Alarms an hour; the upper bound (95 %) if there was none."""
        return (self.alarms or _NONE_SEEN) / self.hours


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of the table.

    It is applied where a modem serves all of its `needs`, to the technologies `rats`. `sentence` is
    filled with the evidence. `detection` is the share of rogue cells of the kind it aims at that
    are assumed to show it; `measured` has the rate on legitimate logs by technology, `elsewhere`
    that of other logs, for technologies with too few cells. A rule with `only_warns` has no weight.
    """

    id: str
    family: Family
    needs: frozenset[Need]
    rats: frozenset[str]
    gate: str
    sentence: str
    innocent: str
    detection: float
    elsewhere: Rate
    only_warns: bool = False

    def nats(self, rate: Rate) -> float:
        """Log likelihood ratio of a finding; never below 0."""
        return 0.0 if self.only_warns else max(log(self.detection / rate.per_cell), 0.0)


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule that a cell broke: when, where (degrees, WGS 84), and the evidence as numbers."""

    rule: str
    family: Family
    cell: str
    t_ns: int
    lat_deg: float | None
    lon_deg: float | None
    text: str
    evidence: Evidence
    nats: float
