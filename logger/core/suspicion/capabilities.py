"""What the modem has served so far: a rule without what it needs is "not asked", never "fine"."""

from collections.abc import Callable, Iterable, Mapping

from logger.core.suspicion.finding import Need, Rule
from logger.core.suspicion.heard import Heard, Moment


class Capabilities:
    """Needs of rules that some scan has served, by technology."""

    def __init__(self) -> None:
        self._always: set[Need] = set()
        self._served: dict[str, set[Need]] = {}
        self._missing: dict[str, dict[Need, Callable[[Heard], bool]]] = {}

    def serve(self, need: Need) -> None:
        """Take what does not come from the modem."""
        self._always.add(need)

    def add(self, now: Moment) -> None:
        """Take what a scan serves."""
        n_cells: dict[str, int] = {}
        for heard in now.cells:
            rat = heard.rat
            n_cells[rat] = n_cells.get(rat, 0) + 1
            missing = self._missing.get(rat)
            if missing is None:
                missing = self._missing[rat] = dict(_OF_READING)
                self._served[rat] = set()
            if new := [need for need, is_served in missing.items() if is_served(heard)]:
                self._served[rat].update(new)
                for need in new:
                    del missing[need]
        for rat, n in n_cells.items():
            if now.x_m is not None:
                self._served[rat].add("position")
            if n > 1:
                self._served[rat].add("neighbours")
        if len(self._served) > 1:
            self._always.add("second technology")

    def missing(self, rule: Rule, rat: str) -> frozenset[Need]:
        """What a rule needs and no scan of a technology has served."""
        return rule.needs - self._served.get(rat, set()) - self._always

    def is_asked(self, rule: Rule, rat: str) -> bool:
        """Whether a rule is applied to cells of a technology."""
        return rat in rule.rats and not self.missing(rule, rat)

    def not_asked(self, rules: Iterable[Rule]) -> dict[str, tuple[str, ...]]:
        """Rules that no technology heard could serve, with what was missing for the best one."""
        result: dict[str, tuple[str, ...]] = {}
        for rule in rules:
            rats = [rat for rat in self._served if rat in rule.rats]
            if not rats:
                result[rule.id] = (f"cell of {' or '.join(sorted(rule.rats)[:2])}",)
                continue
            least = min((self.missing(rule, rat) for rat in rats), key=len)
            if least:
                result[rule.id] = tuple(sorted(least))
        return result


def _has_lists(heard: Heard) -> bool:
    return heard.broadcast is not None and heard.broadcast.neighbour_arfcns is not None


def _has_offset(heard: Heard) -> bool:
    if heard.reading.c1 is not None and heard.reading.c2 is not None:
        return True
    return heard.broadcast is not None and heard.broadcast.cro_db is not None


_OF_READING: Mapping[Need, Callable[[Heard], bool]] = {
    "identity": lambda heard: heard.name is not None,
    "country code": lambda heard: heard.reading.mcc is not None,
    "area code": lambda heard: heard.area is not None,
    "channel": lambda heard: heard.reading.arfcn is not None,
    "colour code": lambda heard: heard.code is not None,
    "level": lambda heard: heard.level_dbm is not None,
    "timing advance": lambda heard: heard.reading.ta is not None,
    "neighbour lists": _has_lists,
    "C1 and C2": _has_offset,
}
"""Whether a reading serves a need; one that a technology has served is not asked again."""
