"""One list for all that is reproduced: what a document claims, what we measured, the verdict."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, Literal, get_args

from logger.core.document import Document, Line, Part, Word

Json = dict[str, Any]

Verdict = Literal["holds", "does not hold", "claim is wrong", "fails"]
"""The claim is true here; it was promised, and measured otherwise; calculation contradicts it, so
that our value stands; our own code is at fault, and the command ends with 1.
"""


@dataclass(frozen=True, slots=True)
class Check:
    """A claim, what we measured, and the verdict; `topic` is set by `under`."""

    claim: str
    measured: str
    verdict: Verdict
    topic: str = ""


def under(topic: str, *checks: Check) -> list[Check]:
    """The checks of one topic."""
    return [replace(check, topic=topic) for check in checks]


def ours(right: bool) -> Verdict:
    """Verdict on a claim that our code has to meet."""
    return "holds" if right else "fails"


def theirs(reached: bool) -> Verdict:
    """Verdict on what a document promises of its own method."""
    return "holds" if reached else "does not hold"


def wrong(right: bool) -> Verdict:
    """Verdict on a wrong claim, where `right` is whether our own value is right."""
    return "claim is wrong" if right else "fails"


def document_of(checks: Sequence[Check], figures: Json) -> Document:
    """By topic: verdict and claim, and what we measured; the figures are in the JSON alone."""
    body: list[Part] = []
    for topic, of_topic in groupby(checks, key=lambda check: check.topic):
        body.append(Line(topic, "bold"))
        for check in of_topic:
            body.append(Line((Word(check.verdict), f": {check.claim}"), bullet="  "))
            body.append(Line(f"measured: {check.measured}", bullet="    "))
    counts = ", ".join(f"{n} {verdict}" for verdict, n in _by_verdict(checks).items())
    content = {**figures, "checks": checks, "verdicts": _by_verdict(checks)}
    return Document(content, body=[*body, f"{len(checks)} checks: {counts}"])


def exit_code(checks: Sequence[Check]) -> int:
    """1 where our own code fails."""
    return int(any(check.verdict == "fails" for check in checks))


def _by_verdict(checks: Sequence[Check]) -> dict[Verdict, int]:
    count = Counter(check.verdict for check in checks)
    return {verdict: count[verdict] for verdict in get_args(Verdict)}
