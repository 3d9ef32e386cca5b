"""Cells against earlier walks of the same ground: new, stronger than ever, on another channel."""

from collections.abc import Iterator

from logger.core.baseline import Baseline, SquareHistory, best_dbm, squares_around
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.heard import STEADY, Heard, HeardCell, Memory, Moment

FEWEST_WALKS = 7
"""Measured: after one walk 11.8 new cells an hour, after seven 1.7."""
_STRONG_DBM = -95.0
"""A cell that is new and weak was too weak before."""
_PLACE_M = 150.0
_ABOVE_BEST_DB = 15.0
_FEWEST_CELLS = 10
"""Of an operator, from which on its channels are known."""


class EarlierWalkRules:
    """B1, S4 and P2 by the channels of earlier walks."""

    def __init__(self, baseline: Baseline) -> None:
        self._baseline = baseline

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:  # noqa: ARG002
        """As `FamilyRules`."""
        if not self._baseline.n_walks or now.lat_deg is None or now.lon_deg is None:
            return
        around = squares_around(self._baseline, now.lat_deg, now.lon_deg, _PLACE_M)
        for cell, heard in taken:
            if around[0].n_walks.get(cell.rat, 0) >= FEWEST_WALKS:
                yield from self._is_new(around[0], cell, heard)
                yield from _above_best(around, cell)
            yield from self._channel(cell, heard)

    def _is_new(self, here: SquareHistory, cell: HeardCell, heard: Heard) -> Iterator[Broken]:
        """B1: never heard in earlier walks of this ground."""
        if heard.level_dbm is None or heard.level_dbm < _STRONG_DBM or cell.n_scans < STEADY:
            return
        if self._baseline.cell(cell.name) is None:
            n_walks = here.n_walks[cell.rat]
            yield Broken("B1", cell.name, {"walks": n_walks, "level_dbm": round(heard.level_dbm)})

    def _channel(self, cell: HeardCell, heard: Heard) -> Iterator[Broken]:
        """P2: a channel on which this operator was never heard."""
        mcc, mnc, arfcn = heard.reading.mcc, heard.reading.mnc, heard.reading.arfcn
        if mcc is None or mnc is None or arfcn is None:
            return
        known = self._baseline.channels(mcc, mnc, cell.rat)
        if arfcn not in known and sum(known.values()) >= _FEWEST_CELLS:
            yield Broken("P2", cell.name, {"channel": arfcn, "channels": len(known)})


def _above_best(around: tuple[SquareHistory, ...], cell: HeardCell) -> Iterator[Broken]:
    """S4: far stronger than in all earlier walks within 150 m."""
    weakest = cell.weakest_dbm
    best = best_dbm(around, cell.name)
    if weakest is not None and best is not None and weakest > best + _ABOVE_BEST_DB:
        yield Broken("S4", cell.name, {"level_dbm": round(weakest), "best_dbm": round(best)})
