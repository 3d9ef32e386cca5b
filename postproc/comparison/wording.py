"""Sentences of a comparison, for the terminal and the page."""

from postproc.comparison.changes import FALSE_WORDS, CellChange
from postproc.comparison.ground import BLOCK_M
from postproc.comparison.run_pair import ComparedRuns


def headline(compared: ComparedRuns) -> str:
    """How many cells changed, of how many that could be compared."""
    cells = compared.comparison.cells
    n_changed = sum(cell.is_change for cell in cells)
    n_comparable = sum(cell.word != "not comparable" for cell in cells)
    changed = f"{n_changed or 'No'} cell{'s' * (n_changed != 1)} changed"
    return f"{changed}, of {n_comparable} that could be compared and {len(cells)} heard"


def ground_text(compared: ComparedRuns) -> str:
    """Common ground and offsets of the modems."""
    comparison = compared.comparison
    modems = "the same modem" if compared.same_modem else "two modems, or one that is not known"
    offsets = ", ".join(
        f"{db:+.1f} dB ({rat or 'unknown technology'})" for rat, db in comparison.offset_db.items()
    )
    return (
        f"Common ground: {comparison.n_common_blocks} blocks of {BLOCK_M:.0f} m. "
        f"Recorded with {modems}; offset of B against A: {offsets or 'not known'}."
    )


def chance_text() -> str:
    """The rate of false words, and what no test excludes."""
    return (
        f"Where nothing changed, at most {FALSE_WORDS:.0%} of pairs of walks get any such word by "
        "chance. Operators change their cells too: a change is a reason to look, not a proof."
    )


def change_text(cell: CellChange) -> str:
    """Change of the level with its standard deviation, or a dash."""
    if cell.change_db is None or cell.sigma_db is None:
        return "–"
    return f"{cell.change_db:+.1f} ± {cell.sigma_db:.1f}"
