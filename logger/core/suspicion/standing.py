"""A level that changes while the walker stands and the other levels stay: the station moves."""

from collections.abc import Iterator
from math import inf

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Memory, Moment

_MEAN_S = 15.0
_FEWEST_LEVELS = 3
"""Levels of a mean: one may be wrong."""
_CHANGE_DB = 20.0
_FEWEST_MEANS = 4
"""A minute: a receiver whose position is frozen in a tunnel moves on before."""
_STEADY_DB = 10.0
"""Legitimate cells stay within 14 dB of themselves in logs of standing telephones."""
_STEADY_S = 60.0


class _Means:
    """Means of a level over 15 s each: their number, limits and times."""

    __slots__ = ("_n_levels", "_since_s", "_sum", "first_s", "highest", "last_s", "lowest", "n")

    def __init__(self, t_s: float) -> None:
        self._since_s, self._sum, self._n_levels = t_s, 0.0, 0
        self.n, self.first_s, self.last_s = 0, t_s, t_s
        self.lowest, self.highest = inf, -inf

    def add(self, t_s: float, level_dbm: float) -> None:
        """Take a level."""
        if t_s - self._since_s >= _MEAN_S:
            if self._n_levels >= _FEWEST_LEVELS:
                self._complete()
            self._since_s, self._sum, self._n_levels = t_s, 0.0, 0
        self._sum += level_dbm
        self._n_levels += 1

    def _complete(self) -> None:
        mean_dbm = self._sum / self._n_levels
        self.first_s = self.first_s if self.n else self._since_s
        self.last_s, self.n = self._since_s, self.n + 1
        self.lowest = min(self.lowest, mean_dbm)
        self.highest = max(self.highest, mean_dbm)

    @property
    def spread_db(self) -> float:
        """Highest minus lowest mean; negative before there is one."""
        return self.highest - self.lowest

    @property
    def is_long(self) -> bool:
        """Whether it was heard long enough to be a reference for the others."""
        return self.last_s - self.first_s >= _STEADY_S


class StandingRules:
    """S7."""

    def __init__(self) -> None:
        self._means: Latest[_Means] = Latest(128)

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:  # noqa: ARG002
        """As `FamilyRules`."""
        if now.x_m is None or now.still_s < _MEAN_S:
            self._means.clear()
            return
        for cell, heard in taken:
            if heard.level_dbm is None:
                continue
            means = self._means.get(cell.name) or _Means(now.t_s)
            self._means.put(cell.name, means)
            means.add(now.t_s, heard.level_dbm)
            if means.n >= _FEWEST_MEANS and means.spread_db >= _CHANGE_DB:
                yield from self._against_others(now, cell.name, means)

    def _against_others(self, now: Moment, name: str, means: _Means) -> Iterator[Broken]:
        """S7: the other cells show that neither the walker nor the receiver changed."""
        others = [other for key, other in self._means.items() if key != name and other.is_long]
        widest_db = max((other.spread_db for other in others), default=inf)
        if widest_db <= _STEADY_DB:
            evidence: Evidence = {
                "change_db": round(means.spread_db),
                "still_s": round(now.still_s),
                "other_db": round(widest_db),
                "cells": len(others),
            }
            yield Broken("S7", name, evidence)
