import numpy as np
import pytest
from scipy.optimize import least_squares

from logger.core.places import Places
from postproc.reproductions import specification_walks as walks
from postproc.reproductions.specification_walks import Station, circle, true_level_dbm

STATION = Station(140.0, 80.0, -30.0, 3.0)
NO_PRIOR = np.zeros(2)


def irregular_walk():
    rng = np.random.default_rng(1)
    steps_m = rng.normal(5.0, 20.0, 200), rng.normal(0.0, 20.0, 200)
    return Places.of(*map(np.cumsum, steps_m))


def test_the_slopes_are_those_of_the_levels():
    at = irregular_walk()
    step = 1e-5
    numeric = [
        (
            true_level_dbm(Station(*(np.array(STATION) + d)), at)
            - true_level_dbm(Station(*(np.array(STATION) - d)), at)
        )
        / (2.0 * step)
        for d in step * np.eye(4)
    ]
    assert walks.slopes(STATION, at) == pytest.approx(np.array(numeric).T, abs=1e-5)


def test_least_squares_reaches_the_bound_in_little_noise():
    at = irregular_walk()
    rng, sigma_db = np.random.default_rng(0), 0.05
    level_dbm = true_level_dbm(STATION, at)
    fits = []
    for _ in range(150):
        z = level_dbm + sigma_db * rng.normal(size=200)
        fits.append(
            least_squares(
                lambda s, z=z: true_level_dbm(Station(*s), at) - z, STATION, x_scale="jac"
            ).x
        )
    least = walks.least_covariance(walks.slopes(STATION, at), sigma_db**2, NO_PRIOR)
    # the sd of a variance over 150 fits is 12 %
    assert np.var(fits, axis=0) == pytest.approx(np.diag(least), rel=0.4)


def test_a_prior_is_information():
    g, precision = walks.slopes(STATION, circle(3)), np.array([0.25, 4.0])
    least = walks.least_covariance(walks.slopes(STATION, irregular_walk()), 9.0, precision)
    assert np.all(np.diag(least)[2:] < 1.0 / precision)
    assert np.linalg.matrix_rank(g) == 3


@pytest.mark.parametrize("variances", [(1.0, 1.0), (9.0, 0.04), (1e6, 1e4)])
def test_the_median_error_is_that_of_a_sample(variances):
    sample = np.random.default_rng(0).normal(size=(400_000, 2)) * np.sqrt(variances)
    assert walks.median_error_m(np.diag(variances)) == pytest.approx(
        np.median(np.hypot(*sample.T)), rel=0.01
    )
