"""The words of all cells of runs, with reasons and what was not asked; results in their order."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

from logger.core.baseline import NO_BASELINE, Baseline
from logger.core.runfile import Run
from logger.core.suspicion.rule import Finding, Rule
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.suspicion.words import Assessment, assess, by_word, sentences
from postproc.cell_work import Failure, failure
from postproc.progress import Progress
from postproc.result import CellResult, Result
from postproc.suspicion.database_rules import DATABASE_RULES, database_findings
from postproc.verification.celldb import CellDb

ALL_RULES: tuple[Rule[Any, Any], ...] = (*RULES.values(), *DATABASE_RULES)
_MOST_REASONS = 3
"""For each cell in one sentence: `postproc suspect` prints all of them."""


@dataclass(frozen=True, slots=True)
class Suspicions:
    """The most suspicious cell first.

    `start_ns` is when the run of a finding began, by its `id`. `not_asked` has each rule that no
    run could serve, with what was missing. `failures` are the cells for which a rule failed, each
    once; without a cell the name is empty.
    """

    cells: tuple[Assessment, ...]
    start_ns: dict[int, int]
    not_asked: dict[str, tuple[str, ...]]
    failures: dict[str, Failure]

    def seconds(self, finding: Finding) -> float | None:
        """Time of a finding since its run began; None for one about the whole run."""
        if not finding.t_ns:
            return None
        return (finding.t_ns - self.start_ns[id(finding)]) / 1e9


def assess_runs(
    runs: Sequence[Run],
    baseline: Baseline | None = None,
    database: CellDb | None = None,
    progress: Progress | None = None,
) -> Suspicions:
    """Apply all rules to each run; findings of one cell in several runs count together."""
    baseline = baseline or NO_BASELINE
    findings: dict[str, list[Finding]] = {}
    start_ns: dict[int, int] = {}
    not_asked: list[dict[str, tuple[str, ...]]] = []
    failures: dict[str, Failure] = {}
    for run in runs:
        tracker = track(run, baseline)
        failures = failures_of(tracker) | failures
        if database is not None:
            tracker.capabilities.serve("cell database")
        for cell in tracker.assessments():
            findings.setdefault(cell.cell, []).extend(cell.findings)
            start_ns |= {id(finding): run.meta.started_ns for finding in cell.findings}
        not_asked.append(tracker.capabilities.not_asked(ALL_RULES))
    if database is not None:
        for finding in database_findings(runs, list(findings), database, progress):
            if finding.cell in findings and baseline.trust_note(finding.cell) is None:
                findings[finding.cell].append(finding)
    cells = by_word([assess(name, found) for name, found in findings.items()])
    everywhere = set(not_asked[0]).intersection(*not_asked)
    missing = {rule: needs for rule, needs in not_asked[0].items() if rule in everywhere}
    return Suspicions(tuple(cells), start_ns, missing, failures)


def track(run: Run, baseline: Baseline = NO_BASELINE) -> SuspicionTracker:
    """The tracker after all records of a run, as live."""
    tracker = SuspicionTracker(run.meta.live.max_fix_age_s, baseline)
    for _, record in run.records("fixes", "scans"):
        tracker.feed(record)
    return tracker


def failures_of(tracker: SuspicionTracker) -> dict[str, Failure]:
    """The rules that failed, by cell."""
    return {
        cell: failure(cell, "a rule of suspicion", error) for cell, error in tracker.errors.items()
    }


def conspicuous_first(result: Result) -> tuple[Result, tuple[str, ...]]:
    """The result with words, unusual cells first, and their reasons among the warnings.

    Beside it these cells, the most suspicious first.
    """
    there = {cell.cell for cell in result.cells}
    suspicions = assess_runs([observed.run for observed in result.runs])
    unusual = _conspicuous(suspicions, there)
    rank = {cell.cell: i for i, cell in enumerate(unusual)}
    failures = suspicions.failures
    cells = [
        _with_failure(cell, failures[cell.cell]) if cell.cell in failures else cell
        for cell in sorted(result.cells, key=lambda cell: rank.get(cell.cell, len(rank)))
    ]
    of_none = [failures[""].reason] if "" in failures else []
    warnings = (*map(reason_line, unusual), *of_none, *result.warnings)
    words = {name: assess(name, ()) for name in there}
    words |= {cell.cell: cell for cell in suspicions.cells}
    return replace(result, cells=tuple(cells), warnings=warnings, words=words), tuple(rank)


def _with_failure(cell: CellResult, why: Failure) -> CellResult:
    """The result of a cell for which a rule failed: its estimate stands."""
    return replace(cell, warnings=(*cell.warnings, why.reason), error=cell.error or why.error)


def conspicuous_cells(runs: Sequence[Run], among: Collection[str]) -> list[Assessment]:
    """The suspicious and unusual cells `among` these names, the most suspicious first."""
    return _conspicuous(assess_runs(runs), among)


def _conspicuous(suspicions: Suspicions, among: Collection[str]) -> list[Assessment]:
    return [
        cell for cell in suspicions.cells if cell.word != "nothing unusual" and cell.cell in among
    ]


def reason_line(cell: Assessment) -> str:
    """A cell, its word, and its strongest reasons in one sentence."""
    strongest = sorted(sentences(cell.findings), key=lambda finding: -finding.nats)[:_MOST_REASONS]
    return f"{cell.cell} is {cell.word}: {'; '.join(finding.text for finding in strongest)}"
