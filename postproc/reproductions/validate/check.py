"""One line of the table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

Verdict = Literal["holds", "does not hold", "claim is wrong", "fails"]

VERDICTS: dict[Verdict, str] = {
    "holds": "it is so here",
    "does not hold": "it was promised of the filter or of the geometry, and measured otherwise",
    "claim is wrong": "calculation contradicts it; what we measured is right and is kept",
    "fails": "our own code is at fault (the command then ends with 1)",
}


@dataclass(frozen=True, slots=True)
class Check:
    """A claim, what we measured, and the verdict.

    `is_sampled` where simulated runs stand behind the figure, so that fewer runs give another one;
    `is_timed` where it is a time or a size of this machine.
    """

    topic: str
    claim: str
    measured: str
    verdict: Verdict
    is_sampled: bool = False
    is_timed: bool = False


class Effort(NamedTuple):
    """How many simulated circles and scenarios stand behind a figure, and how many readings are
    timed.
    """

    circles: int
    scenarios: int
    timed: int


Group = Callable[[Effort], list[Check]]


def ours(right: bool) -> Verdict:
    """Verdict on a claim that our code has to meet."""
    return "holds" if right else "fails"


def promised(reached: bool) -> Verdict:
    """Verdict on what somebody else's filter was promised to do."""
    return "holds" if reached else "does not hold"


def wrong(right: bool) -> Verdict:
    """Verdict on a wrong claim, where `right` tells whether our own value is right."""
    return "claim is wrong" if right else "fails"
