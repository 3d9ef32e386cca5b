"""What a comparison of two walks says: lines and tables, JSON, and a page without network."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from logger.core.certainty import share_text
from logger.core.document import Column, Document, Line, Measured, Table, Value
from logger.core.places import Utm
from postproc.comparison.changes import (
    FALSE_WORDS,
    CellChange,
    ComparedRuns,
    cells_on_maps,
    shade_of,
)
from postproc.comparison.ground import BLOCK_M, Grid, blocks_text
from postproc.html_page import page_environment
from postproc.pictures.survey import Box

_DECIMALS = 6
"""Of degrees: 0.1 m."""
_COLUMNS = (
    Column("cell"),
    Column("word"),
    Column("change", "+.1f", "dB"),
    Column("blocks", "d"),
    Column("readings A / B", is_right=True),
)


def document_of(compared: ComparedRuns, *, details: bool) -> Document:
    """Cells that changed in words; with `details` every cell."""
    comparison = compared.comparison
    content = {
        "a": compared.a,
        "b": compared.b,
        "same_modem": compared.same_modem,
        "warnings": compared.warnings,
        "block_m": BLOCK_M,
        "common_blocks": comparison.n_common_blocks,
        "offset_db": comparison.offset_db,
        "tests": comparison.n_tests,
        "false_words_per_pair": FALSE_WORDS,
        "cells": [_cell_content(cell, compared.utm, comparison.grid) for cell in comparison.cells],
    }
    return Document(content, body=_parts(compared, details=details))


def _parts(compared: ComparedRuns, *, details: bool) -> Iterator[str | Line | Table]:
    yield f"A: {compared.a}\nB: {compared.b}"
    for warning in compared.warnings:
        yield Line(warning, "yellow", bullet="note: ")
    yield Line(f"{headline(compared)}.", "bold")
    cells = compared.comparison.cells
    yield from changed_lines(cells)
    yield ground_text(compared)
    yield chance_text()
    yield from error_lines(cells)
    shown = [cell for cell in cells if details or cell.error or cell.word != "not comparable"]
    yield cell_table(shown)
    if details:
        for cell in cells:
            if not (cell.is_change or cell.is_small_change):
                yield Line(cell.text, "dim", bullet=f"{cell.cell}: ")
    elif hidden := len(cells) - len(shown):
        yield Line(f"{hidden} more could not be compared; -v has the reasons", "dim")


def changed_lines(cells: Sequence[CellChange]) -> Iterator[Line]:
    """Each cell that changed, if little, in words."""
    for cell in cells:
        if cell.is_change or cell.is_small_change:
            yield Line(f"{cell.cell} {cell.rat}: {cell.text}", bullet=f"{cell.word}: ")


def error_lines(cells: Sequence[CellChange]) -> Iterator[Line]:
    """Each cell whose comparison failed."""
    for cell in cells:
        if cell.error:
            yield Line(cell.text, "red", bullet=f"{cell.cell}: ")


def cell_table(cells: Sequence[CellChange]) -> Table:
    """Cells with their word and the change of their level."""
    return Table(_COLUMNS, [_row(cell) for cell in cells])


def _row(cell: CellChange) -> tuple[Value, ...]:
    change = Measured(cell.change_db, cell.sigma_db)
    return cell.cell, cell.word, change, cell.n_blocks, f"{cell.n_a} / {cell.n_b}"


def headline(compared: ComparedRuns) -> str:
    """How many cells changed, of how many that could be compared."""
    cells = compared.comparison.cells
    n_changed = sum(cell.is_change for cell in cells)
    n_comparable = sum(cell.word != "not comparable" for cell in cells)
    if not n_comparable:
        return f"No cell could be compared, of {len(cells)} heard"
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
        f"Common ground: {blocks_text(comparison.n_common_blocks)}. "
        f"Recorded with {modems}; offset of B against A: {offsets or 'not known'}."
    )


def chance_text() -> str:
    """The rate of false words, and what no test excludes."""
    return (
        f"Where nothing changed, at most {share_text(FALSE_WORDS)} of pairs of walks get any such "
        "word by chance. Operators change their cells too: a change is a reason to look, not a "
        "proof."
    )


def _cell_content(cell: CellChange, utm: Utm, grid: Grid) -> dict[str, Any]:
    lat_deg, lon_deg = utm.to_latlon_arrays(*grid.centres_m(cell.block))
    columns: tuple[Any, ...] = (
        np.round(lat_deg, _DECIMALS).tolist(),
        np.round(lon_deg, _DECIMALS).tolist(),
        np.round(cell.difference_db, 1).tolist(),
    )
    blocks = [
        {"lat": lat, "lon": lon, "difference_db": db} for lat, lon, db in zip(*columns, strict=True)
    ]
    return {
        "cell": cell.cell,
        "rat": cell.rat or None,
        "word": cell.word,
        "text": cell.text,
        "readings_a": cell.n_a,
        "readings_b": cell.n_b,
        "blocks": cell.n_blocks,
        "change_db": cell.change_db,
        "sigma_db": cell.sigma_db,
        "contrast_db": cell.contrast_db,
        "p": cell.p,
        "where": blocks if cell.is_change else [],
        "error": cell.error,
    }


@dataclass(frozen=True, slots=True)
class Square:
    """A block on the map of a cell, in metres from the corner; `kind` is its class of colour."""

    x_m: float
    y_m: float
    kind: str
    strength: float
    label: str


def html(compared: ComparedRuns) -> str:
    """The page; text from the runs is escaped."""
    cells, grid = compared.comparison.cells, compared.comparison.grid
    shown = cells_on_maps(cells)
    template = page_environment("postproc.comparison").get_template("comparison.html")
    return template.render(
        compared=compared,
        table=_page_table(cells),
        maps=[(cell, *map_of(cell, grid)) for cell in shown],
        n_without_map=sum(cell.is_change for cell in cells) - len(shown),
        headline=headline(compared),
        ground_text=ground_text(compared),
        chance_text=chance_text(),
        block_m=BLOCK_M,
    )


def _page_table(cells: Sequence[CellChange]) -> Table:
    columns = (_COLUMNS[0], Column("technology"), *_COLUMNS[1:], Column("reason", is_long=True))
    rows = [(cell.cell, cell.rat, *_row(cell)[1:], cell.text) for cell in cells]
    return Table(columns, rows, "All cells")


def map_of(cell: CellChange, grid: Grid) -> tuple[Box, list[Square]]:
    """The ground around a cell, and its blocks from the north-west corner."""
    x_m, y_m = grid.centres_m(cell.block)
    box = Box.around(np.column_stack([x_m, y_m])).enlarge(BLOCK_M)
    squares = []
    for x, y, db in zip(x_m.tolist(), y_m.tolist(), cell.difference_db.tolist(), strict=True):
        kind, strength = shade_of(db)
        label = "heard by one walk" if kind == "single" else f"{db:+.0f} dB"
        left_m, top_m = x - box.west - 0.5 * BLOCK_M, box.north - y - 0.5 * BLOCK_M
        squares.append(Square(left_m, top_m, kind, round(strength, 2), label))
    return box, squares
