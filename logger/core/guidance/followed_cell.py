"""The cell that is followed: its posterior, the verdict, and the way to walk next."""

import numpy as np

from logger.core.answer import Answer, MultiPolygon, Provenance, answer_of
from logger.core.geo import Utm
from logger.core.guidance.advice import Advice, Guide
from logger.core.guidance.live_verdict import LiveVerdict
from logger.core.guidance.map_form import next_way, squares_of_region
from logger.core.guidance.next_way import NextWay
from logger.core.guidance.street_map import StreetMap
from logger.core.locator.online import OnlineLocator
from logger.core.locator.summary import summarise
from logger.core.observations import CellObservations


class FollowedCell:
    """Answer and advice for one `cell`, renewed as the walker moves.

    `region` is that of the answer; both are None before the first search. `way` is the advice.
    """

    def __init__(self, cell: str, utm: Utm, streets: StreetMap | None = None) -> None:
        self.cell, self.utm = cell, utm
        self._guide = Guide(streets)
        self._verdict = LiveVerdict()
        self.answer: Answer | None = None
        self.region: MultiPolygon | None = None
        self.way: NextWay | None = None

    @property
    def advice(self) -> Advice | None:
        """The latest advice."""
        return self._guide.advice

    def update(self, x_m: float, y_m: float, locator: OnlineLocator) -> bool:
        """Take a position of the walker; where a new plan is due, ask the cell's locator.

        Returns whether answer and advice are new.
        """
        self._guide.walk(x_m, y_m)
        last = locator.last_search() if self._guide.is_due else None
        if last is None:
            return False
        posterior = summarise(*last)
        obs = observations_of(locator, self.utm)
        verdict, reasons, _ = self._verdict.update(posterior, obs)
        made_from = Provenance(len(obs))
        self.region = squares_of_region(posterior, self.utm)
        self.answer = answer_of(self.cell, verdict, reasons, made_from, posterior, self.utm)
        self._guide.decide(*last)
        self.way = next_way(self.utm, self._guide.advice)
        return True


def observations_of(locator: OnlineLocator, utm: Utm) -> CellObservations:
    """The readings of a locator in their order."""
    x_m, y_m, sigma_m, level_dbm, limit = locator.readings.columns()
    number = np.arange(len(x_m))
    return CellObservations(
        cell="",
        rat=None,
        utm=utm,
        t_ns=number,
        x_m=x_m,
        y_m=y_m,
        position_sigma_m=sigma_m,
        level_dbm=level_dbm,
        scan_seq=number,
        known_limit=limit.astype(np.int64),
        without_spikes=True,
    )
