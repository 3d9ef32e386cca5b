"""The place of a station by its levels: one identity at two places, or at none."""

from collections.abc import Iterator

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import HeardCell, Memory, Moment
from logger.core.suspicion.sources import compare_sources

_TEST_EVERY = 4
"""New squares between two tests of the place, and a quarter of those before."""
_FEWEST_SPOTS = 6
_TWO_PLACES = 3.5
_PERHAPS_TWO = 1.5
_NO_PLACE = 9.0
"""Log evidence from which it is a finding; tuned on the legitimate logs."""


class PlaceRules:
    """S5, S6 and S9."""

    def __init__(self) -> None:
        self._due: Latest[int] = Latest(128)

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:  # noqa: ARG002
        """As `FamilyRules`."""
        for cell, _ in taken:
            if cell.spots.n >= self._due.get(cell.name, _FEWEST_SPOTS):
                yield from self._places(cell)

    def _places(self, cell: HeardCell) -> Iterator[Broken]:
        """S5, S6 and S9: one identity at two places, or a moving one."""
        if len(cell.spots) < _FEWEST_SPOTS:
            return
        n = cell.spots.n
        self._due.put(cell.name, n + max(_TEST_EVERY, n // 4))
        result = compare_sources(list(cell.spots))
        if result is None:
            return
        evidence: Evidence = {
            "log_evidence": round(result.two_places, 1),
            "apart_m": round(result.apart_m),
            "squares": len(cell.spots),
        }
        if result.two_places >= _PERHAPS_TWO:
            yield Broken("S9", cell.name, evidence)
        if result.two_places >= _TWO_PLACES:
            yield Broken("S5", cell.name, evidence)
        if result.no_place > _NO_PLACE:
            evidence = {**evidence, "log_evidence": round(result.no_place, 1)}
            yield Broken("S6", cell.name, evidence)
