"""A comparison on the terminal."""

from postproc.comparison import wording
from postproc.comparison.run_pair import ComparedRuns
from postproc.terminal import print_text, screen, table


def print_comparison(compared: ComparedRuns, *, details: bool) -> None:
    """Cells that changed in words; with `details` every cell."""
    console = screen()
    print_text(console, f"A: {compared.a}\nB: {compared.b}")
    for warning in compared.warnings:
        print_text(console, warning, "yellow", bullet="note: ")
    print_text(console, f"{wording.headline(compared)}.", "bold")
    cells = compared.comparison.cells
    for cell in cells:
        if cell.is_change:
            print_text(console, f"{cell.cell} {cell.rat}: {cell.text}", bullet=f"{cell.word}: ")
    print_text(console, wording.ground_text(compared))
    print_text(console, wording.chance_text())
    for cell in cells:
        if cell.error:
            print_text(console, cell.text, "red", bullet=f"{cell.cell}: ")
    shown = [cell for cell in cells if details or cell.error or cell.word != "not comparable"]
    rows = [
        (
            cell.cell,
            cell.word,
            wording.change_text(cell),
            str(cell.n_blocks),
            f"{cell.n_a} / {cell.n_b}",
        )
        for cell in shown
    ]
    titles = ("cell", "word", "change dB", "blocks", "readings A / B")
    table(console, titles, rows, right=("change dB", "blocks", "readings A / B"))
    if details:
        for cell in cells:
            if not cell.is_change:
                print_text(console, cell.text, "dim", bullet=f"{cell.cell}: ")
    elif hidden := len(cells) - len(shown):
        print_text(console, f"{hidden} more could not be compared; -v has the reasons", "dim")
