"""The cell that is followed: its posterior, the verdict, and the way to walk next."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from logger.core.geo import Utm
from logger.core.guidance.advice import Advice, Guide
from logger.core.guidance.street_map import StreetMap
from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import Tree
from logger.core.locator.summary import summarise
from logger.core.locator.two_source_test import LIVE, Division, divide
from logger.core.locator.verdict import LIVE_M, Decision, assess
from logger.core.observations import CellObservations

Search = Callable[[], tuple[LocatorInput, Tree] | None]


_DIVIDED_EVERY = 8
"""Two transmitters are tried every 200 m: that takes as long as all plans on the way."""


class LivePosition(NamedTuple):
    """What is known of the position now, and the verdict for `LIVE_M`."""

    posterior: Posterior
    decision: Decision


class FollowedCell:
    """Position and advice for one `cell`, renewed as the walker moves."""

    def __init__(self, cell: str, utm: Utm, streets: StreetMap | None = None) -> None:
        self.cell, self.utm = cell, utm
        self._guide = Guide(streets)
        self._updates = 0
        self._division: Division | None = None
        self.position: LivePosition | None = None

    @property
    def advice(self) -> Advice | None:
        """The latest advice."""
        return self._guide.advice

    def update(self, x_m: float, y_m: float, searched: Search) -> bool:
        """Take a position of the walker; `searched` is asked where a new plan is due.

        Returns whether position and advice are new.
        """
        self._guide.walk(x_m, y_m)
        found = searched() if self._guide.is_due else None
        if found is None:
            return False
        self.position = self._position(*found)
        self._guide.decide(*found)
        return True

    def _position(self, task: LocatorInput, tree: Tree) -> LivePosition:
        posterior = summarise(task, tree)
        obs = _observations(task, self.utm)
        decision = assess(posterior, obs, self._division, within_m=LIVE_M)
        if self._is_division_due(decision):
            self._division = divide(obs, posterior, LIVE)
            decision = assess(posterior, obs, self._division, within_m=LIVE_M)
        self._updates += 1
        return LivePosition(posterior, decision)

    def _is_division_due(self, decision: Decision) -> bool:
        """Whether two transmitters are to be tried: now and then, and before it is located."""
        was_located = self.position is not None and self.position.decision.verdict == "located"
        is_new = decision.verdict == "located" and not was_located
        return is_new or self._updates % _DIVIDED_EVERY == 0


def _observations(task: LocatorInput, utm: Utm) -> CellObservations:
    """The blocks of a walk as readings, which is what the verdict asks for."""
    walk = task.walk.blocks
    number = np.arange(len(walk))
    return CellObservations(
        cell="",
        rat=None,
        utm=utm,
        t_ns=number,
        x_m=walk.x_m,
        y_m=walk.y_m,
        position_sigma_m=walk.position_sigma_m,
        level_dbm=walk.level_dbm + task.mean_dbm,
        scan_seq=number,
        known_limit=np.zeros(len(walk), np.int64),
        without_spikes=True,
    )
