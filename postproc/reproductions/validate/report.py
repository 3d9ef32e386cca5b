"""The checks as a table, as JSON, and as a page of Markdown."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby

from postproc.reproductions.validate.check import VERDICTS, Check, Verdict
from postproc.terminal import print_text, screen, styled_text

_STYLES: dict[Verdict, str] = {
    "holds": "green",
    "does not hold": "yellow",
    "claim is wrong": "magenta",
    "fails": "bold red",
}
_INTRODUCTION = """\
# The specification, checked

Printed by `postproc validate --page`; a test compares this page with the output of the command. The
claims are those of the specification's checklist ("EKF Implementation Validation") and of its
derivation document. The reference EKF is the filter they describe; cellwalk is the locator of this
project. Errors are medians over simulated runs. What the checklist requires of an Android
application (service, permissions, map, battery) has no counterpart here and is left out.
"""


def print_checks(checks: Sequence[Check]) -> None:
    """By topic: verdict and claim, and what we measured."""
    console = screen()
    for topic, of_topic in groupby(checks, key=lambda check: check.topic):
        print_text(console, topic, "bold")
        for check in of_topic:
            head = styled_text((f"{check.verdict}: ", _STYLES[check.verdict]), (check.claim, ""))
            print_text(console, head, bullet="  ")
            print_text(console, f"measured: {check.measured}", bullet="    ")
    print_text(console, _summary(checks))


def as_json(checks: Sequence[Check]) -> str:
    """All fields of all checks, and how often each verdict was given."""
    values = {"checks": [asdict(check) for check in checks], "verdicts": _by_verdict(checks)}
    return json.dumps(values, indent=2)


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
