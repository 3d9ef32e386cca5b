"""Differences of a cell's level between two walks, block by block.

A block in which one walk did not hear the cell, although it could have, says that the level was
below its floor there: the difference is censored.
"""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from postproc.comparison.ground import CellBlocks, Ground
from postproc.comparison.noise import variance_db2


@dataclass(frozen=True, slots=True)
class Differences:
    """Levels of one cell in walk B minus those in walk A, shape (n,) each.

    `bound` is 0 for a difference, -1 where only A heard the cell: the difference is at most as
    stated; 1 where only B heard it: the difference is at least as stated.
    """

    cell: str
    rat: str
    block: IntArray
    difference_db: FloatArray
    variance_db2: FloatArray
    bound: IntArray

    def __len__(self) -> int:
        return len(self.block)


def differences_of(cell: str, a: Ground, b: Ground) -> Differences:
    """Differences of a cell that both walks heard somewhere."""
    in_a, in_b = a.cells[cell], b.cells[cell]
    common, at_a, at_b = np.intersect1d(in_a.block, in_b.block, return_indices=True)
    both_db = in_b.level_dbm[at_b] - in_a.level_dbm[at_a]
    variance = variance_db2(in_a.count[at_a], in_b.count[at_b])
    less, less_db, less_variance = _bounds(in_a, b, in_b.block)
    more, more_db, more_variance = _bounds(in_b, a, in_a.block)
    bound = np.repeat([0, -1, 1], [len(common), len(less), len(more)])
    return Differences(
        cell,
        in_a.rat,
        np.concatenate([common, less, more]),
        np.concatenate([both_db, -less_db, more_db]),
        np.concatenate([variance, less_variance, more_variance]),
        np.asarray(bound, np.int64),
    )


def margins_db(heard: CellBlocks, other: Ground) -> FloatArray:
    """How far above the floor of the other walk a cell was in each block; NaN without a floor."""
    floors = other.floor_dbm.get(heard.rat, {})
    floor_dbm = np.array([floors.get(block, np.nan) for block in heard.block.tolist()])
    return np.asarray(heard.level_dbm - floor_dbm, float)


def _bounds(
    heard: CellBlocks, other: Ground, heard_too: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Blocks in which the other walk could have heard a cell and did not.

    With the level's distance from its floor, and the variance of that.
    """
    margin_db = margins_db(heard, other)
    chosen = ~np.isin(heard.block, heard_too) & (margin_db > 0.0)  # NaN compares false
    count = heard.count[chosen]
    return heard.block[chosen], margin_db[chosen], variance_db2(count, count)
