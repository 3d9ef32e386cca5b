"""The words of all cells in a terminal."""

from collections.abc import Iterator
from typing import Any

from rich.console import Console

from logger.core.suspicion.rule import ALL, Finding, Rule, Word
from logger.core.suspicion.rules import RULES, rules_version
from logger.core.suspicion.words import WORD_RATES, Assessment, sentences, word_rate_text
from postproc.suspicion.assessment import Suspicions
from postproc.suspicion.database_rules import DATABASE_RULES
from postproc.terminal import print_text, screen

_STYLES: dict[Word, str] = {"suspicious": "bold red", "unusual": "yellow", "nothing unusual": ""}
_NEVER = (
    "A word is no accusation: it is a reason to walk there. Telephones in cars gave the rates; a "
    "cell that copies another in everything stays unnoticed."
)


def print_suspicions(suspicions: Suspicions) -> None:
    """Cells with a word or a warning and their reasons, then the others and what was not asked."""
    console = screen()
    named = [cell for cell in suspicions.cells if cell.word != "nothing unusual"]
    warned = [cell for cell in suspicions.cells if cell not in named and _has_warning(cell)]
    for cell in (*named, *warned):
        _print_cell(console, suspicions, cell)
    others = len(suspicions.cells) - len(named) - len(warned)
    if others:
        kept = f"{others} {'other ' if named or warned else ''}cell{'s' * (others != 1)}"
        print_text(console, f"{kept}: nothing unusual")
    for cell_name, failure in suspicions.failures.items():
        where = f"{cell_name}: " if cell_name else ""
        print_text(console, f"{where}{failure.reason}", "red")
    if not suspicions.cells:
        print_text(console, "no cell was named by two scans")
    if suspicions.not_asked:
        print_text(console, f"not asked: {not_asked_text(suspicions)}")
    print_text(console, _NEVER)


def print_rules() -> None:
    """Each rule: what it says, when it is asked, what else explains it, how often it is wrong."""
    console = screen()
    print_text(console, f"rules of version {rules_version()}")
    for word in WORD_RATES:
        print_text(console, f"{word}: {word_rate_text(word)}", bullet="  - ")
    rules: list[Rule[Any, Any]] = [*RULES.values(), *DATABASE_RULES]
    for rule in rules:
        console.print()
        print_text(console, f"{rule.id} ({rule.family}): {rule.sentence}")
        for line in _rule_lines(rule):
            print_text(console, line, bullet="  - ")


def _rule_lines(rule: Rule[Any, Any]) -> Iterator[str]:
    yield f"Only where: {rule.gate}."
    rats = "" if rule.rats == ALL else f" of {' or '.join(sorted(rule.rats))}"
    yield f"Needs{rats}: {', '.join(rule.needs)}."
    yield f"Also seen with: {rule.harmless}."
    if rule.strength == "suffices":
        yield "Suffices without another family."
    by_logs: dict[str, list[str]] = {}
    for rat, rate in rule.measured.items():
        by_logs.setdefault(rate.where, []).append(f"{rat} {rate.text}")
    if rule.elsewhere is not None:
        by_logs.setdefault(rule.elsewhere.where, []).append(rule.elsewhere.text)
    for where, texts in by_logs.items():
        yield f"Wrong in {where}: {', '.join(texts)}."
    if not by_logs:
        yield rule.rate_text(0.0)


def not_asked_text(suspicions: Suspicions) -> str:
    """Rules that were not asked, by what was missing."""
    by_need: dict[str, list[str]] = {}
    for rule, needs in suspicions.not_asked.items():
        by_need.setdefault(", ".join(needs), []).append(rule)
    return "; ".join(f"{', '.join(rules)} (no {need})" for need, rules in by_need.items())


def _has_warning(cell: Assessment) -> bool:
    return any(finding.rule.strength == "warns" for finding in cell.findings)


def _print_cell(console: Console, suspicions: Suspicions, cell: Assessment) -> None:
    print_text(console, f"{cell.cell}: {cell.word}", _STYLES[cell.word])
    if cell.word != "nothing unusual":
        print_text(console, word_rate_text(cell.word), bullet="  ")
    for finding in sentences(cell.findings):
        print_text(console, reason_text(suspicions, finding), bullet="  - ")
    console.print()


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
