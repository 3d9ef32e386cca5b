"""All rules as a function of a run's records in their order: live and replay are equal."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

from logger.core import answer
from logger.core.baseline import NO_BASELINE, Baseline, square_of
from logger.core.cell_names import Identities
from logger.core.errors import error_place
from logger.core.latest import Latest
from logger.core.suspicion.area import has_others
from logger.core.suspicion.earlier_walks import walks_of
from logger.core.suspicion.heard import Heard, Memory, Moment, Walker
from logger.core.suspicion.rule import Evidence, Finding, Need, Rule
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import assess, by_word, unnoticed_text
from logger.core.types import Fix, Record, Scan

_MOST_SQUARES = 10_000
_MOST_ASKED = 10_000
_MOST_FOUND = 500
"""Cells with findings that are remembered: beyond, the log itself is broken."""


class SuspicionTracker:
    """Follows the records of one run; `feed` them in recorded order.

    Each modem has a memory of its own: another one reads higher or lower, hears other neighbours
    and is served by another cell. A rule that holds for a cell in several counts once. `worst` is
    the cell with the worst word so far, None while all are "nothing unusual". `unnoticed_text` says
    what the rules could not see so far, "" before the first scan. `errors` has, by cell ("" without
    one), the first error of a rule, which is one of this program: the other rules and cells go on.
    """

    def __init__(self, max_fix_age_s: float = 3.0, baseline: Baseline = NO_BASELINE) -> None:
        self._baseline = baseline
        self._walker = Walker(max_fix_age_s)
        self._memories: dict[str, Memory] = {}
        self._identities = Identities()
        self._asked: Latest[None] = Latest(_MOST_ASKED)  # cells about which rules were asked
        self._findings: Latest[list[Finding]] = Latest(_MOST_FOUND)
        self._refutable: dict[str, None] = {}
        self.worst: str | None = None
        self.errors: Latest[str] = Latest(_MOST_FOUND)
        self.capabilities = Capabilities()
        self._walks_by_square: Latest[int] = Latest(_MOST_SQUARES)
        self._unnoticed: str | None = ""
        if baseline.n_walks:
            self.capabilities.serve("earlier walks")

    def feed(self, record: Record) -> list[Finding]:
        """Take the next record; returns what is found because of it."""
        match record.value:
            case Fix() as fix:
                self._walker.add(record.t_ns, fix)
            case Scan() as scan:
                return self._take_scan(record.t_ns, scan, record.source)
        return []

    def assessment(self, cell: str) -> answer.Word:
        """The word of a cell so far."""
        return assess(cell, self._findings.get(cell, ()))

    @property
    def earlier_walks(self) -> int:
        """Earlier walks, with a cell heard today, of at least half of this ground."""
        by_square = sorted(self._walks_by_square.values())
        return by_square[(len(by_square) - 1) // 2] if by_square else 0

    @property
    def unnoticed_text(self) -> str:
        if self._unnoticed is None:
            not_asked = self.capabilities.not_asked(RULES.values())
            heard_s = self.capabilities.heard_s
            self._unnoticed = unnoticed_text(not_asked, heard_s, self.earlier_walks)
        return self._unnoticed

    def technologies(self) -> dict[str, str]:
        """Technology of cells of late and of those with findings."""
        rats = {name: self._rat(name) for name in self._findings}
        for memory in self._memories.values():
            rats |= {name: cell.rat for name, cell in memory.cells.items()}
        return {name: rat for name, rat in rats.items() if rat is not None}

    def assessments(self) -> list[answer.Word]:
        """The words of cells named by two scans, and of those with findings."""
        checked = [name for name in self._asked if name in self._identities]
        return [self.assessment(name) for name in dict.fromkeys([*checked, *self._findings])]

    def conspicuous(self) -> list[answer.Word]:
        """The words of unusual and suspicious cells, the most suspicious first."""
        known = by_word([self.assessment(name) for name in self._findings])
        return [one for one in known if one.is_conspicuous]

    def _take_scan(self, t_ns: int, scan: Scan, modem: str) -> list[Finding]:
        self._identities.add(scan)
        now = self._walker.at(t_ns, scan)
        self.capabilities.add(now)
        memory = self._memories.setdefault(modem, Memory(self._baseline))
        memory.take(now)
        for cell in memory.taken:
            if cell.n_scans == 1:
                self._asked.put(cell.name, None)
        self.capabilities.add_others(memory)
        self._count_walks(now)
        for name in tuple(self._refutable):
            self._withdraw(memory, name)
        return [finding for rule in RULES.values() for finding in self._ask(memory, rule)]

    def _count_walks(self, now: Moment) -> None:
        self._unnoticed = None
        if not self._baseline.n_walks or now.lat_deg is None or now.lon_deg is None:
            return
        square = self._baseline.square(square_of(now.lat_deg, now.lon_deg))
        networks = {(cell.operator, cell.rat) for cell in now.cells if cell.name in square.cells}
        number = str(square.square)
        known = self._walks_by_square.get(number, 0)
        heard = [walks_of(square, *network) for network in networks]
        self._walks_by_square.put(number, max([known, *heard]))

    def _ask(self, memory: Memory, rule: Rule[Memory, Any]) -> list[Finding]:
        """Goes on with the next cell where the rule raises."""
        new: list[Finding] = []
        check = rule.check
        try:
            for cell in rule.about(memory):
                try:
                    evidence = check(memory, cell)
                    if evidence is not None:
                        new += self._keep(memory, rule, cell, evidence)
                except Exception as error:  # noqa: BLE001 (recorded and shown)
                    self._fail(cell.name, error)
        except Exception as error:  # noqa: BLE001
            self._fail("", error)
        return new

    def _fail(self, name: str, error: Exception) -> None:
        if name not in self.errors:
            self.errors.put(name, error_place(error))

    def _keep(
        self, memory: Memory, rule: Rule[Memory, Any], cell: Any, evidence: Evidence
    ) -> list[Finding]:
        """Keep the first finding of a rule for a cell, once two scans have named the cell."""
        before, rat = self._findings.get(cell.name, []), self._rat(cell.name)
        if rat is None or rat not in rule.rats or any(one.rule is rule for one in before):
            return []
        if self._baseline.trust_note(cell.name) is not None:
            return []
        refuted_by = rule.refuted_by
        if refuted_by and any(refuted_by(each, cell.name) for each in self._memories.values()):
            return []  # another modem hears it
        nats = rule.nats(rat) if rule.weigh is None else rule.weigh(memory, cell)
        now, text = memory.now, rule.text_of(evidence)
        at_deg = now.lat_deg, now.lon_deg
        finding = Finding(rule, cell.name, now.t_ns, *at_deg, text, evidence, nats)
        self._findings.put(cell.name, [*before, finding])
        if rule.refuted_by is not None:
            self._refutable[cell.name] = None
        self._rank([name for name in (cell.name, self.worst) if name is not None])
        return [finding]

    def _withdraw(self, memory: Memory, name: str) -> None:
        before = self._findings.get(name, [])
        left = [one for one in before if not _is_refuted(one, memory)]
        if not any(one.rule.refuted_by for one in left):
            del self._refutable[name]
        if len(left) == len(before):
            return
        self._findings.pop(name)
        if left:
            self._findings.put(name, left)
        if name == self.worst:
            self._rank(self._findings)

    def _rat(self, name: str) -> str | None:
        for memory in self._memories.values():
            if name in memory.cells:
                return memory.cells[name].rat if name in self._identities else None
        known = self._baseline.cell(name)
        return None if known is None else known.rat

    def _rank(self, names: Iterable[str]) -> None:
        worst = next(iter(by_word([self.assessment(name) for name in names])), None)
        self.worst = None if worst is None or not worst.is_conspicuous else worst.cell


def _is_refuted(finding: Finding, memory: Memory) -> bool:
    refuted_by = finding.rule.refuted_by
    return refuted_by is not None and refuted_by(memory, finding.cell)


class Capabilities:
    """Needs of rules that some scan has served: without them a rule is "not asked", not "fine".

    `heard_s` is the time from the first cell to the last one.
    """

    def __init__(self, served: Mapping[str, Iterable[Need]] = MappingProxyType({})) -> None:
        self._served = {rat: set(needs) for rat, needs in served.items()}
        self._always: set[Need] = {"second technology"} if len(self._served) > 1 else set()
        self._first_s: float | None = None
        self.heard_s = 0.0

    def serve(self, need: Need) -> None:
        """Take what is not the modem's."""
        self._always.add(need)

    def add(self, now: Moment) -> None:
        """Take what a scan serves."""
        if now.cells:
            self._first_s = now.t_s if self._first_s is None else self._first_s
            self.heard_s = now.t_s - self._first_s
        for heard in now.cells:
            served = self._served.setdefault(heard.rat, set())
            for need, is_served in _OF_READING.items():
                if need not in served and is_served(heard):
                    served.add(need)
        for rat, n in Counter([heard.rat for heard in now.cells]).items():
            if now.x_m is not None:
                self._served[rat].add("position")
            if n > 1:
                self._served[rat].add("neighbours")
        if len(self._served) > 1:
            self._always.add("second technology")

    def add_others(self, memory: Memory) -> None:
        for rat in {cell.rat for cell in memory.taken}:
            served = self._served[rat]
            if "other cells" not in served and has_others(memory, rat):
                served.add("other cells")

    def missing(self, rule: Rule[Any, Any], rat: str) -> frozenset[Need]:
        """What a rule needs and no scan of a technology has served."""
        return frozenset(rule.needs) - self._served.get(rat, set()) - self._always

    def is_asked(self, rule: Rule[Any, Any], rat: str) -> bool:
        """Whether a rule is applied to cells of a technology."""
        return rat in rule.rats and not self.missing(rule, rat)

    def technologies(self, rule: Rule[Any, Any]) -> list[str]:
        """Technologies to whose cells a rule is applied."""
        return [rat for rat in self._served if self.is_asked(rule, rat)]

    def not_asked(self, rules: Iterable[Rule[Any, Any]]) -> dict[str, tuple[str, ...]]:
        """Rules that no technology heard could serve, with what the best one lacked."""
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
"""Whether a reading serves a need."""
