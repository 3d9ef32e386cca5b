"""Results with the most suspicious cell first, and the reasons before everything else."""

from collections.abc import Collection, Sequence
from dataclasses import replace

from logger.core.runfile import Run
from logger.core.suspicion.words import Assessment, sentences
from postproc.result import Result
from postproc.suspicion.run_assessment import assess_runs

_MOST_REASONS = 3
"""For each cell: `postproc suspect` prints all of them."""


def order_by_word(result: Result) -> Result:
    """The result with suspicious and unusual cells first and their reasons among the warnings."""
    return conspicuous_first(result)[0]


def conspicuous_first(result: Result) -> tuple[Result, tuple[str, ...]]:
    """As `order_by_word`, and the suspicious and unusual cells, the most suspicious first."""
    there = {cell.cell for cell in result.cells}
    unusual = conspicuous_cells([observed.run for observed in result.runs], there)
    rank = {cell.cell: i for i, cell in enumerate(unusual)}
    cells = sorted(result.cells, key=lambda cell: rank.get(cell.cell, len(rank)))
    warnings = (*map(reason_line, unusual), *result.warnings)
    return replace(result, cells=tuple(cells), warnings=warnings), tuple(rank)


def conspicuous_cells(runs: Sequence[Run], among: Collection[str]) -> list[Assessment]:
    """The suspicious and unusual cells `among` these names, the most suspicious first."""
    cells = assess_runs(runs).cells
    return [cell for cell in cells if cell.word != "nothing unusual" and cell.cell in among]


def reason_line(cell: Assessment) -> str:
    """A cell, its word, and its strongest reasons in one sentence."""
    strongest = sorted(sentences(cell.findings), key=lambda finding: -finding.nats)[:_MOST_REASONS]
    return f"{cell.cell} is {cell.word}: {'; '.join(finding.text for finding in strongest)}"
