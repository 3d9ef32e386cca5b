"""A walk by blocks of ground: what it heard there, and what it could have heard.

A modem names the cells that it receives best. So where several cells were named at once, a cell
clearly stronger than the weakest of them would have been named too: the weakest level is the floor
of the block. Where a modem names the serving cell only, a strong cell may stay unheard, and the
block has no floor.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.cell_names import FEWEST_SCANS
from logger.core.document import number_of
from logger.core.readings import Readings
from logger.core.rows import rows_of_each
from postproc.cell_work import Attempts

BLOCK_M = 50.0
"""Differences between repeated walks are independent from one such block to the next.

Their semivariogram is flat from 50 m on; levels themselves are correlated farther.
"""
_HALF_M = 0.5 * BLOCK_M
_SHIFTS = tuple((east, north) for east in (0, 1) for north in (0, 1))
"""Grids tried, in half blocks: a street on the border of one is inside blocks of another."""
_FARTHEST_SIGMA_M = BLOCK_M
"""A position that is less sure is in no block."""
_STRIDE = 1 << 24
"""Blocks are numbered row by row; the Earth has fewer columns."""
_MIDDLE = 1 << 22
_MOST_ROWS = 4_000_000
"""Readings of which the scans are not yet summed: 0.1 GB, and as much again while they are."""


def blocks_text(n: int) -> str:
    """So many blocks, in words."""
    return f"{number_of(n, 'block')} of {BLOCK_M:.0f} m"


@dataclass(frozen=True, slots=True)
class Grid:
    """Blocks of ground, numbered; east and north of a corner in half blocks."""

    east: int = 0
    north: int = 0

    def blocks_of(self, half: IntArray) -> IntArray:
        """Number of the block that contains each half block, shape (n,)."""
        column, row = _column_and_row(half)
        return _number((column - self.east) // 2, (row - self.north) // 2)

    def centres_m(self, block: IntArray) -> tuple[FloatArray, FloatArray]:
        """East and north of the middle of each block, shape (n,)."""
        column, row = _column_and_row(block)
        x_m = self.east * _HALF_M + (column + 0.5) * BLOCK_M
        y_m = self.north * _HALF_M + (row + 0.5) * BLOCK_M
        return np.asarray(x_m, float), np.asarray(y_m, float)


def half_blocks_at(x_m: FloatArray, y_m: FloatArray) -> IntArray:
    """Number of the half block, a square of 25 m that all grids share, shape (n,)."""
    return _number(
        np.floor(x_m / _HALF_M).astype(np.int64), np.floor(y_m / _HALF_M).astype(np.int64)
    )


def _number(column: IntArray, row: IntArray) -> IntArray:
    return np.asarray((row + _MIDDLE) * _STRIDE + column + _MIDDLE, np.int64)


def _column_and_row(number: IntArray) -> tuple[IntArray, IntArray]:
    return number % _STRIDE - _MIDDLE, number // _STRIDE - _MIDDLE


@dataclass(frozen=True, slots=True)
class CellBlocks:
    """Number and sum of the levels of a cell in each block that heard it, shape (n,) each.

    The blocks are those of a grid, or half blocks.
    """

    cell: str
    rat: str
    block: IntArray
    count: IntArray
    sum_dbm: FloatArray
    named: IntArray  # blocks: these, and those in which no level counts

    @property
    def n_readings(self) -> int:
        """In all blocks."""
        return int(np.sum(self.count))

    @property
    def level_dbm(self) -> FloatArray:
        """Mean level in each block."""
        return np.asarray(self.sum_dbm / self.count, float)

    def in_grid(self, grid: Grid) -> "CellBlocks":
        """Blocks of a grid from half blocks."""
        block, which = np.unique(grid.blocks_of(self.block), return_inverse=True)
        count = np.bincount(which, self.count).astype(np.int64)
        sum_dbm = np.asarray(np.bincount(which, self.sum_dbm), float)
        named = np.unique(grid.blocks_of(self.named))
        return replace(self, block=block, count=count, sum_dbm=sum_dbm, named=named)


@dataclass(frozen=True, slots=True)
class Ground:
    """A walk by blocks of a grid.

    `visited` has for each technology the blocks in which a cell of it was named, `floor_dbm` the
    floor of those that have one.
    """

    grid: Grid
    cells: Mapping[str, CellBlocks]
    visited: Mapping[str, frozenset[int]]
    floor_dbm: Mapping[str, Mapping[int, float]]


def grounds_of(
    a: Iterable[Readings],
    b: Iterable[Readings],
    tries: Attempts | None = None,
) -> tuple[Ground, Ground]:
    """Two walks by the blocks of the grid in which they have most blocks in common.

    Their readings are in one UTM zone, cell by cell. A cell that fewer than two scans of a walk
    have named is left out of it, as on the device.
    """
    tries = tries or Attempts("its blocks")
    walks = [_Walk(cells, tries) for cells in (a, b)]
    grids = [Grid(*shift) for shift in _SHIFTS]
    best = max(grids, key=lambda grid: len(walks[0].blocks(grid) & walks[1].blocks(grid)))
    return walks[0].ground(best), walks[1].ground(best)


class _Scans(NamedTuple):
    """Scans: weakest level, number of cells named, half block of the first; shape (n,) each."""

    scan: IntArray
    weakest_dbm: FloatArray
    n_named: IntArray
    half: IntArray

    @classmethod
    def of_parts(cls, parts: Iterable["_Scans"]) -> "_Scans":
        scan, weakest_dbm, n_named, half = map(np.concatenate, zip(*parts, strict=True))
        order = np.argsort(scan, kind="stable")
        first = np.flatnonzero(np.diff(scan[order], prepend=scan[order[0]] - 1))
        return cls(
            scan[order[first]],
            np.minimum.reduceat(weakest_dbm[order], first),
            np.add.reduceat(n_named[order], first),
            half[order[first]],
        )

    def floors(self, grid: Grid) -> dict[int, float]:
        """Median over the scans of a block of the weakest level, where scans name several cells."""
        block = grid.blocks_of(self.half)
        floors = {}
        for number, here in rows_of_each(block):
            lists = here[self.n_named[here] > 1]
            # where most scans name one cell only, the others may have been cut short
            if 2 * len(lists) > len(here):
                floors[number] = float(np.median(self.weakest_dbm[lists]))
        return floors


class _Walk:
    """A walk by half blocks, of which the blocks of any grid are made."""

    def __init__(self, cells: Iterable[Readings], tries: Attempts) -> None:
        self._cells: list[CellBlocks] = []
        self._scans: dict[str, list[_Scans]] = {}
        tries.each(cells, lambda obs: obs.cell, self._take)

    def _take(self, every: Readings) -> None:
        named = _surely_placed(every)
        if len(np.unique(named.scan_seq)) < FEWEST_SCANS:
            return
        # where a cell is named irregularly it may have become weak
        obs = _surely_placed(every.everywhere())
        at = half_blocks_at(obs.x_m, obs.y_m)
        half, which = np.unique(at, return_inverse=True)
        sum_dbm = np.asarray(np.bincount(which, obs.level_dbm), float)
        rat = obs.rat or ""
        heard = np.unique(half_blocks_at(named.x_m, named.y_m))
        self._cells.append(CellBlocks(obs.cell, rat, half, np.bincount(which), sum_dbm, heard))
        parts = self._scans.setdefault(rat, [])
        parts.append(_Scans(obs.scan_seq, obs.level_dbm, np.ones(len(obs), np.int64), at))
        if sum(len(part.scan) for part in parts[1:]) > max(_MOST_ROWS, len(parts[0].scan)):
            self._scans[rat] = [_Scans.of_parts(parts)]

    def blocks(self, grid: Grid, rat: str | None = None) -> frozenset[int]:
        halves = [cell.block for cell in self._cells if rat in {None, cell.rat}]
        if not halves:
            return frozenset()
        return frozenset(np.unique(grid.blocks_of(np.unique(np.concatenate(halves)))).tolist())

    def ground(self, grid: Grid) -> Ground:
        return Ground(
            grid,
            {cell.cell: cell.in_grid(grid) for cell in self._cells},
            {rat: self.blocks(grid, rat) for rat in self._scans},
            {rat: _Scans.of_parts(parts).floors(grid) for rat, parts in self._scans.items()},
        )


def _surely_placed(obs: Readings) -> Readings:
    return obs.part(obs.position_sigma_m <= _FARTHEST_SIGMA_M)


# Null hypothesis: the difference in a block of 50 m is an offset of the modem plus an error that is
# independent from block to block, of Student's t distribution, with variance
#
#    PLACE_DB^2 + READING_DB^2 (1/n_a + 1/n_b)
#
# for n_a and n_b readings. It was measured on 78 pairs of walks along one route over 14 weeks, 1443
# blocks (benchmarks/comparison.py has the set): what two walks past the same houses differ by,
# which is less than shadowing.

PLACE_DB = 3.0
READING_DB = 3.5
"""Standard deviations of the two terms; at 1 and 1 readings 5.8 dB, at 3 and 3 readings 4.2 dB."""
CELL_DB = 1.0
"""Of a cell as a whole, beyond its blocks: the mean of 11 to 20 blocks differs by 1.0 dB."""
FREEDOM = 5.0
"""Degrees of freedom of a block's error.

The kurtosis was 3.3 to 4.8 for walks and 4.2 to 8.4 for cars; a Gaussian has 3, this has 9.
"""
SAME_MODEM_DB, OTHER_MODEM_DB = 2.0, 6.0
"""Prior of the offset: 2.0 dB between walks with one phone; between models a few dB more."""
MISS = 0.2
"""Smallest chance not to hear a cell in a block although its level is above the floor.

A GSM phone that drove over its own ground again missed 47 of 282 cells that it had heard there 6 dB
or more above the floor, and not fewer of the strongest.
"""

_FREEDOM_SHARE = (FREEDOM - 2.0) / FREEDOM
"""Square of the scale of Student's t by its variance."""


def variance_db2(count_a: IntArray, count_b: IntArray) -> FloatArray:
    """Variance of the difference of two blocks by their numbers of readings, shape (n,)."""
    return np.asarray(PLACE_DB**2 + READING_DB**2 * (1.0 / count_a + 1.0 / count_b), float)


def scale_db(variance_db2: FloatArray) -> FloatArray:
    """Scale of Student's t distribution with these variances, shape as the argument."""
    return np.asarray(np.sqrt(variance_db2 * _FREEDOM_SHARE), float)


# A block in which one walk did not hear the cell, although it could have, says that the level was
# below its floor there: the difference is censored. A level that does not count says nothing.


@dataclass(frozen=True, slots=True)
class Differences:
    """Levels of one cell in walk B minus those in walk A, shape (n,) each.

    `bound` is 0 for a difference, -1 where only A heard the cell and the difference is an upper
    bound, 1 where only B heard it and the difference is a lower bound.
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
    block, at_a, at_b = np.intersect1d(in_a.block, in_b.block, return_indices=True)
    both_db = in_b.level_dbm[at_b] - in_a.level_dbm[at_a]
    variance = variance_db2(in_a.count[at_a], in_b.count[at_b])
    heard = Differences(cell, in_a.rat, block, both_db, variance, np.zeros(len(block), np.int64))
    parts = heard, _bounds(in_a, b, -1), _bounds(in_b, a, 1)
    return Differences(
        cell,
        in_a.rat,
        np.concatenate([part.block for part in parts]),
        np.concatenate([part.difference_db for part in parts]),
        np.concatenate([part.variance_db2 for part in parts]),
        np.concatenate([part.bound for part in parts]),
    )


def margins_db(heard: CellBlocks, other: Ground) -> FloatArray:
    """How far above the floor of the other walk a cell was in each block; NaN without a floor."""
    floors = other.floor_dbm.get(heard.rat, {})
    floor_dbm = np.array([floors.get(block, np.nan) for block in heard.block.tolist()])
    return np.asarray(heard.level_dbm - floor_dbm, float)


def _bounds(heard: CellBlocks, other: Ground, bound: int) -> Differences:
    """Blocks in which the other walk could have heard a cell and did not.

    The difference is that of the level from the other's floor.
    """
    margin_db = margins_db(heard, other)
    is_heard_too = np.isin(heard.block, other.cells[heard.cell].named)
    chosen = ~is_heard_too & (margin_db > 0.0)  # NaN compares false
    count = heard.count[chosen]
    difference_db, bounds = bound * margin_db[chosen], np.full(len(count), bound)
    variance = variance_db2(count, count)
    return Differences(heard.cell, heard.rat, heard.block[chosen], difference_db, variance, bounds)
