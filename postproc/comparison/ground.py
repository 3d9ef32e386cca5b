"""A walk by blocks of ground: what it heard there, and what it could have heard.

A modem names the cells that it receives best. So in a block where several cells were named at once,
a cell that is clearly stronger than the weakest of them would have been named too: the weakest
level is the floor of the block. Where a modem names the serving cell only, another cell may be
strong and stay unheard, and the block has no floor.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.identities import FEWEST_SCANS
from logger.core.observations import CellObservations

BLOCK_M = 50.0
"""Differences between repeated walks are independent from one such block to the next.

Their semivariogram is flat from 50 m on; levels themselves are correlated farther.
"""
_SHIFTS_M = tuple((east, north) for east in (0.0, 0.5 * BLOCK_M) for north in (0.0, 0.5 * BLOCK_M))
"""Grids that are tried: a street along the border of one grid is inside the blocks of another."""
_FARTHEST_SIGMA_M = BLOCK_M
"""A position that is less sure is in no block."""
_STRIDE = 1 << 24
"""Blocks are numbered row by row; the Earth has fewer columns."""
_HALF = 1 << 22


@dataclass(frozen=True, slots=True)
class Grid:
    """Blocks of ground, numbered; east and north of a corner in metres."""

    east_m: float = 0.0
    north_m: float = 0.0

    def blocks_at(self, x_m: FloatArray, y_m: FloatArray) -> IntArray:
        """Number of the block of each position, shape (n,)."""
        column = np.floor((x_m - self.east_m) / BLOCK_M).astype(np.int64) + _HALF
        row = np.floor((y_m - self.north_m) / BLOCK_M).astype(np.int64) + _HALF
        return np.asarray(row * _STRIDE + column, np.int64)

    def centres_m(self, block: IntArray) -> tuple[FloatArray, FloatArray]:
        """East and north of the middle of each block, shape (n,)."""
        column, row = block % _STRIDE - _HALF, block // _STRIDE - _HALF
        x_m = self.east_m + (column + 0.5) * BLOCK_M
        y_m = self.north_m + (row + 0.5) * BLOCK_M
        return np.asarray(x_m, float), np.asarray(y_m, float)


@dataclass(frozen=True, slots=True)
class CellBlocks:
    """Mean level and number of readings of a cell in each block that heard it, shape (n,) each."""

    cell: str
    rat: str
    n_readings: int
    block: IntArray
    level_dbm: FloatArray
    count: IntArray


@dataclass(frozen=True, slots=True)
class Ground:
    """A walk by blocks of a grid.

    `visited` has the blocks of each technology in which a cell of it was named. `floor_dbm` has,
    for each technology, the floor of the blocks that have one.
    """

    grid: Grid
    cells: Mapping[str, CellBlocks]
    visited: Mapping[str, frozenset[int]]
    floor_dbm: Mapping[str, Mapping[int, float]]


def grounds_of(
    a: Iterable[CellObservations], b: Iterable[CellObservations]
) -> tuple[Ground, Ground]:
    """Two walks by the blocks of the grid in which they have most blocks in common.

    Their readings are in one UTM zone. A cell that fewer than two scans of a walk have named is
    left out of it, as on the device.
    """
    walks = [
        [part for obs in cells if (part := _without_doubt(obs)) is not None] for cells in (a, b)
    ]
    grids = [Grid(*shift_m) for shift_m in _SHIFTS_M]
    best = max(grids, key=lambda grid: len(_blocks_of(walks[0], grid) & _blocks_of(walks[1], grid)))
    return _ground_of(walks[0], best), _ground_of(walks[1], best)


def _ground_of(cells: list[CellObservations], grid: Grid) -> Ground:
    by_rat: dict[str, list[CellObservations]] = {}
    for obs in cells:
        by_rat.setdefault(obs.rat or "", []).append(obs)
    return Ground(
        grid,
        {obs.cell: _cell_blocks(obs, grid) for obs in cells},
        {rat: _blocks_of(some, grid) for rat, some in by_rat.items()},
        {rat: _floors(some, grid) for rat, some in by_rat.items()},
    )


def _without_doubt(obs: CellObservations) -> CellObservations | None:
    usable = obs.usable()
    sure = usable.part(usable.position_sigma_m <= _FARTHEST_SIGMA_M)
    return sure if len(np.unique(sure.scan_seq)) >= FEWEST_SCANS else None


def _cell_blocks(obs: CellObservations, grid: Grid) -> CellBlocks:
    block, which = np.unique(grid.blocks_at(obs.x_m, obs.y_m), return_inverse=True)
    count = np.bincount(which)
    level_dbm = np.bincount(which, obs.level_dbm) / count
    return CellBlocks(obs.cell, obs.rat or "", len(obs), block, level_dbm, count)


def _blocks_of(cells: list[CellObservations], grid: Grid) -> frozenset[int]:
    return frozenset(
        int(block) for obs in cells for block in np.unique(grid.blocks_at(obs.x_m, obs.y_m))
    )


def _floors(cells: list[CellObservations], grid: Grid) -> dict[int, float]:
    """Median over the scans of a block of the weakest level named, where scans name several."""
    scan = np.concatenate([obs.scan_seq for obs in cells])
    level_dbm = np.concatenate([obs.level_dbm for obs in cells])
    block = np.concatenate([grid.blocks_at(obs.x_m, obs.y_m) for obs in cells])
    scans, first, which = np.unique(scan, return_index=True, return_inverse=True)
    weakest_dbm = np.full(len(scans), np.inf)
    np.minimum.at(weakest_dbm, which, level_dbm)
    lists = np.bincount(which) > 1
    of_scan = block[first]
    floors = {}
    for here in np.unique(of_scan[lists]):
        is_here = of_scan == here
        # where most scans name one cell only, the others may have been cut short
        if np.mean(lists[is_here]) > 0.5:
            floors[int(here)] = float(np.median(weakest_dbm[is_here & lists]))
    return floors
