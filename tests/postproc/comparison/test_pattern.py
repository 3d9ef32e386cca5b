"""The test of a pattern on the ground: permutations of blocks."""

from dataclasses import replace

import numpy as np

from postproc.comparison.changes import pattern_of
from postproc.comparison.ground import Differences, Grid

GRID = Grid()


def along_a_street(difference_db):
    n = len(difference_db)
    block = GRID.blocks_at(390_000.0 + 50.0 * np.arange(n), np.full(n, 5_820_000.0))
    return Differences("c", "", block, difference_db, np.full(n, 16.0), np.zeros(n, np.int64))


def test_noise_has_no_pattern():
    random = np.random.default_rng(1)
    p = np.array(
        [pattern_of(along_a_street(random.normal(0, 4.0, 15)), 0.0, GRID)[1] for _ in range(200)]
    )
    for level in (0.1, 0.02):
        assert np.mean(p <= level) <= level + 3.0 * np.sqrt(level / len(p))


def test_a_slope_is_a_pattern():
    random = np.random.default_rng(2)
    slope_db = np.linspace(-15.0, 15.0, 15)
    contrast_db, p = pattern_of(along_a_street(slope_db + random.normal(0, 4.0, 15)), 0.0, GRID)
    assert contrast_db > 15.0
    assert p < 0.001


def test_a_change_everywhere_is_no_pattern():
    random = np.random.default_rng(3)
    assert pattern_of(along_a_street(20.0 + random.normal(0, 4.0, 15)), 0.0, GRID)[1] > 0.01


def test_censored_differences_are_no_pattern():
    """A cell that is 20 dB weaker all along: where it is below the floor, less is seen of that."""
    random, n = np.random.default_rng(5), 20
    street = along_a_street(-20.0 + random.normal(0, 4.0, n))
    margin_db = np.repeat([30.0, 5.0], n // 2)
    is_below = street.difference_db < -margin_db
    assert np.count_nonzero(is_below) == n // 2
    censored = replace(
        street,
        difference_db=np.where(is_below, -margin_db, street.difference_db),
        bound=np.where(is_below, -1, 0),
    )
    assert pattern_of(censored, -20.0, GRID)[1] > 0.05
    assert pattern_of(replace(censored, bound=np.zeros(n)), -20.0, GRID)[1] < 0.001


def across_a_city(difference_db):
    side = int(np.sqrt(len(difference_db)))
    east_m, north_m = 50.0 * np.indices((side, side)).reshape(2, -1)
    street = along_a_street(difference_db)
    return replace(street, block=GRID.blocks_at(390_000.0 + east_m, 5_820_000.0 + north_m))


def test_a_city_of_blocks_is_tested_in_larger_squares():
    random, n = np.random.default_rng(6), 60 * 60
    contrasts_db, p = np.array(
        [pattern_of(across_a_city(random.normal(0, 4.0, n)), 0.0, GRID) for _ in range(40)]
    ).T
    assert np.mean(p <= 0.1) <= 0.1 + 3.0 * np.sqrt(0.1 / len(p))
    assert np.max(contrasts_db) < 6.0
    slope_db = np.linspace(-10.0, 10.0, n)
    contrast_db, p_of_slope = pattern_of(
        across_a_city(slope_db + random.normal(0, 4.0, n)), 0.0, GRID
    )
    assert contrast_db > 12.0
    assert p_of_slope < 1e-4


def test_few_blocks_have_no_pattern():
    assert pattern_of(along_a_street(np.linspace(-20.0, 20.0, 7)), 0.0, GRID) == (0.0, 1.0)


def test_equal_runs_give_equal_answers():
    values = np.random.default_rng(4).normal(0, 4.0, 20)
    assert pattern_of(along_a_street(values), 0.0, GRID) == pattern_of(
        along_a_street(values), 0.0, GRID
    )
