"""A good cell of 4G or 3G left for 2G, as a rogue cell without 4G or 3G wants."""

from collections.abc import Iterator

from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Memory, Moment

_GOOD_DBM = -105.0
"""RSRP or RSCP at which a telephone stays."""
_BEFORE_S = 30.0
_HELD_S = 30.0
_LATER = frozenset({"LTE", "LTE-M", "NB-IoT", "NR", "WCDMA"})


class TechnologyRules:
    """R1."""

    def __init__(self) -> None:
        self._good: tuple[float, str, float, str] | None = None
        self._down_s: float | None = None

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:  # noqa: ARG002
        """As `FamilyRules`."""
        serving = now.serving
        if serving is None:
            return
        if serving.rat in _LATER:
            self._down_s = None
            if serving.level_dbm is not None and serving.level_dbm >= _GOOD_DBM:
                self._good = now.t_s, serving.rat, serving.level_dbm, serving.operator
            return
        if serving.rat != "GSM" or self._good is None:
            return
        if self._down_s is None:
            self._down_s = now.t_s
        good_s, rat, level_dbm, operator = self._good
        is_apart = memory.networks.are_apart(serving.operator, operator)
        is_after_good = not is_apart and self._down_s - good_s <= _BEFORE_S
        if is_after_good and now.t_s - self._down_s >= _HELD_S and serving.name is not None:
            evidence: Evidence = {
                "before": rat,
                "level_dbm": round(level_dbm),
                "held_s": round(now.t_s - self._down_s),
            }
            yield Broken("R1", serving.name, evidence)
