"""Cells against earlier walks of the same ground: new, stronger than ever, on another channel."""

from collections.abc import Iterator

from logger.core.baseline import Baseline, best_dbm, squares_around
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.heard import STEADY, Heard, HeardCell, Memory, Moment

FEWEST_WALKS = 7
"""Measured: after one walk 11.8 new cells an hour, after seven 1.7."""
_STRONG_DBM = -95.0
"""A cell that is new and weak was too weak before."""
_PLACE_M = 150.0
_ABOVE_BEST_DB = 15.0


class EarlierWalkRules:
    """B1, S4 and P2 by the channels of earlier walks."""

    def __init__(self, baseline: Baseline) -> None:
        self._baseline = baseline

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:  # noqa: ARG002
        """As `FamilyRules`."""
        if not self._baseline.n_walks or now.lat_deg is None or now.lon_deg is None:
            return
        for cell, heard in taken:
            yield from self._is_new(now, cell, heard)
            yield from self._above_best(now, cell)
            yield from self._channel(cell, heard)

    def _is_new(self, now: Moment, cell: HeardCell, heard: Heard) -> Iterator[Broken]:
        """B1: never heard in earlier walks of this ground."""
        if heard.level_dbm is None or heard.level_dbm < _STRONG_DBM or cell.n_scans < STEADY:
            return
        assert now.lat_deg is not None
        assert now.lon_deg is not None
        around = squares_around(self._baseline, now.lat_deg, now.lon_deg, _PLACE_M)
        n_walks = around[0].n_walks.get(cell.rat, 0)
        if n_walks < FEWEST_WALKS or self._baseline.cell(cell.name) is not None:
            return
        yield Broken("B1", cell.name, {"walks": n_walks, "level_dbm": round(heard.level_dbm)})

    def _above_best(self, now: Moment, cell: HeardCell) -> Iterator[Broken]:
        """S4: far stronger than in all earlier walks within 150 m."""
        weakest = cell.weakest_dbm
        if weakest is None or now.lat_deg is None or now.lon_deg is None:
            return
        around = squares_around(self._baseline, now.lat_deg, now.lon_deg, _PLACE_M)
        best = best_dbm(around, cell.name)
        if best is None or around[0].n_walks.get(cell.rat, 0) < FEWEST_WALKS:
            return
        if weakest > best + _ABOVE_BEST_DB:
            yield Broken("S4", cell.name, {"level_dbm": round(weakest), "best_dbm": round(best)})

    def _channel(self, cell: HeardCell, heard: Heard) -> Iterator[Broken]:
        """P2: a channel on which this operator was never heard."""
        mcc, mnc, arfcn = heard.reading.mcc, heard.reading.mnc, heard.reading.arfcn
        if mcc is None or mnc is None or arfcn is None:
            return
        known = self._baseline.channels(mcc, mnc, cell.rat)
        if sum(known.values()) >= 10 and arfcn not in known:
            yield Broken("P2", cell.name, {"channel": arfcn, "channels": len(known)})
