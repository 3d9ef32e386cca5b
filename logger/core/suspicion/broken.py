"""What a family of rules returns, and what it may ask."""

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Heard, HeardCell, Memory, Moment

Taken = list[tuple[HeardCell, Heard]]


class Broken(NamedTuple):
    """A rule that a cell broke, with the evidence."""

    rule: str
    cell: str
    evidence: Evidence


class FamilyRules(Protocol):
    """Rules of one family; they keep what they need of earlier scans."""

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """Rules broken in a scan; `taken` are its named cells, already remembered."""
