"""The words of all cells of runs, with reasons and what was not asked, and as a document."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Any, Final, NamedTuple, TypeVar

from logger.core import answer
from logger.core.baseline import NO_BASELINE, Baseline, baseline_of
from logger.core.cell_names import identity_of
from logger.core.certainty import OnMap
from logger.core.document import Column, Document, Line, Table, Word, html_text, terminal_lines
from logger.core.runfile import Run
from logger.core.suspicion.countries import TEST_MCCS
from logger.core.suspicion.rule import Evidence, Finding, Need, Rate, Rule
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import Capabilities, SuspicionTracker
from logger.core.suspicion.words import (
    assess,
    by_word,
    false_alarms_per_hour,
    reason_line,
    sentences,
    unnoticed_text,
    word_rate_text,
)
from logger.drivers.family import cells_with
from postproc.cell_work import Failure, failure
from postproc.ground import (
    SEVERAL,
    HeardIn,
    apart_m,
    first_and_last_utc,
    runs_text,
    several_evidence,
    several_text,
)
from postproc.progress import Progress
from postproc.result import CellResult, Options, Result
from postproc.scan_counts import heard_utc_ns, observed_cells
from postproc.verification.celldb import CellDb
from postproc.verification.claims import claims_of

# P3: the database does not have the cell. S10: the levels reject the position that it has.

_FEWEST = 5
"""Other cells from which on their share in the database says something about this place."""
_MOST_NATS = 2.0
"""Less than any word needs: absence is never an alarm by itself."""
_P_FA = 0.01
"""Level of the test of a position: that at which its rate was measured."""


Source = TypeVar("Source")


class _Desk:
    """Runs, the names of their cells, and which of these the database has."""

    def __init__(
        self, runs: Sequence[Run], names: Sequence[str], database: CellDb, progress: Progress | None
    ) -> None:
        self.runs, self.database, self.progress = runs, database, progress
        self.names = [name for name in names if identity_of(name) is not None]
        self.known = {name for name in self.names if database.by_identity(name)}


class _Cell(NamedTuple):
    """A cell; a run rejects its position in the database by so many metres, and so surely."""

    name: str
    apart_m: float = 0.0
    p: float = 1.0


def _missing_cells(desk: _Desk) -> Iterator[_Cell]:
    if len(desk.names) > _FEWEST:
        yield from (_Cell(name) for name in desk.names if name not in desk.known)


def _missing_nats(desk: _Desk, _cell: _Cell) -> float:
    """By the share of the cells here that the database has."""
    return min(-log(1.0 - (len(desk.known) + 1) / (len(desk.names) + 1)), _MOST_NATS)


@Rule[_Desk, _Cell](
    id="P3",
    family="plan",
    needs=("identity", "cell database"),
    gate="weighed by the share of cells here that the database has; never alone",
    sentence="the database does not have this cell, but {share:.0%} of the others heard here",
    harmless="databases are incomplete",
    about=_missing_cells,
    detection=1.0,
    elsewhere=Rate(100, 197, 0.0, "a database that had 41 to 58 % of 197 cells"),
    weigh=_missing_nats,
)
def _others_are_known(desk: _Desk, _cell: _Cell) -> Evidence | None:
    n_others = len(desk.names) - 1
    share = len(desk.known) / n_others
    return {"share": round(share, 2), "cells": n_others} if share >= 0.5 else None


def _rejected_positions(desk: _Desk) -> Iterator[_Cell]:
    """The tests are those of `postproc verify`, with the spread of a database's position."""
    # scipy, which takes a second, is for those who give a database
    from postproc.verification.run_claims import verify_claims  # noqa: PLC0415

    for run in desk.runs:
        claims = claims_of(desk.database, list(observed_cells([run], None)))
        verified = verify_claims(run, claims, _P_FA, Options().prior, progress=desk.progress)
        for verdict in verified.cells:
            if verdict.verdict != "rejected" or verdict.p is None or verdict.best_deg is None:
                continue
            lat, lon = verdict.best_deg
            away_m = apart_m((verdict.claim.at, OnMap(lat=lat, lon=lon)))
            yield _Cell(verdict.cell, away_m, verdict.p)


@Rule[_Desk, _Cell](
    id="S10",
    family="place",
    needs=("identity", "level", "position", "cell database"),
    gate="a test of the whole walk rejects the position at a level of 1 %",
    sentence="the levels reject its position in the database by {apart_m} (p = {p})",
    harmless="a wrong or old position in the database, hills and tall buildings",
    about=_rejected_positions,
    detection=0.25,
    elsewhere=Rate(3, 161, 0.0, "161 measured walks past surveyed cells"),
)
def _elsewhere(_desk: _Desk, cell: _Cell) -> Evidence | None:
    return {"apart_m": round(cell.apart_m), "p": float(f"{cell.p:.2g}")}


DATABASE_RULES = (_others_are_known, _elsewhere)


Several = Mapping[str, Sequence[HeardIn]]
"""Where each identity is heard that runs of several places name (`postproc.ground.Group`)."""
NOWHERE_ELSE: Final[Several] = {}
# as many of one country would say more: a country code is of one country
_APART = Rate(0, 107, 0.0, "identities of logs of three countries")


def _apart_nats(_several: Several, cell: str) -> float:
    # anybody uses the identities of test networks, and a name without a network is no identity
    if identity_of(cell) is None or cell[:3] in TEST_MCCS:
        return 0.0
    return -log(_APART.per_cell)


@Rule[Several, str](
    id="S11",
    family="place",
    needs=("identity", "position"),
    gate="runs of several places name it, in two scans each",
    sentence=SEVERAL,
    harmless="test networks, whose identities are used anywhere, and logs with wrong positions",
    about=lambda several: several,
    detection=1.0,
    elsewhere=_APART,
    weigh=_apart_nats,
)
def in_several_places(several: Several, cell: str) -> Evidence | None:
    return several_evidence(several[cell])


def findings_at_desk(rules: Iterable[Rule[Source, Any]], source: Source) -> Iterator[Finding]:
    """Findings of rules about whole runs, each without a time or a place of its own."""
    for rule in rules:
        for cell in rule.about(source):
            evidence = rule.check(source, cell)
            if evidence is not None:
                nats = rule.nats("") if rule.weigh is None else rule.weigh(source, cell)
                name = cell if isinstance(cell, str) else cell.name
                text = rule.text_of(evidence)
                yield Finding(rule, name, 0, None, None, text, evidence, nats)


ALL_RULES: tuple[Rule[Any, Any], ...] = (*RULES.values(), *DATABASE_RULES, in_several_places)


_MOST_NAMED = 8


@dataclass(frozen=True, slots=True)
class Suspicions:
    """The most suspicious cell first.

    `runs` named each cell, `run_of` is that of a finding by its `id`. `not_asked` has rules that no
    run could serve, with what was missing, `heard_s` the longest time that one heard cells,
    `earlier_walks` their least number. `failures` are the cells for which a rule failed; without a
    cell the name is empty.
    """

    cells: tuple[answer.Word, ...]
    runs: Mapping[str, Sequence[Run]]
    run_of: Mapping[int, Run]
    not_asked: dict[str, tuple[str, ...]]
    failures: dict[str, Failure]
    heard_s: float = 0.0
    earlier_walks: int = 0

    @property
    def unnoticed_text(self) -> str:
        """What no rule could see."""
        return unnoticed_text(self.not_asked, self.heard_s, self.earlier_walks)

    def __repr__(self) -> str:
        said = [f"{cell.cell} is {cell.word}" for cell in self.cells if cell.is_conspicuous]
        named, more = said[:_MOST_NAMED], len(said) - _MOST_NAMED
        lines = [f"{len(self.cells)} cells, {len(said)} conspicuous; print it for the reasons"]
        return "\n".join([*lines, *named, *[f"and {more} more"] * (more > 0)])

    def __str__(self) -> str:
        return "\n".join(terminal_lines(document_of(self)))

    def _repr_html_(self) -> str:
        return f'<pre style="white-space:pre-wrap">{html_text(str(self))}</pre>'

    def seconds(self, finding: Finding) -> float | None:
        """Time of a finding since its run began; None for one about the whole run."""
        if not finding.t_ns:
            return None
        return (finding.t_ns - self.run_of[id(finding)].meta.started_ns) / 1e9

    @property
    def has_several_runs(self) -> bool:
        """Whether reasons name their run."""
        return len({id(run) for runs in self.runs.values() for run in runs}) > 1


def assess_runs(
    runs: Sequence[Run],
    baseline: Baseline | None = None,
    database: CellDb | None = None,
    progress: Progress | None = None,
    several: Several = NOWHERE_ELSE,
) -> Suspicions:
    """Apply all rules to each run; findings of one cell in several runs count together.

    Without a `baseline` each run is compared with the earlier walks known when it was recorded.
    `several` are the identities that other places name too.
    """
    baselines = {id(run): baseline or baseline_of(run) for run in runs}
    findings: dict[str, list[Finding]] = {}
    named_by: dict[str, list[Run]] = {}
    run_of: dict[int, Run] = {}
    not_asked: list[dict[str, tuple[str, ...]]] = []
    earlier_walks: list[int] = []
    heard_s: list[float] = []
    failures: dict[str, Failure] = {}
    checked: Iterable[SuspicionTracker] = (track(run, baselines[id(run)]) for run in runs)
    if progress is not None:
        names = [run.name for run in runs]
        checked = progress(checked, "checking", len(names), names)
    for run, tracker in zip(runs, checked, strict=True):
        failures = failures_of(tracker) | failures
        if database is not None:
            tracker.capabilities.serve("cell database")
        for cell in tracker.assessments():
            findings.setdefault(cell.cell, []).extend(cell.findings)
            named_by.setdefault(cell.cell, []).append(run)
            run_of |= {id(finding): run for finding in cell.findings}
        not_asked.append(tracker.capabilities.not_asked(ALL_RULES))
        earlier_walks.append(tracker.earlier_walks)
        heard_s.append(tracker.capabilities.heard_s)
    for finding in findings_at_desk([in_several_places], several):
        if finding.cell in findings:
            findings[finding.cell].append(finding)
    if database is not None:
        desk = _Desk(runs, list(findings), database, progress)
        for finding in findings_at_desk(DATABASE_RULES, desk):
            is_trusted = any(one.trust_note(finding.cell) is not None for one in baselines.values())
            if finding.cell in findings and not is_trusted:
                findings[finding.cell].append(finding)
    cells = by_word([assess(name, found) for name, found in findings.items()])
    everywhere = set(not_asked[0]).intersection(*not_asked)
    missing = {rule: needs for rule, needs in not_asked[0].items() if rule in everywhere}
    return Suspicions(
        tuple(cells), named_by, run_of, missing, failures, max(heard_s), min(earlier_walks)
    )


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


def conspicuous_first(
    result: Result, progress: Progress | None = None, several: Several = NOWHERE_ELSE
) -> tuple[Result, tuple[str, ...]]:
    """The result with words, unusual cells first, and their reasons among the warnings.

    Then come the cells heard in `several` places. Also returns the names of both, the most
    suspicious first.
    """
    there = {cell.cell for cell in result.cells}
    runs = [observed.run for observed in result.runs]
    suspicions = assess_runs(runs, progress=progress, several=several)
    unusual = _conspicuous(suspicions, there)
    first = [*(cell.cell for cell in unusual), *(cell for cell in several if cell in there)]
    rank = {cell: i for i, cell in enumerate(dict.fromkeys(first))}
    failures = suspicions.failures
    cells = [
        _with_failure(cell, failures[cell.cell]) if cell.cell in failures else cell
        for cell in sorted(result.cells, key=lambda cell: rank.get(cell.cell, len(rank)))
    ]
    of_none = [failures[""].reason] if "" in failures else []
    lines = [reason_line(cell.cell, cell) for cell in unusual]
    warnings = (*lines, *of_none, *result.warnings)
    words = {cell.cell: cell for cell in suspicions.cells}
    cells = [
        replace(cell, warnings=(*cell.warnings, several_text(several[cell.cell])))
        if cell.cell in several
        else cell
        for cell in cells
    ]
    result = replace(
        result,
        cells=tuple(cells),
        warnings=warnings,
        words=words,
        not_asked=suspicions.not_asked,
        unnoticed=suspicions.unnoticed_text,
    )
    return result, tuple(rank)


def _with_failure(cell: CellResult, why: Failure) -> CellResult:
    """The result of a cell for which a rule failed: its estimate stands."""
    return replace(cell, warnings=(*cell.warnings, why.reason), error=cell.error or why.error)


def conspicuous_cells(runs: Sequence[Run], among: Collection[str]) -> list[answer.Word]:
    """The suspicious and unusual cells `among` these names, the most suspicious first."""
    return _conspicuous(assess_runs(runs), among)


def _conspicuous(suspicions: Suspicions, among: Collection[str]) -> list[answer.Word]:
    return [cell for cell in suspicions.cells if cell.is_conspicuous and cell.cell in among]


_NEVER = "A word is no accusation: it is a reason to walk there."


def document_of(suspicions: Suspicions, *, details: bool = False) -> Document:
    """Cells with a word or a warning and their reasons, then the others and what was not asked.

    With `details` the rules by their ids.
    """
    errors = {cell: failed.error for cell, failed in suspicions.failures.items()}
    is_of_several = suspicions.has_several_runs
    cells = [
        {
            "cell": cell.cell,
            "word": cell.word,
            "score_nats": round(cell.score_nats, 3),
            "false_alarms_per_hour": round(false_alarms_per_hour(cell.word), 4),
            "findings": [_content(suspicions, finding) for finding in cell.findings],
            "error": errors.get(cell.cell),
        }
        | ({"runs": [run.name for run in suspicions.runs[cell.cell]]} if is_of_several else {})
        for cell in suspicions.cells
    ]
    content = {
        "cells": cells,
        "not_asked": suspicions.not_asked,
        "earlier_walks": suspicions.earlier_walks,
        "unnoticed": suspicions.unnoticed_text,
        "errors": errors,
    }
    return Document(content, body=_lines(suspicions, details=details))


# by the `id` of the run
_Ends = Mapping[int, Mapping[str, tuple[int, int]]]


def _heard_text(suspicions: Suspicions, cell: str, ends_of: _Ends) -> str:
    runs = suspicions.runs[cell]
    known_ns = [at_ns for run in runs for at_ns in ends_of[id(run)].get(cell, ())]
    return runs_text([run.name for run in runs], *first_and_last_utc(known_ns))


def _lines(suspicions: Suspicions, *, details: bool) -> Iterator[str | Line]:
    named = [cell for cell in suspicions.cells if cell.is_conspicuous]
    warned = [
        cell
        for cell in suspicions.cells
        if cell not in named and any(finding.rule.strength == "warns" for finding in cell.findings)
    ]
    runs = {id(run): run for cell in (*named, *warned) for run in suspicions.runs[cell.cell]}
    is_of_several = suspicions.has_several_runs
    ends_of = {key: heard_utc_ns([run]) for key, run in runs.items()} if is_of_several else {}
    for cell in (*named, *warned):
        yield Line((f"{cell.cell}: ", Word(cell.word)))
        if cell.is_conspicuous:
            yield Line(word_rate_text(cell.word), bullet="  ")
        if is_of_several:
            heard = _heard_text(suspicions, cell.cell, ends_of)
            yield Line(f"heard in {heard}", bullet="  ")
        for finding in sentences(cell.findings):
            rule = f" [{finding.rule.id}]" if details else ""
            yield Line(f"{reason_text(suspicions, finding)}{rule}", bullet="  - ")
        yield ""
    others = len(suspicions.cells) - len(named) - len(warned)
    if others:
        kept = f"{others} {'other ' if named or warned else ''}cell{'s' * (others != 1)}"
        yield f"{kept}: nothing unusual"
    for cell_name, failed in suspicions.failures.items():
        where = f"{cell_name}: " if cell_name else ""
        yield Line(f"{where}{failed.reason}", "red")
    if not suspicions.cells:
        yield "no cell with an identity was named by two scans, so no rule was asked"
    if suspicions.not_asked:
        yield f"not checked, as these were missing: {not_asked_text(suspicions, details=details)}"
    yield suspicions.unnoticed_text
    yield _NEVER


def not_asked_text(suspicions: Suspicions, *, details: bool) -> str:
    """What was missing, with `details` for which rules."""
    by_need: dict[str, list[str]] = {}
    for rule, needs in suspicions.not_asked.items():
        by_need.setdefault(", ".join(needs), []).append(rule)
    if details:
        return "; ".join(f"{need} ({', '.join(rules)})" for need, rules in by_need.items())
    return ", ".join(
        dict.fromkeys(need for needs in suspicions.not_asked.values() for need in needs)
    )


def reason_text(suspicions: Suspicions, finding: Finding) -> str:
    """A finding with time, place, what else explains it, and its rate."""
    rule = finding.rule
    where = "" if finding.lat_deg is None else f", {finding.lat_deg:.5f} {finding.lon_deg:.5f}"
    seconds = suspicions.seconds(finding)
    of = ""
    if suspicions.has_several_runs and seconds is not None:
        of = f" of {suspicions.run_of[id(finding)].name}"
    when = "" if seconds is None else f" ({seconds:.0f} s{of}{where})"
    also = f"Also seen with: {rule.harmless}"
    return f"{finding.text}{when}. {also}. {rule.rate_text(finding.nats)}"


def _content(suspicions: Suspicions, finding: Finding) -> Mapping[str, object]:
    """Place and seconds since the run began are None for a reason about the whole run."""
    seconds = suspicions.seconds(finding)
    return {
        "rule": finding.rule.id,
        "family": finding.rule.family,
        "text": finding.text,
        "t_s": None if seconds is None else round(seconds, 3),
        "lat": finding.lat_deg,
        "lon": finding.lon_deg,
        "evidence": finding.evidence,
    }


def document_of_rules() -> Document:
    """All rules with their needs and rates, and what each family of modems lets them ask."""
    content = [
        {"rule": rule.id, "family": rule.family, "needs": rule.needs, "text": rule.text}
        for rule in ALL_RULES
    ]
    lines = (Line(rule.text, bullet="  - ") for rule in ALL_RULES)
    return Document(content, body=[*lines, "", *table_of_sources()])


_OF_USER: tuple[Need, ...] = ("position", "other cells", "earlier walks", "cell database")
"""What comes from a receiver, a place or files."""
_GENERATIONS = {"GSM": "2", "WCDMA": "3", "NR": "5"}
"""By technology; of others it is 4."""
FILE = "csv"
"""The source that is a file: `docs/guide/formats.md`."""


def table_of_sources() -> tuple[str | Table, ...]:
    """Which rules can be asked of cells of which generations, by driver and of an imported file."""
    from logger.drivers.registry import FAMILIES  # noqa: PLC0415 (every driver, for this table)

    of_file = cells_with("neighbours", "neighbour lists", "timing advance")
    gives = {name: family.gives for name, family in FAMILIES.items()} | {
        FILE: dict.fromkeys(("GSM", "WCDMA", "LTE", "NR"), of_file)
    }
    sources = {name: Capabilities(given) for name, given in gives.items()}
    for source in sources.values():
        for need in _OF_USER:
            source.serve(need)
    rows: dict[tuple[str, ...], list[str]] = {}
    for rule in ALL_RULES:
        asked = (source.technologies(rule) for source in sources.values())
        cells = ("".join(sorted({_GENERATIONS.get(rat, "4") for rat in rats})) for rats in asked)
        rows.setdefault(tuple(cells), []).append(rule.id)
    names = [name.replace("_", " ") for name in sources]
    table = Table(
        [Column("rules"), *map(Column, names)],
        [(" ".join(rules), *cells) for cells, rules in rows.items()],
    )
    unfed = [" ".join(rules) for cells, rules in rows.items() if not any(cells)]
    said = "Generations (2 to 5) of cells of which each rule can be asked, by the modem's driver"
    return f"{said}:", table, *(f"No source serves {rules}." for rules in unfed)
