from itertools import product

import numpy as np
import pytest

from logger.core.model.path_loss import (
    distance_m,
    level_dbm,
    level_gradient,
    level_slopes,
    log_distance,
    log_distance_db,
    receiver_error_db2,
)


def test_decades_and_the_clamp():
    dx_m = np.array([10.0, 60.0, 0.0, 0.3, 1.0])
    dy_m = np.array([0.0, 80.0, 0.0, 0.4, 0.0])
    assert log_distance_db(dx_m, dy_m) == pytest.approx([10.0, 20.0, 0.0, 0.0, 0.0])


def test_offsets_are_broadcast():
    assert log_distance_db(np.ones((3, 1)), np.ones(4)).shape == (3, 4)


def test_squared_distance_is_that_expected_of_an_uncertain_receiver():
    error_m = np.random.default_rng(1).normal(size=(2, 200_000))
    expected = np.mean((30.0 + 4.0 * error_m[0]) ** 2 + (4.0 * error_m[1]) ** 2 + 25.0)
    assert distance_m(log_distance_db(30.0, 0.0, 5.0, 4.0)) ** 2 == pytest.approx(expected, 1e-3)


@pytest.mark.parametrize(("height_m", "sigma_m"), list(product((0.0, 5.0), (0.0, 3.0))))
def test_slopes_are_differences_of_levels(height_m, sigma_m):
    x, y = np.random.default_rng(2).normal(scale=30.0, size=(2, 50))
    p0_dbm, eta, step = -30.0, 2.7, 1e-5

    def level(dx, dy, p0, exponent):
        return level_dbm(p0, exponent, log_distance_db(x + dx, y + dy, height_m, sigma_m))

    slopes = level_slopes(x, y, eta, height_m, sigma_m)
    for k, unit in enumerate(np.eye(4)):
        ahead, behind = (level(*(np.array([0, 0, p0_dbm, eta]) + s * unit)) for s in (step, -step))
        np.testing.assert_allclose(slopes[:, k], (ahead - behind) / (2.0 * step), atol=1e-7)


def test_plain_floats_give_the_same_as_arrays():
    for dx_m, dy_m in np.random.default_rng(3).normal(scale=20.0, size=(20, 2)).tolist():
        beyond_m2 = 5.0**2 + 2.0 * 3.0**2
        by_x, by_y, by_eta, per_m2 = level_gradient(dx_m, dy_m, 2.7, beyond_m2)
        slopes = level_slopes(np.array([dx_m]), np.array([dy_m]), 2.7, 5.0, 3.0)
        assert (by_x, by_y, 1.0, by_eta) == pytest.approx(tuple(slopes[0]), rel=1e-12)
        assert log_distance(dx_m**2 + dy_m**2 + beyond_m2) == pytest.approx(-by_eta, rel=1e-12)
        error_db2 = receiver_error_db2(2.7, np.array(3.0), np.array(-by_eta))
        assert 3.0**2 * per_m2 == pytest.approx(float(error_db2), rel=1e-12)


def test_within_one_metre_the_level_is_that_at_one_metre():
    assert level_gradient(0.1, 0.2, 3.0, 0.0)[2] == 0.0
    np.testing.assert_array_equal(
        level_slopes(np.array([0.1]), np.array([0.2]), 3.0), [[0.0, 0.0, 1.0, 0.0]]
    )
