"""Walks by blocks: levels, and the floor that a modem's lists show."""

from dataclasses import replace

import numpy as np

from postproc.comparison.ground import BLOCK_M, Grid, blocks_text, grounds_of, half_blocks_at
from tests.kit.walks import with_places
from tests.postproc.comparison.city import LISTED, name, walk


def ground_of(cells):
    return grounds_of(cells, cells)[0]


def test_a_block_is_where_its_middle_is():
    x_m, y_m = np.array([-120.0, 0.0, 24.9, 390_001.0]), np.array([3.0, -1.0, 0.0, 5_820_049.0])
    grid = Grid(1, 0)
    block = grid.blocks_of(half_blocks_at(x_m, y_m))
    middle_x_m, middle_y_m = grid.centres_m(block)
    assert np.all(np.abs(middle_x_m - x_m) <= 0.5 * BLOCK_M)
    assert np.all(np.abs(middle_y_m - y_m) <= 0.5 * BLOCK_M)
    assert np.all(grid.blocks_of(half_blocks_at(middle_x_m, middle_y_m)) == block)


def test_blocks_are_counted_in_words():
    assert [blocks_text(n) for n in (1, 2)] == ["1 block of 50 m", "2 blocks of 50 m"]


def test_levels_are_means_of_their_block():
    cells = walk(1)
    ground = ground_of(cells)
    first, obs = ground.cells[name(1)], next(obs for obs in cells if obs.cell == name(1)).usable()
    block = ground.grid.blocks_of(half_blocks_at(obs.x_m, obs.y_m))
    assert first.block.tolist() == sorted(set(block.tolist()))
    for number, level_dbm, count in zip(first.block, first.level_dbm, first.count, strict=True):
        assert count == np.sum(block == number)
        assert level_dbm == np.mean(obs.level_dbm[block == number])


def test_the_floor_is_the_weakest_level_of_the_lists():
    ground = ground_of(walk(1))
    floors = ground.floor_dbm["GSM"]
    assert set(floors) == ground.visited["GSM"]
    for block, floor_dbm in floors.items():
        here = [
            cell.level_dbm[cell.block == block][0]
            for cell in ground.cells.values()
            if block in cell.block
        ]
        assert sum(level >= floor_dbm for level in here) >= LISTED - 2
        assert min(here) <= floor_dbm + 6.0


def test_a_list_of_one_has_no_floor():
    only = ground_of(walk(1)[:1])
    assert only.floor_dbm == {"GSM": {}}


def test_an_unsure_position_is_in_no_block():
    cells = walk(1)
    unsure = [with_places(obs, sigma_m=np.full(len(obs), 80.0)) for obs in cells]
    assert ground_of(unsure).cells == {}


def test_technologies_have_floors_of_their_own():
    cells = [replace(obs, rat="LTE") if obs.cell == name(2) else obs for obs in walk(1)]
    ground = ground_of(cells)
    assert ground.floor_dbm["LTE"] == {}
    assert ground.floor_dbm["GSM"]
    assert ground.visited["LTE"] == set(ground.cells[name(2)].block.tolist())


def test_the_other_side_of_the_street_is_the_same_ground():
    """Along the border of a grid too: 390 000 and 5 820 000 m are multiples of a block."""
    for seed in range(8):
        a, b = grounds_of(walk(seed), walk(seed + 50))
        assert len(a.visited["GSM"] & b.visited["GSM"]) >= 30


def test_scans_are_the_same_however_many_are_summed_at_once(monkeypatch):
    """Half blocks of the whole walk, and those of a few readings at a time."""
    whole = ground_of(walk(1))
    monkeypatch.setattr("postproc.comparison.ground._MOST_ROWS", 10)
    parts = ground_of(walk(1))
    assert parts.floor_dbm == whole.floor_dbm
    assert parts.visited == whole.visited
    assert parts.grid == whole.grid
