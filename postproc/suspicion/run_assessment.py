"""The words of all cells of one or several runs, with the reasons and what was not asked."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain

from logger.core.baseline import Baseline
from logger.core.runfile import Run
from logger.core.suspicion.finding import Finding
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.suspicion.words import Assessment, assess, by_word
from postproc.cell_work import Failure, failure
from postproc.progress import Progress
from postproc.suspicion.database_rule import missing_in_database, rejected_positions
from postproc.verification.celldb import CellDb


@dataclass(frozen=True, slots=True)
class Suspicions:
    """The most suspicious cell first.

    `start_ns` is when the run began, by run: times of findings are counted from there. `not_asked`
    has each rule that no run could serve, with what was missing. `failures` are the cells for which
    a rule failed, each once; without a cell the name is empty.
    """

    cells: tuple[Assessment, ...]
    start_ns: tuple[int, ...]
    run_of: dict[int, int]
    not_asked: dict[str, tuple[str, ...]]
    failures: dict[str, Failure] = field(default_factory=dict)

    def seconds(self, finding: Finding) -> float | None:
        """Time of a finding since its run began; None for one about the whole run."""
        if not finding.t_ns:
            return None
        run = self.run_of.get(id(finding), 0)
        return (finding.t_ns - self.start_ns[run]) / 1e9


def assess_runs(
    runs: Sequence[Run],
    baseline: Baseline | None = None,
    database: CellDb | None = None,
    progress: Progress | None = None,
) -> Suspicions:
    """Apply all rules to each run; findings of one cell in several runs count together."""
    findings: dict[str, list[Finding]] = {}
    run_of: dict[int, int] = {}
    not_asked: list[dict[str, tuple[str, ...]]] = []
    failures: dict[str, Failure] = {}
    for i, run in enumerate(runs):
        tracker = track(run, baseline)
        failures = failures_of(tracker) | failures
        if database is not None:
            tracker.capabilities.serve("cell database")
        for cell in tracker.assessments():
            findings.setdefault(cell.cell, []).extend(cell.findings)
            run_of |= {id(finding): i for finding in cell.findings}
        not_asked.append(tracker.capabilities.not_asked(RULES.values()))
    if database is not None:
        against = [rejected_positions(run, database, progress) for run in runs]
        for finding in chain(missing_in_database(findings, database), *against):
            is_trusted = baseline is not None and baseline.trust_note(finding.cell) is not None
            if finding.cell in findings and not is_trusted:
                findings[finding.cell].append(finding)
    cells = by_word([assess(name, found) for name, found in findings.items()])
    return Suspicions(
        tuple(cells),
        tuple(_start_ns(run) for run in runs),
        run_of,
        _everywhere(not_asked),
        failures,
    )


def track(run: Run, baseline: Baseline | None = None) -> SuspicionTracker:
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


def _start_ns(run: Run) -> int:
    return run.meta.started_ns


def _everywhere(
    of_runs: Iterable[dict[str, tuple[str, ...]]],
) -> dict[str, tuple[str, ...]]:
    """Rules that no run could serve."""
    first, *others = of_runs
    return {rule: needs for rule, needs in first.items() if all(rule in other for other in others)}
