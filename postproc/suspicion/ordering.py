"""Results with the most suspicious cell first, and the reasons before everything else."""

from dataclasses import replace

from logger.core.suspicion.words import Assessment
from postproc.result import Result
from postproc.suspicion.run_assessment import assess_runs

_MOST_REASONS = 3
"""For each cell: `postproc suspect` prints all of them."""


def order_by_word(result: Result) -> Result:
    """The result with suspicious and unusual cells first and their reasons among the warnings."""
    suspicions = assess_runs([observed.run for observed in result.runs])
    rank = {
        cell.cell: i for i, cell in enumerate(suspicions.cells) if cell.word != "nothing unusual"
    }
    there = {cell.cell for cell in result.cells}
    reasons = [
        reason_line(cell) for cell in suspicions.cells if cell.cell in rank and cell.cell in there
    ]
    last = len(rank)
    cells = sorted(result.cells, key=lambda cell: rank.get(cell.cell, last))
    return replace(result, cells=tuple(cells), warnings=(*reasons, *result.warnings))


def reason_line(cell: Assessment) -> str:
    """A cell, its word, and its strongest reasons in one sentence."""
    strongest = sorted(cell.findings, key=lambda finding: -finding.nats)[:_MOST_REASONS]
    return f"{cell.cell} is {cell.word}: {'; '.join(finding.text for finding in strongest)}"
