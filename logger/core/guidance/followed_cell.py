"""The cell that is followed: its posterior, the verdict, and the way to walk next."""

from logger.core.answer import Answer, MultiPolygon, Provenance, answer_of
from logger.core.guidance.advice import Advice, Guide
from logger.core.guidance.live_verdict import LiveVerdict
from logger.core.guidance.map_form import next_way, squares_of_region
from logger.core.guidance.next_way import NextWay
from logger.core.guidance.street_map import StreetMap
from logger.core.locator.online import OnlineLocator
from logger.core.locator.summary import summarise
from logger.core.places import Places


class FollowedCell:
    """Answer and advice for one `cell`, renewed as the walker moves.

    `region` is that of the answer; both are None before the first search. `way` is the advice.
    """

    def __init__(self, cell: str, streets: StreetMap | None = None) -> None:
        self.cell = cell
        self._guide = Guide(streets)
        self._verdict = LiveVerdict()
        self.answer: Answer | None = None
        self.region: MultiPolygon | None = None
        self.way: NextWay | None = None

    @property
    def advice(self) -> Advice | None:
        """The latest advice."""
        return self._guide.advice

    def update(self, here: Places, locator: OnlineLocator) -> bool:
        """Take a place of the walker; where a new plan is due, ask the cell's locator.

        Returns whether answer and advice are new.
        """
        self._guide.walk(here)
        last = locator.last_search() if self._guide.is_due else None
        if last is None:
            return False
        obs = locator.readings.readings()
        (verdict, reasons, *_), posterior = self._verdict.update(summarise(*last), obs)
        made_from = Provenance(len(obs))
        self.region = squares_of_region(posterior)
        self.answer = answer_of(self.cell, verdict, reasons, made_from, posterior)
        self._guide.decide(*last)
        self.way = next_way(self._guide.advice)
        return True
