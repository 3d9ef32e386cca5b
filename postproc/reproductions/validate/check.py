"""One line of the table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

Verdict = Literal["holds", "does not hold", "claim is wrong", "fails"]

VERDICTS: dict[Verdict, str] = {
    "holds": "the claim is true here",
    "does not hold": "promised of the filter or of the geometry, and measured otherwise",
    "claim is wrong": "calculation contradicts it; our measured value is right and is kept",
    "fails": "our own code is at fault (the command then ends with 1)",
}


@dataclass(frozen=True, slots=True)
class Check:
    """A claim, what we measured, and the verdict.

    `is_sampled` where the figure comes from simulated runs, so that fewer runs give another one;
    `is_timed` where it is a time or a size of this machine.
    """

    topic: str
    claim: str
    measured: str
    verdict: Verdict
    is_sampled: bool = False
    is_timed: bool = False


class Effort(NamedTuple):
    """Number of simulated circles and scenarios behind a figure, and of timed readings."""

    circles: int
    scenarios: int
    timed: int


Group = Callable[[Effort], list[Check]]


class Line(NamedTuple):
    """A check without its topic."""

    claim: str
    measured: str
    verdict: Verdict


def checks_of(
    topic: str, *lines: Line, is_sampled: bool = False, is_timed: bool = False
) -> list[Check]:
    """The checks of one topic."""
    return [Check(topic, *line, is_sampled, is_timed) for line in lines]


def ours(right: bool) -> Verdict:
    """Verdict on a claim that our code has to meet."""
    return "holds" if right else "fails"


def theirs(reached: bool) -> Verdict:
    """Verdict on what the specification promises of its filter."""
    return "holds" if reached else "does not hold"


def wrong(right: bool) -> Verdict:
    """Verdict on a wrong claim, where `right` is whether our own value is right."""
    return "claim is wrong" if right else "fails"
