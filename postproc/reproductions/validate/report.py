"""The checks as a table, as JSON, and as the page VALIDATION.md."""

import json
from collections import Counter
from dataclasses import asdict

from postproc.reproductions.validate.check import VERDICTS, Check, Verdict
from postproc.terminal import say, screen, styled

_STYLES: dict[Verdict, str] = {
    "holds": "green",
    "does not hold": "yellow",
    "claim is wrong": "magenta",
    "fails": "bold red",
}
_INTRODUCTION = """\
# The specification, checked

Written by `postproc validate --page`; a test compares it with what the command prints. The claims are those of the
specification's checklist ("EKF Implementation Validation") and of its derivation document. The reference EKF is the
filter they describe; cellwalk is the locator of this project. Errors are medians over simulated runs. What the
checklist asks of an Android application (service, permissions, map, battery) has no counterpart here and is left out.
"""


def print_checks(found: list[Check]) -> None:
    """By topic: verdict and claim, and what we measured."""
    console = screen()
    topic = ""
    for check in found:
        if check.topic != topic:
            say(console, check.topic, "bold")
        topic = check.topic
        head = styled((f"{check.verdict}: ", _STYLES[check.verdict]), (check.claim, ""))
        say(console, head, bullet="  ")
        say(console, f"measured: {check.measured}", bullet="    ")
    say(console, _counts(found))


def as_json(found: list[Check]) -> str:
    """All fields of all checks."""
    return json.dumps(
        {"checks": [asdict(check) for check in found], "verdicts": _by_verdict(found)}, indent=2
    )


def page(found: list[Check]) -> str:
    """The page; figures of this machine are left out."""
    lines = [
        _INTRODUCTION,
        *(f"- **{verdict}**: {meaning}" for verdict, meaning in VERDICTS.items()),
    ]
    topic = ""
    for check in found:
        if check.topic != topic:
            lines += [
                "",
                f"## {check.topic}",
                "",
                "| claim | what we measured | verdict |",
                "|---|---|---|",
            ]
            topic = check.topic
        lines.append(f"| {_cell(check.claim)} | {_cell(_lasting(check))} | {check.verdict} |")
    return "\n".join([*lines, "", _counts(found), ""])


def _lasting(check: Check) -> str:
    return "differs by machine: see the command" if check.is_timed else check.measured


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*")


def _by_verdict(found: list[Check]) -> dict[str, int]:
    counted = Counter(check.verdict for check in found)
    return {verdict: counted[verdict] for verdict in VERDICTS}


def _counts(found: list[Check]) -> str:
    return f"{len(found)} checks: " + ", ".join(
        f"{count} {verdict}" for verdict, count in _by_verdict(found).items()
    )
