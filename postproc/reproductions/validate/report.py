"""What the checks say, and the page VALIDATION.md."""

from collections import Counter
from collections.abc import Sequence
from itertools import groupby

from logger.core.document import Document, Line, Part, Word
from postproc.reproductions.validate.check import VERDICTS, Check, Verdict

_INTRODUCTION = """\
# The specification, checked

Printed by `postproc validate --page`; a test compares this page with the output of the command. The
claims are those of the specification's checklist ("EKF Implementation Validation") and of its
derivation document. The reference EKF is the filter they describe; cellwalk is the locator of this
project. Errors are medians over simulated runs. What the checklist requires of an Android
application (service, permissions, map, battery) has no counterpart here and is left out.
"""


def document_of(checks: Sequence[Check]) -> Document:
    """By topic: verdict and claim, and what we measured; and how often each verdict was given."""
    body: list[Part] = []
    for topic, of_topic in groupby(checks, key=lambda check: check.topic):
        body.append(Line(topic, "bold"))
        for check in of_topic:
            body.append(Line((Word(check.verdict), f": {check.claim}"), bullet="  "))
            body.append(Line(f"measured: {check.measured}", bullet="    "))
    content = {"checks": checks, "verdicts": _by_verdict(checks)}
    return Document(content, body=[*body, _summary(checks)])


def page(checks: Sequence[Check]) -> str:
    """The page; figures of this machine are left out."""
    lines = [_INTRODUCTION]
    lines += [f"- **{verdict}**: {meaning}" for verdict, meaning in VERDICTS.items()]
    for topic, of_topic in groupby(checks, key=lambda check: check.topic):
        lines += ["", f"## {topic}", "", "| claim | what we measured | verdict |", "|---|---|---|"]
        lines += [row(check) for check in of_topic]
    return "\n".join([*lines, "", _summary(checks), ""])


def row(check: Check) -> str:
    """One line of the page's table."""
    measured = "differs by machine: see the command" if check.is_timed else check.measured
    return f"| {_escape(check.claim)} | {_escape(measured)} | {check.verdict} |"


def _escape(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*")


def _by_verdict(checks: Sequence[Check]) -> dict[Verdict, int]:
    count = Counter(check.verdict for check in checks)
    return {verdict: count[verdict] for verdict in VERDICTS}


def _summary(checks: Sequence[Check]) -> str:
    counts = (f"{count} {verdict}" for verdict, count in _by_verdict(checks).items())
    return f"{len(checks)} checks: {', '.join(counts)}"
