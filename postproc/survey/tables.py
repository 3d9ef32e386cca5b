"""What `survey locate` prints."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from logger.core.ellipse import RADII, metres
from logger.core.suspicion.rule import WORDS
from postproc.survey.cell_location import LocatedCell
from postproc.survey.location import Location
from postproc.terminal import print_text, screen, table

_MOST_ROWS = 40
"""Cells on the terminal; the files have all of them."""
_ORDER = ("located", "ambiguous", "cannot tell")


def document_of(location: Location, files: Sequence[Path]) -> dict[str, Any]:
    """The JSON form; regions are in the files."""
    cells = [msgspec.structs.asdict(cell) for cell in location.cells]
    for cell in cells:
        del cell["region_wkb"]
    return {
        "files": [str(path) for path in files],
        "loggers": [one._asdict() for one in location.loggers],
        "cells": cells,
    }


def print_location(location: Location, files: Sequence[Path]) -> None:
    """Located cells first, the most certain at the top, and the loggers that are left out."""
    console = screen()
    cells = sorted(location.cells, key=_rank)
    counts = Counter(cell.verdict for cell in cells)
    text = ", ".join(f"{counts[verdict]} {verdict}" for verdict in _ORDER if counts[verdict])
    known = f"; {location.n_known} known from before" if location.n_known else ""
    print_text(console, f"{len(cells)} cells: {text or 'none'}{known}", "bold")
    titles = ("cell", "verdict", "latitude", "longitude", *RADII, "readings", "runs", "modems")
    rows = [_row(cell) for cell in cells[:_MOST_ROWS]]
    table(console, titles, rows, right=titles[2:])
    if len(cells) > _MOST_ROWS:
        print_text(console, f"and {len(cells) - _MOST_ROWS} more in the files")
    for logger in location.loggers:
        if logger.contradiction:
            print_text(console, f"{logger.logger}: {logger.contradiction}", bullet="left out: ")
        if logger.remark:
            print_text(console, f"{logger.logger}: {logger.remark}", bullet="noted: ")
    for cell in cells:
        if cell.error:
            print_text(console, f"{cell.cell}: {cell.reasons[0]}", "red")
    for text in unusual_texts(cells):
        print_text(console, text, bullet="unusual: ")
    for path in files:
        print_text(console, str(path))


def unusual_texts(cells: Sequence[LocatedCell]) -> list[str]:
    """Identities in several places, then cells with a word of suspicion, the worst first."""
    places = [
        f"{cell.cell} is heard in {cell.n_places} places, farther apart than a cell reaches"
        for cell in cells
        if cell.n_places > 1 and cell.place == 1
    ]
    named = [cell for cell in cells if cell.word not in {None, WORDS[0]}]
    named.sort(key=lambda cell: (-WORDS.index(cell.word or WORDS[0]), -cell.word_runs, cell.cell))
    words = dict.fromkeys(f"{cell.cell} is {word_text(cell)}" for cell in named)
    return [*places, *words]


def word_text(cell: LocatedCell) -> str:
    """The word of a cell with its rules and the number of runs that say it."""
    times = "1 run" if cell.word_runs == 1 else f"{cell.word_runs} runs"
    return f"{cell.word} in {times} ({', '.join(cell.word_rules)})"


def _rank(cell: LocatedCell) -> tuple[int, float, str]:
    return _ORDER.index(cell.verdict), cell.r95_m or 0.0, cell.cell


def _row(cell: LocatedCell) -> tuple[str, ...]:
    place = ("–", "–", "–", "–")
    if cell.lat_deg is not None and cell.lon_deg is not None:
        radii = metres(cell.r50_m), metres(cell.r95_m)
        place = (f"{cell.lat_deg:.5f}", f"{cell.lon_deg:.5f}", *radii)
    counts = (str(cell.n_readings), str(cell.n_runs), str(cell.n_modems))
    name = cell.cell if cell.n_places == 1 else f"{cell.cell} ({cell.place} of {cell.n_places})"
    return (name, cell.verdict, *place, *counts)
