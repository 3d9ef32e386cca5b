"""`postproc suspect --json`."""

from collections.abc import Mapping, Sequence

import msgspec

from logger.core.suspicion.rule import Finding, Value, Word
from logger.core.suspicion.words import false_alarms_per_hour
from postproc.suspicion.run_assessment import Suspicions


class FindingJson(msgspec.Struct, frozen=True):
    """One reason: `t_s` in seconds since the run began, `lat` and `lon` degrees (WGS 84).

    They are null for a reason that is about the whole run.
    """

    rule: str
    family: str
    text: str
    t_s: float | None
    lat: float | None
    lon: float | None
    evidence: Mapping[str, Value]


class CellJson(msgspec.Struct, frozen=True):
    """One cell; `false_alarms_per_hour` is the rate at which legitimate cells earn its word.

    `error` is that of a rule that failed for it, which is one of the program.
    """

    cell: str
    word: Word
    score_nats: float
    false_alarms_per_hour: float
    findings: Sequence[FindingJson]
    error: str | None = None


class SuspicionsJson(msgspec.Struct, frozen=True):
    """All cells, the most suspicious first, and the rules that were not asked with their needs.

    `errors` are those of rules that failed, by cell; the name of none is empty.
    """

    cells: Sequence[CellJson]
    not_asked: Mapping[str, Sequence[str]]
    errors: Mapping[str, str | None]


def as_json(suspicions: Suspicions) -> bytes:
    """The result as JSON."""
    errors = {cell: failure.error for cell, failure in suspicions.failures.items()}
    cells = [
        CellJson(
            cell.cell,
            cell.word,
            round(cell.score_nats, 3),
            round(false_alarms_per_hour(cell.word), 4),
            [_finding(suspicions, finding) for finding in cell.findings],
            errors.get(cell.cell),
        )
        for cell in suspicions.cells
    ]
    return msgspec.json.encode(SuspicionsJson(cells, suspicions.not_asked, errors))


def _finding(suspicions: Suspicions, finding: Finding) -> FindingJson:
    seconds = suspicions.seconds(finding)
    return FindingJson(
        finding.rule.id,
        finding.rule.family,
        finding.text,
        None if seconds is None else round(seconds, 3),
        finding.lat_deg,
        finding.lon_deg,
        finding.evidence,
    )
