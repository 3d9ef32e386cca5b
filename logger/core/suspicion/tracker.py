"""All rules as a function of the records of a run, in their order: live and replay are equal."""

from collections.abc import Iterable, Iterator

from logger.core.baseline import Baseline, NoBaseline
from logger.core.errors import error_place
from logger.core.identities import Identities
from logger.core.latest import Latest
from logger.core.suspicion.area import AreaRules
from logger.core.suspicion.broadcast import BroadcastRules
from logger.core.suspicion.broken import Broken, FamilyRules, Taken
from logger.core.suspicion.capabilities import Capabilities
from logger.core.suspicion.earlier_walks import EarlierWalkRules
from logger.core.suspicion.finding import WORDS, Finding, Rule
from logger.core.suspicion.gone_cells import GONE, GoneCellRule
from logger.core.suspicion.heard import Heard, HeardCell, Memory, Moment, Walker
from logger.core.suspicion.neighbours import NeighbourRules
from logger.core.suspicion.place import PlaceRules
from logger.core.suspicion.plan import PlanRules
from logger.core.suspicion.rules import RULES, rate_of
from logger.core.suspicion.signal import SignalRules
from logger.core.suspicion.standing import StandingRules
from logger.core.suspicion.technology import TechnologyRules
from logger.core.suspicion.timing import TimingRules
from logger.core.suspicion.words import Assessment, assess, by_word
from logger.core.types import Fix, Record, Scan

_MOST_FOUND = 500
"""Cells with findings that are remembered: beyond, the log itself is broken."""


class SuspicionTracker:
    """Follows the records of one run; `feed` them in recorded order.

    `worst` is the cell with the worst word so far, None while all are "nothing unusual".
    `n_changes` counts findings and those withdrawn. `errors` has, by cell, the first error of a
    rule, which is one of this program: the other rules and cells go on. Without a cell it is under
    an empty name.
    """

    def __init__(self, max_fix_age_s: float = 3.0, baseline: Baseline | None = None) -> None:
        self._baseline = baseline or NoBaseline()
        self._walker = Walker(max_fix_age_s)
        self._memory = Memory()
        self._identities = Identities()
        self._families: tuple[FamilyRules, ...] = (
            PlanRules(),
            AreaRules(),
            NeighbourRules(),
            SignalRules(),
            PlaceRules(),
            StandingRules(),
            TimingRules(),
            BroadcastRules(),
            TechnologyRules(),
            EarlierWalkRules(self._baseline),
            GoneCellRule(self._baseline),
        )
        self._findings: Latest[list[Finding]] = Latest(_MOST_FOUND)
        self._gone: set[str] = set()
        self.worst: str | None = None
        self.n_changes = 0
        self.errors: Latest[str] = Latest(_MOST_FOUND)
        self.capabilities = Capabilities()
        if self._baseline.n_walks:
            self.capabilities.serve("earlier walks")

    def feed(self, record: Record) -> list[Finding]:
        """Take the next record; returns what is found because of it."""
        match record.value:
            case Fix() as fix:
                self._walker.add(record.t_ns / 1e9, fix)
            case Scan() as scan:
                return self._take_scan(record.t_ns, scan)
        return []

    def assessment(self, cell: str) -> Assessment:
        """The word of a cell so far."""
        return assess(cell, self._findings.get(cell, ()))

    def technologies(self) -> dict[str, str]:
        """Technology of each cell of late, and of those with findings."""
        rats = {name: self._rat(name) for name in self._findings}
        rats |= {name: cell.rat for name, cell in self._memory.cells.items()}
        return {name: rat for name, rat in rats.items() if rat is not None}

    def assessments(self) -> list[Assessment]:
        """The words of all cells of late, and of those with findings."""
        known = [name for name in self._memory.cells if name in self._identities]
        return [self.assessment(name) for name in dict.fromkeys([*known, *self._findings])]

    def _take_scan(self, t_ns: int, scan: Scan) -> list[Finding]:
        self._identities.add(scan)
        now = self._walker.at(t_ns, scan)
        self.capabilities.add(now)
        taken = self._memory.take(now)
        if self._gone:
            self._return(cell.name for cell, _ in taken)
        new = []
        for family in self._families:
            new += self._ask(family, now, taken)
        return new

    def _ask(self, family: FamilyRules, now: Moment, taken: Taken) -> list[Finding]:
        """New findings of a family; it goes on with the next cell where a rule raises."""
        new: list[Finding] = []
        left = _InTurn(taken)
        while True:
            try:
                for broken in family.check(now, self._memory, left):
                    new += self._keep(broken, now)
            except Exception as error:  # noqa: BLE001 (recorded and shown)
                k = left.k
                name = "" if k is None else left[k][0].name
                if name not in self.errors:
                    self.errors.put(name, error_place(error))
                if k is None:
                    return new
                left = _InTurn(left[k + 1 :])
            else:
                return new

    def _return(self, names: Iterable[str]) -> None:
        """Withdraw that a cell is gone: it is heard, later or elsewhere in its square."""
        for name in self._gone.intersection(names):
            self._gone.remove(name)
            self.n_changes += 1
            kept = [one for one in self._findings.pop(name, None) or () if one.rule != GONE]
            if kept:
                self._findings.put(name, kept)

    def _keep(self, broken: Broken, now: Moment) -> list[Finding]:
        """Keep the first finding of a rule for a cell, once two scans have named the cell."""
        before = self._findings.get(broken.cell, [])
        rat = self._rat(broken.cell)
        rule = RULES[broken.rule]
        if rat is None or rat not in rule.rats:
            return []
        if any(finding.rule == broken.rule for finding in before):
            return []
        if self._baseline.trust_note(broken.cell) is not None:
            return []
        finding = _finding(rule, broken, now, rat)
        self._findings.put(broken.cell, [*before, finding])
        self.n_changes += 1
        if rule.id == GONE:
            self._gone.add(broken.cell)
        self._rank(broken.cell)
        return [finding]

    def _rat(self, name: str) -> str | None:
        """Technology of a cell that two scans have named, of this walk or of earlier ones."""
        cell = self._memory.cells.get(name)
        if cell is not None:
            return cell.rat if name in self._identities else None
        known = self._baseline.cell(name)
        return None if known is None else known.rat

    def _rank(self, cell: str) -> None:
        """Compare a cell that has a new finding with the worst one."""
        found = [self.assessment(name) for name in (cell, self.worst) if name is not None]
        worst = by_word(found)[0]
        self.worst = None if worst.word == WORDS[0] else worst.cell


class _InTurn(list[tuple[HeardCell, Heard]]):
    """The named cells of a scan; `k` is the number of the one whose turn it is, if it is one's."""

    k: int | None = None

    def __iter__(self) -> Iterator[tuple[HeardCell, Heard]]:
        for self.k, one in enumerate(super().__iter__()):
            yield one
        self.k = None


def _finding(rule: Rule, broken: Broken, now: Moment, rat: str) -> Finding:
    return Finding(
        rule.id,
        rule.family,
        broken.cell,
        now.t_ns,
        now.lat_deg,
        now.lon_deg,
        rule.sentence.format(**broken.evidence),
        broken.evidence,
        rule.nats(rate_of(rule, rat)),
    )
