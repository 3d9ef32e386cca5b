import numpy as np
import pytest

from logger.core.locator.packing import around, compact_groups


@pytest.mark.parametrize("count", [0, 1, 64, 65, 1000, 5000])
def test_each_point_is_in_one_group(count):
    x_m, y_m = np.random.default_rng(count).normal(size=(2, count))
    groups = compact_groups(np.stack([x_m, y_m]))
    every = np.concatenate(groups) if groups else np.zeros(0)
    np.testing.assert_array_equal(np.sort(every), np.arange(count))
    assert all(0 < len(group) <= 64 for group in groups)


def test_groups_are_compact():
    """6400 points of a square of 80 by 80 m in about 100 groups: none is larger than 20 by 20 m."""
    x_m, y_m = np.random.default_rng(1).uniform(0.0, 80.0, (2, 6400))
    for group in compact_groups(np.stack([x_m, y_m])):
        assert max(np.ptp(x_m[group]), np.ptp(y_m[group])) < 20.0


@pytest.mark.parametrize("apart_m", [0.0, 5.0])
def test_no_square_that_is_near_is_missed(apart_m):
    rng = np.random.default_rng(2)
    squares = np.concatenate([rng.uniform(0.0, 100.0, (2, 500)), rng.choice([1, 2, 8], (1, 500))])
    group = squares[:, :20]
    reach_m = 0.5 * (squares[2] + group[2, :, None]) + apart_m
    is_near = np.abs(squares[0] - group[0, :, None]) <= reach_m
    is_near &= np.abs(squares[1] - group[1, :, None]) <= reach_m
    assert set(np.flatnonzero(np.any(is_near, axis=0))) <= set(around(squares, group, apart_m))


def test_far_squares_are_left_out():
    squares = np.array([[0.0, 3.0, 50.0, 0.0], [0.0, 0.0, 0.0, 50.0], [2.0, 2.0, 2.0, 2.0]])
    np.testing.assert_array_equal(around(squares, squares[:, :1]), [0])
    np.testing.assert_array_equal(around(squares, squares[:, :1], 1.0), [0, 1])
