"""The words of all cells in a terminal."""

from rich.console import Console

from logger.core.suspicion.rule import Finding, Word
from logger.core.suspicion.words import Assessment, sentences, word_rate_text
from postproc.suspicion.run_assessment import Suspicions
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
