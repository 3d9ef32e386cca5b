"""Findings as events of the run, so that `postproc replay` can compare them."""

from collections.abc import Iterable, Iterator

from logger.core.suspicion.finding import Finding
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import Assessment
from logger.core.types import Level, Note

RULES_CODE, FINDING_CODE, ERROR_CODE = "rules", "finding", "rule-failed"
"""Codes of the events: that rules are applied, each finding, and the error of a rule."""
VERSION = 6
"""Of the rules: raised when a rule or a rate changes, as older runs then replay differently."""


def start_note() -> Note:
    """The event before the first finding: which rules are applied."""
    return Note("info", RULES_CODE, f"version {VERSION}: {' '.join(RULES)}")


def finding_notes(findings: Iterable[Finding], of: Iterable[Assessment]) -> Iterator[Note]:
    """An event for each finding, with the word and the score of its cell after it."""
    for finding, cell in zip(findings, of, strict=True):
        level: Level = "warning" if cell.word == "suspicious" else "info"
        score = f"{cell.word}, {cell.score_nats!r} nats"
        text = f"{finding.cell}: {score}: {finding.rule} {finding.text}"
        yield Note(level, FINDING_CODE, text)


def error_notes(errors: Iterable[tuple[str, str]]) -> Iterator[Note]:
    """An event for each cell with the error of a rule; the name of none is empty."""
    for cell, text in errors:
        of = f"{cell}: " if cell else ""
        yield Note("warning", ERROR_CODE, f"{of}a rule of suspicion failed: {text}")
