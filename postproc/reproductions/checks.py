"""One list for all that is reproduced: what a document claims, what we measured, the verdict."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from typing import Literal, get_args

from postproc.json_text import Json, as_json
from postproc.terminal import print_text, screen, styled_text

Verdict = Literal["holds", "does not hold", "claim is wrong", "fails"]
"""The claim is true here; it was promised, and measured otherwise; calculation contradicts it, so
that our value stands; our own code is at fault, and the command ends with 1.
"""

_STYLES: dict[Verdict, str] = {
    "holds": "green",
    "does not hold": "yellow",
    "claim is wrong": "magenta",
    "fails": "bold red",
}


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


def print_checks(checks: Sequence[Check]) -> None:
    """By topic: verdict and claim, and what we measured."""
    console = screen()
    for topic, of_topic in groupby(checks, key=lambda check: check.topic):
        print_text(console, topic, "bold")
        for check in of_topic:
            head = styled_text((f"{check.verdict}: ", _STYLES[check.verdict]), (check.claim, ""))
            print_text(console, head, bullet="  ")
            print_text(console, f"measured: {check.measured}", bullet="    ")
    counts = ", ".join(f"{n} {verdict}" for verdict, n in _by_verdict(checks).items())
    print_text(console, f"{len(checks)} checks: {counts}")


def json_text(checks: Sequence[Check], figures: Json) -> str:
    """The figures, all fields of all checks, and how often each verdict was given."""
    of_checks = {"checks": [asdict(check) for check in checks], "verdicts": _by_verdict(checks)}
    return as_json({**figures, **of_checks})


def exit_code(checks: Sequence[Check]) -> int:
    """1 where our own code fails."""
    return int(any(check.verdict == "fails" for check in checks))


def _by_verdict(checks: Sequence[Check]) -> dict[Verdict, int]:
    count = Counter(check.verdict for check in checks)
    return {verdict: count[verdict] for verdict in get_args(Verdict)}
