"""A comparison as one page of HTML that needs no network."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from postproc.comparison import wording
from postproc.comparison.changes import CellChange
from postproc.comparison.ground import BLOCK_M, Grid
from postproc.comparison.run_pair import ComparedRuns
from postproc.html_page import page_environment

_MOST_MAPS = 12
"""A page with more maps is not read."""
_FULL_DB = 15.0
"""Difference from which a colour is full."""


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
        cells=cells,
        maps=[(cell, map_of(cell, compared.comparison.grid)) for cell in changed[:_MOST_MAPS]],
        n_without_map=max(len(changed) - _MOST_MAPS, 0),
        wording=wording,
        block_m=BLOCK_M,
    )


def map_of(cell: CellChange, grid: Grid) -> BlockMap:
    """Blocks of a cell, north up."""
    x_m, y_m = grid.centres_m(cell.block)
    west_m, north_m = _corner(x_m, y_m)
    squares = tuple(
        _square(float(x - west_m), float(north_m - y), float(db))
        for x, y, db in zip(x_m, y_m, cell.difference_db, strict=True)
    )
    width_m, height_m = (float(np.ptp(values)) + 2.0 * BLOCK_M for values in (x_m, y_m))
    return BlockMap(width_m, height_m, squares)


def _corner(x_m: FloatArray, y_m: FloatArray) -> tuple[float, float]:
    return float(np.min(x_m)) - BLOCK_M, float(np.max(y_m)) + BLOCK_M


def _square(x_m: float, y_m: float, difference_db: float) -> Square:
    left_m, top_m = x_m - 0.5 * BLOCK_M, y_m - 0.5 * BLOCK_M
    if np.isnan(difference_db):
        return Square(left_m, top_m, "single", 1.0, "heard by one walk")
    kind = "more" if difference_db > 0.0 else "less"
    strength = min(abs(difference_db) / _FULL_DB, 1.0)
    return Square(left_m, top_m, kind, round(strength, 2), f"{difference_db:+.0f} dB")
