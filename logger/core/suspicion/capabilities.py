"""What the modem has served so far: a rule without what it needs is "not asked", never "fine"."""

from collections.abc import Iterable

from logger.core.suspicion.finding import Need, Rule
from logger.core.suspicion.heard import Heard, Moment


class Capabilities:
    """Needs of rules that some scan has served, by technology."""

    def __init__(self) -> None:
        self._always: set[Need] = set()
        self._served: dict[str, set[Need]] = {}

    def serve(self, need: Need) -> None:
        """Take what does not come from the modem."""
        self._always.add(need)

    def add(self, now: Moment) -> None:
        """Take what a scan serves."""
        for rat in {heard.rat for heard in now.cells}:
            served = self._served.setdefault(rat, set())
            cells = [heard for heard in now.cells if heard.rat == rat]
            for heard in cells:
                served.update(_of_reading(heard))
            if now.x_m is not None:
                served.add("position")
            if len(cells) > 1:
                served.add("neighbours")
        if len(self._served) > 1:
            self._always.add("several technologies")

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


def _of_reading(heard: Heard) -> Iterable[Need]:
    reading = heard.reading
    if heard.name is not None:
        yield "identity"
    if reading.mcc is not None:
        yield "country code"
    if heard.area is not None:
        yield "area code"
    if reading.arfcn is not None:
        yield "channel"
    if heard.code is not None:
        yield "colour code"
    if heard.level_dbm is not None:
        yield "level"
    if reading.ta is not None:
        yield "timing advance"
    broadcast = heard.broadcast
    if broadcast is not None and broadcast.neighbour_arfcns is not None:
        yield "neighbour lists"
    if None not in (reading.c1, reading.c2) or (
        broadcast is not None and broadcast.cro_db is not None
    ):
        yield "C1 and C2"
