"""The place of a station by its levels: one identity at two places, or at none."""

from collections.abc import Iterator

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import HeardCell, Memory, Moment
from logger.core.suspicion.sources import LEAST_EVIDENCE, compare_sources

_TEST_AGAIN = 0.1
"""New squares until the next test, at least one, as a share of those before. A clone may stop
to show once the coarser squares of a long walk drop what was heard between its two places."""
_FEWEST_SPOTS = 6
_PERHAPS_TWO = 2.0
"""Log evidence for two places from which S9 is a finding; few squares of one cell reach 1.5."""
_TWO_PLACES, _TWO_FAR_PLACES = 3.5, LEAST_EVIDENCE
_FAR_M = 500.0
"""Log evidence for two places from which S5 is a finding, and the lower one for places this far
apart. Hills, reflections and side lobes of one antenna make places 300 to 450 m apart: of the
legitimate cells 1 reaches 3.3 there, and 1 the lower one farther apart, where no other has more
than 1.2, and those of simulated cities have no more than 1.4."""
_NO_PLACE = 9.0
"""Log evidence from which S6 is a finding; tuned on the legitimate logs."""


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
        self._due.put(cell.name, n + max(1, int(_TEST_AGAIN * n)))
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
        limit = _TWO_FAR_PLACES if result.apart_m >= _FAR_M else _TWO_PLACES
        if result.two_places >= limit:
            yield Broken("S5", cell.name, evidence)
        if result.no_place > _NO_PLACE:
            evidence = {**evidence, "log_evidence": round(result.no_place, 1)}
            yield Broken("S6", cell.name, evidence)
