"""Cells that earlier walks always heard on this ground, and that today's scans do not name."""

from collections.abc import Iterator
from math import hypot
from statistics import median

from logger.core.baseline import Baseline, SquareHistory
from logger.core.latest import Latest
from logger.core.squares import square_of
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.earlier_walks import FEWEST_WALKS
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Memory, Moment
from logger.core.suspicion.signal import FULL_LIST

GONE = "B3"
_SHARE_OF_WALKS = 0.9
"""One walk in ten may pass a square at its edge."""
_MARGIN_DB = 15.0
"""Two standard deviations of shadowing: below, a legitimate cell may be missed by chance."""
_FEWEST_PLACES = 3
"""One or two may be behind the same house."""
_APART_M = 50.0
"""Shadowing by houses is nearly independent over this distance."""
_MOST_CELLS = 128
"""As of a walk; those heard longest ago give way."""
_FEWEST_COMMON = 3
"""Cells of both today and earlier whose levels show that today's antenna is as good."""


class _Visit:
    """What full lists of one technology named in one square today.

    `limits_dbm` has the weakest level that a list named, by place; places are `_APART_M` apart.
    `unnamed_channels` are those of cells whose identity was not printed.
    """

    def __init__(self, square: int) -> None:
        self.square = square
        self.limits_dbm: dict[tuple[float, float], float] = {}
        self.unnamed_channels: set[int] = set()
        self._sums: Latest[tuple[int, float]] = Latest(_MOST_CELLS)

    def add(self, x_m: float, y_m: float, levels_dbm: dict[str, float]) -> None:
        """Take the levels of one list, by cell."""
        places = self.limits_dbm
        near = [at for at in places if hypot(at[0] - x_m, at[1] - y_m) < _APART_M]
        at = near[0] if near else (x_m, y_m)
        places[at] = min(places.get(at, 0.0), *levels_dbm.values())
        for cell, level_dbm in levels_dbm.items():
            n, sum_dbm = self._sums.get(cell, (0, 0.0))
            self._sums.put(cell, (n + 1, sum_dbm + level_dbm))

    def weaker_db(self, earlier: SquareHistory) -> float | None:
        """By how much today's levels are below earlier ones; None without cells of both."""
        both = [
            earlier.cells[cell].mean_dbm - sum_dbm / n
            for cell, (n, sum_dbm) in self._sums.items()
            if cell in earlier.cells
        ]
        return max(median(both), 0.0) if len(both) >= _FEWEST_COMMON else None


class GoneCellRule:
    """B3: a warning, as no log of legitimate networks has measured its rate."""

    def __init__(self, baseline: Baseline) -> None:
        self._baseline = baseline
        self._visits: dict[str, _Visit] = {}

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        if not self._baseline.n_walks or now.lat_deg is None or now.lon_deg is None:
            return
        assert now.x_m is not None
        assert now.y_m is not None
        square = square_of(now.lat_deg, now.lon_deg)
        for rat, levels_dbm in _full_lists(taken).items():
            visit = self._visits.get(rat)
            if visit is None or visit.square != square:
                visit = self._visits[rat] = _Visit(square)
            visit.add(now.x_m, now.y_m, levels_dbm)
            visit.unnamed_channels |= _unnamed_channels(now, rat)
            if len(visit.limits_dbm) >= _FEWEST_PLACES:
                yield from self._missed_cells(rat, visit, memory)

    def _missed_cells(self, rat: str, visit: _Visit, memory: Memory) -> Iterator[Broken]:
        """Cells that the places of a visit could not have missed."""
        earlier = self._baseline.square(visit.square)
        n_walks = earlier.n_walks.get(rat, 0)
        weaker_db = visit.weaker_db(earlier)
        if n_walks < FEWEST_WALKS or weaker_db is None:
            return
        for name, heard in earlier.cells.items():
            usual_dbm = min(heard.mean_dbm, heard.least_best_dbm)  # each walk had the latter
            lowest_dbm = usual_dbm - weaker_db - _MARGIN_DB
            limits_dbm = [limit for limit in visit.limits_dbm.values() if limit <= lowest_dbm]
            is_usual = heard.n_walks >= _SHARE_OF_WALKS * n_walks
            if len(limits_dbm) < _FEWEST_PLACES or not is_usual:
                continue
            if self._is_silent(name, rat, visit, memory):
                evidence: Evidence = {
                    "walks": heard.n_walks,
                    "of": n_walks,
                    "level_dbm": round(usual_dbm),
                    "places": len(limits_dbm),
                    "limit_dbm": round(max(limits_dbm)),
                }
                yield Broken(GONE, name, evidence)

    def _is_silent(self, name: str, rat: str, visit: _Visit, memory: Memory) -> bool:
        """Whether today's walk, which names cells of the same network, has not heard a cell."""
        known = self._baseline.cell(name)
        if known is None or known.rat != rat or name in memory.cells:
            return False
        if any(channel in visit.unnamed_channels for channel, _ in known.channels):
            return False
        operator = name.rsplit("-", 2)[0]  # of `mcc-mnc-area-cid`
        return bool(memory.of_operator(operator, rat))


def _full_lists(taken: Taken) -> dict[str, dict[str, float]]:
    """Levels of the named cells of a scan by technology, where it names enough of them."""
    by_rat: dict[str, dict[str, float]] = {}
    for cell, heard in taken:
        if heard.level_dbm is not None:
            by_rat.setdefault(cell.rat, {})[cell.name] = heard.level_dbm
    return {rat: levels for rat, levels in by_rat.items() if len(levels) >= FULL_LIST}


def _unnamed_channels(now: Moment, rat: str) -> set[int]:
    """Channels of a scan's cells without an identity: one of them may be the cell looked for."""
    cells = [heard for heard in now.cells if heard.name is None and heard.rat == rat]
    return {heard.reading.arfcn for heard in cells if heard.reading.arfcn is not None}
