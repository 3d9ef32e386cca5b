"""Results with the most suspicious cell first, and the reasons before everything else."""

from collections.abc import Collection, Sequence
from dataclasses import replace

from logger.core.runfile import Run
from logger.core.suspicion.words import Assessment, sentences
from postproc.cell_work import Failure
from postproc.result import CellResult, Result
from postproc.suspicion.run_assessment import Suspicions, assess_runs

_MOST_REASONS = 3
"""For each cell: `postproc suspect` prints all of them."""


def order_by_word(result: Result) -> Result:
    """The result with suspicious and unusual cells first and their reasons among the warnings."""
    return conspicuous_first(result)[0]


def conspicuous_first(result: Result) -> tuple[Result, tuple[str, ...]]:
    """As `order_by_word`, and the suspicious and unusual cells, the most suspicious first."""
    there = {cell.cell for cell in result.cells}
    suspicions = assess_runs([observed.run for observed in result.runs])
    unusual = _conspicuous(suspicions, there)
    rank = {cell.cell: i for i, cell in enumerate(unusual)}
    failures = suspicions.failures
    cells = [
        _with_failure(cell, failures[cell.cell]) if cell.cell in failures else cell
        for cell in sorted(result.cells, key=lambda cell: rank.get(cell.cell, len(rank)))
    ]
    of_none = [failures[""].reason] if "" in failures else []
    warnings = (*map(reason_line, unusual), *of_none, *result.warnings)
    return replace(result, cells=tuple(cells), warnings=warnings), tuple(rank)


def _with_failure(cell: CellResult, why: Failure) -> CellResult:
    """The result of a cell for which a rule failed: its estimate stands."""
    return replace(cell, warnings=(*cell.warnings, why.reason), error=cell.error or why.error)


def conspicuous_cells(runs: Sequence[Run], among: Collection[str]) -> list[Assessment]:
    """The suspicious and unusual cells `among` these names, the most suspicious first."""
    return _conspicuous(assess_runs(runs), among)


def _conspicuous(suspicions: Suspicions, among: Collection[str]) -> list[Assessment]:
    return [
        cell for cell in suspicions.cells if cell.word != "nothing unusual" and cell.cell in among
    ]


def reason_line(cell: Assessment) -> str:
    """A cell, its word, and its strongest reasons in one sentence."""
    strongest = sorted(sentences(cell.findings), key=lambda finding: -finding.nats)[:_MOST_REASONS]
    return f"{cell.cell} is {cell.word}: {'; '.join(finding.text for finding in strongest)}"
