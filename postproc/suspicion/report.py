"""What `postproc suspect` says: the words of all cells with their reasons."""

from collections.abc import Iterator, Mapping

from logger.core.document import Document, Line, Word
from logger.core.suspicion.rule import Finding
from logger.core.suspicion.words import (
    Assessment,
    false_alarms_per_hour,
    sentences,
    word_rate_text,
)
from postproc.suspicion.run_assessment import ALL_RULES, Suspicions

_NEVER = (
    "A word is no accusation: it is a reason to walk there. Telephones in cars gave the rates; a "
    "cell that copies another in everything stays unnoticed."
)


def document_of(suspicions: Suspicions) -> Document:
    """Cells with a word or a warning and their reasons, then the others and what was not asked."""
    errors = {cell: failure.error for cell, failure in suspicions.failures.items()}
    cells = [
        {
            "cell": cell.cell,
            "word": cell.word,
            "score_nats": round(cell.score_nats, 3),
            "false_alarms_per_hour": round(false_alarms_per_hour(cell.word), 4),
            "findings": [_content(suspicions, finding) for finding in cell.findings],
            "error": errors.get(cell.cell),
        }
        for cell in suspicions.cells
    ]
    content = {"cells": cells, "not_asked": suspicions.not_asked, "errors": errors}
    return Document(content, body=_lines(suspicions))


def _lines(suspicions: Suspicions) -> Iterator[str | Line]:
    named = [cell for cell in suspicions.cells if cell.word != "nothing unusual"]
    warned = [cell for cell in suspicions.cells if cell not in named and _has_warning(cell)]
    for cell in (*named, *warned):
        yield Line((f"{cell.cell}: ", Word(cell.word)))
        if cell.word != "nothing unusual":
            yield Line(word_rate_text(cell.word), bullet="  ")
        for finding in sentences(cell.findings):
            yield Line(reason_text(suspicions, finding), bullet="  - ")
        yield ""
    others = len(suspicions.cells) - len(named) - len(warned)
    if others:
        kept = f"{others} {'other ' if named or warned else ''}cell{'s' * (others != 1)}"
        yield f"{kept}: nothing unusual"
    for cell_name, failure in suspicions.failures.items():
        where = f"{cell_name}: " if cell_name else ""
        yield Line(f"{where}{failure.reason}", "red")
    if not suspicions.cells:
        yield "no cell was named by two scans"
    if suspicions.not_asked:
        yield f"not asked: {not_asked_text(suspicions)}"
    yield _NEVER


def not_asked_text(suspicions: Suspicions) -> str:
    """Rules that were not asked, by what was missing."""
    by_need: dict[str, list[str]] = {}
    for rule, needs in suspicions.not_asked.items():
        by_need.setdefault(", ".join(needs), []).append(rule)
    return "; ".join(f"{', '.join(rules)} (no {need})" for need, rules in by_need.items())


def _has_warning(cell: Assessment) -> bool:
    return any(finding.rule.strength == "warns" for finding in cell.findings)


def reason_text(suspicions: Suspicions, finding: Finding) -> str:
    """A finding with time, place, what else explains it, and its rate."""
    rule = finding.rule
    where = "" if finding.lat_deg is None else f", {finding.lat_deg:.5f} {finding.lon_deg:.5f}"
    seconds = suspicions.seconds(finding)
    when = "" if seconds is None else f" ({seconds:.0f} s{where})"
    return (
        f"{finding.text}{when}. Also seen with: {rule.harmless}. "
        f"{rule.rate_text(finding.nats)} [{rule.id}]"
    )


def _content(suspicions: Suspicions, finding: Finding) -> Mapping[str, object]:
    """One reason in JSON: seconds since the run began and a place, None of one about the run."""
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
    """All rules with their needs and rates."""
    texts = [rule.text for rule in ALL_RULES]
    return Document(texts, body=[Line(text, bullet="  - ") for text in texts])
