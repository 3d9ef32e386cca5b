"""What a comparison of two walks says: lines and tables, JSON, and a page without network."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from logger.core.document import Column, Document, Line, Measured, Table, Value
from logger.core.places import Utm
from postproc.comparison.changes import FALSE_WORDS, CellChange, ComparedRuns
from postproc.comparison.ground import BLOCK_M, Grid, blocks_text
from postproc.html_page import page_environment

_DECIMALS = 6
"""Of degrees: 0.1 m."""
_MOST_MAPS = 12
"""A page with more maps is not read."""
_FULL_DB = 15.0
"""Difference from which a colour is full."""
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
            if not cell.is_change:
                yield Line(cell.text, "dim", bullet=f"{cell.cell}: ")
    elif hidden := len(cells) - len(shown):
        yield Line(f"{hidden} more could not be compared; -v has the reasons", "dim")


def changed_lines(cells: Sequence[CellChange]) -> Iterator[Line]:
    """Each cell that changed, in words."""
    for cell in cells:
        if cell.is_change:
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
        f"Where nothing changed, at most {FALSE_WORDS:.0%} of pairs of walks get any such word by "
        "chance. Operators change their cells too: a change is a reason to look, not a proof."
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


@dataclass(frozen=True, slots=True)
class BlockMap:
    """Differences of a cell on the ground; width and height in metres."""

    width_m: float
    height_m: float
    squares: tuple[Square, ...]


def html(compared: ComparedRuns) -> str:
    """The page; text from the runs is escaped."""
    cells = compared.comparison.cells
    changed = [cell for cell in cells if cell.is_change]
    template = page_environment("postproc.comparison").get_template("comparison.html")
    return template.render(
        compared=compared,
        table=_page_table(cells),
        maps=[(cell, map_of(cell, compared.comparison.grid)) for cell in changed[:_MOST_MAPS]],
        n_without_map=max(len(changed) - _MOST_MAPS, 0),
        headline=headline(compared),
        ground_text=ground_text(compared),
        chance_text=chance_text(),
        block_m=BLOCK_M,
    )


def _page_table(cells: Sequence[CellChange]) -> Table:
    columns = (_COLUMNS[0], Column("technology"), *_COLUMNS[1:], Column("reason", is_long=True))
    rows = [(cell.cell, cell.rat, *_row(cell)[1:], cell.text) for cell in cells]
    return Table(columns, rows, "All cells")


def map_of(cell: CellChange, grid: Grid) -> BlockMap:
    """Blocks of a cell, north up."""
    x_m, y_m = grid.centres_m(cell.block)
    west_m, north_m = float(np.min(x_m)) - BLOCK_M, float(np.max(y_m)) + BLOCK_M
    squares = tuple(
        _square(float(x - west_m), float(north_m - y), float(db))
        for x, y, db in zip(x_m, y_m, cell.difference_db, strict=True)
    )
    width_m, height_m = (float(np.ptp(values)) + 2.0 * BLOCK_M for values in (x_m, y_m))
    return BlockMap(width_m, height_m, squares)


def _square(x_m: float, y_m: float, difference_db: float) -> Square:
    left_m, top_m = x_m - 0.5 * BLOCK_M, y_m - 0.5 * BLOCK_M
    if np.isnan(difference_db):
        return Square(left_m, top_m, "single", 1.0, "heard by one walk")
    kind = "more" if difference_db > 0.0 else "less"
    strength = min(abs(difference_db) / _FULL_DB, 1.0)
    return Square(left_m, top_m, kind, round(strength, 2), f"{difference_db:+.0f} dB")
