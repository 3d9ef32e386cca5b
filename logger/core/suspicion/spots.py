"""Where and how strongly a cell was heard on the whole walk, in bounded memory."""

from collections.abc import Callable, Iterator
from itertools import chain

SPOT_M = 25.0
"""Levels are averaged over squares of this side; shadowing differs between them."""
VISIT_S = 60.0
"""Later, a square is a new spot: a moving station gives it another level."""
MOST_SPOTS = 48
"""Spots of each cell; 40 cells need half a megabyte."""


class Spot:
    """Levels of a cell in one square: place, mean, best, number, first and last time."""

    __slots__ = ("best_dbm", "last_s", "level_dbm", "n", "t_s", "x_m", "y_m")

    def __init__(self, x_m: float, y_m: float, level_dbm: float, t_s: float) -> None:
        self.x_m, self.y_m, self.n = x_m, y_m, 1
        self.t_s = self.last_s = t_s
        self.level_dbm = self.best_dbm = level_dbm

    def add(self, level_dbm: float, t_s: float) -> None:
        """Add another level here."""
        self.n += 1
        self.last_s = t_s
        self.best_dbm = max(self.best_dbm, level_dbm)
        self.level_dbm += (level_dbm - self.level_dbm) / self.n

    def is_of_visit(self, other: "Spot", pause_s: float) -> bool:
        """Whether at most `pause_s` lie between this spot and another."""
        return self.t_s - other.last_s <= pause_s and other.t_s - self.last_s <= pause_s

    def absorb(self, other: "Spot") -> None:
        """Extend times and best level by those of a weaker spot of the same visit."""
        self.t_s, self.last_s = min(self.t_s, other.t_s), max(self.last_s, other.last_s)
        self.best_dbm = max(self.best_dbm, other.best_dbm)


class Spots:
    """Spots of one cell; `n` counts all, of which those remain that a coarser grid keeps.

    If there are too many, the squares double: each keeps its strongest spot, so the peaks beside
    transmitters remain.
    """

    def __init__(self) -> None:
        self.here: Spot | None = None
        self.n = 0
        self._square = (0, 0)
        self._side_m, self._pause_s = SPOT_M, VISIT_S
        self._visits: dict[tuple[int, int], list[Spot]] = {}
        self._n_kept = 0

    def __len__(self) -> int:
        return self._n_kept + (self.here is not None)

    def __iter__(self) -> Iterator[Spot]:
        here = () if self.here is None else (self.here,)
        return chain(chain.from_iterable(self._visits.values()), here)

    def add(self, x_m: float, y_m: float, level_dbm: float, t_s: float) -> None:
        """Add a level at a place; metres, seconds."""
        square = int(x_m // SPOT_M), int(y_m // SPOT_M)
        here = self.here
        if here is not None and square == self._square and t_s - here.last_s <= VISIT_S:
            here.add(level_dbm, t_s)
            return
        if here is not None:
            self._keep(here)
            self._coarsen()
        self.here, self._square = Spot(x_m, y_m, level_dbm, t_s), square
        self.n += 1

    def forget(self, is_wrong: Callable[[Spot], bool]) -> None:
        """Drop spots."""
        kept = [spot for spot in self if not is_wrong(spot)]
        if len(kept) < len(self):
            self.here, self._visits, self._n_kept = None, {}, 0
            for spot in kept:
                self._keep(spot)

    def _keep(self, spot: Spot) -> None:
        square = int(spot.x_m // self._side_m), int(spot.y_m // self._side_m)
        visits = self._visits.setdefault(square, [])
        for i, visit in enumerate(visits):
            if visit.is_of_visit(spot, self._pause_s):
                weaker, stronger = sorted((visit, spot), key=lambda s: s.level_dbm)
                stronger.absorb(weaker)
                visits[i] = stronger
                return
        visits.append(spot)
        self._n_kept += 1

    def _coarsen(self) -> None:
        """Double the squares, or where the walker stays at a few of them the length of a visit."""
        while self._n_kept >= MOST_SPOTS:
            if len(self._visits) > MOST_SPOTS // 2:
                self._side_m *= 2.0
            else:
                self._pause_s *= 2.0
            kept = [spot for visits in self._visits.values() for spot in visits]
            self._visits, self._n_kept = {}, 0
            for spot in sorted(kept, key=lambda spot: spot.t_s):
                self._keep(spot)
