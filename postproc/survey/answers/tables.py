"""What `survey diff` prints."""

from dataclasses import asdict
from typing import Any

from postproc.comparison.changes import Comparison
from postproc.terminal import print_text, screen, table


def print_changes(compared: Comparison, *, details: bool) -> None:
    """Cells that changed in words, then those that could be compared; with `details` all."""
    console = screen()
    changed = [cell for cell in compared.cells if cell.is_change]
    print_text(console, f"{len(changed)} of {len(compared.cells)} cells changed", "bold")
    for cell in changed:
        print_text(console, f"{cell.cell} {cell.rat}: {cell.text}", bullet=f"{cell.word}: ")
    print_text(
        console,
        f"Both times have walked {compared.n_common_blocks} blocks of 50 m; of other ground "
        "nothing is said. Of surveys in which nothing changed, at most 5 % get a single word.",
    )
    for cell in compared.cells:
        if cell.error:
            print_text(console, f"{cell.cell}: {cell.text}", "red")
    shown = [cell for cell in compared.cells if details or cell.word != "not comparable"]
    rows = [
        (
            cell.cell,
            cell.word,
            "–" if cell.change_db is None else f"{cell.change_db:+.1f}",
            str(cell.n_blocks),
            f"{cell.n_a} / {cell.n_b}",
        )
        for cell in shown
    ]
    titles = ("cell", "word", "change dB", "blocks", "readings A / B")
    table(console, titles, rows, right=titles[2:])


def document_of_changes(compared: Comparison) -> dict[str, Any]:
    """The JSON form, without the blocks of each cell."""
    cells = [asdict(cell) for cell in compared.cells]
    for cell in cells:
        del cell["block"], cell["difference_db"]
    return {
        "common_blocks": compared.n_common_blocks,
        "tests": compared.n_tests,
        "offset_db": compared.offset_db,
        "cells": cells,
    }
