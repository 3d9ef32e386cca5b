import numpy as np
import pytest

from logger.core.guidance.forecast import STEP_M, Forecast, Forecaster, information_nats
from logger.core.guidance.sample import PositionSample
from logger.core.model.blocks import NOTHING_CENSORED, blocks, single
from logger.core.model.noise import covariances, shadowing
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.model.prior import Prior
from logger.core.places import Places
from tests.kit import walks

SIGMA_M = 4.0


def _walk(rng, count=12):
    x_m, y_m = np.linspace(0.0, 220.0, count), rng.normal(0.0, 5.0, count)
    level = rng.normal(-75.0, 5.0, count)
    rows = np.stack([x_m, y_m, level, np.full(count, SIGMA_M**2), np.ones(count)])
    return single(rows, 2.0, NOTHING_CENSORED)


def _sample(number, theta_cov=0.0):
    prior = Prior()
    spread = np.array([[4.0, 4.0], [0.5, 0.4], [0.3, 0.2]]) * theta_cov
    return PositionSample(
        places=Places.of([80.0, 300.0], [60.0, -40.0]),
        weight=np.array([0.7, 0.3]),
        p0_dbm=np.array([-30.0, -25.0]),
        eta=np.array([2.5, 2.8]),
        theta_cov=spread,
        number=number,
        noise=prior.hypotheses[number],
        sigma_db=5.0,
    )


def _expected_dbm(sample, x_m, y_m):
    at = sample.places
    east, north = at.x_m[:, None] - x_m, at.y_m[:, None] - y_m
    away_db = log_distance_db(east, north, Prior().height_m, SIGMA_M)
    return level_dbm(sample.p0_dbm[:, None], sample.eta[:, None], away_db)


@pytest.mark.parametrize("number", [1, 3, 6, 9])
def test_is_the_conditional_of_the_joint_gaussian(number):
    """Kriging by the textbook formula, with coefficients that are known."""
    walk, sample, prior = _walk(np.random.default_rng(0)), _sample(number), Prior()
    x_m, y_m = np.array([120.0, 145.0, 400.0]), np.array([40.0, 60.0, 0.0])
    k_pp = covariances(walk, prior, [number])[0]
    apart_m = np.hypot(x_m[:, None] - walk.places.x_m, y_m[:, None] - walk.places.y_m)
    k_qp = shadowing(apart_m, sample.noise)
    residual = walk.level_dbm - _expected_dbm(sample, walk.places.x_m, walk.places.y_m)
    level = _expected_dbm(sample, x_m, y_m) + residual @ np.linalg.solve(k_pp, k_qp.T)
    found = Forecaster(sample, walk, prior).at(Places.of(x_m, y_m))
    np.testing.assert_allclose(found.level_dbm, level, rtol=1e-9)
    between_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    left = shadowing(between_m, sample.noise) - k_qp @ np.linalg.solve(k_pp, k_qp.T)
    off_diagonal = ~np.eye(3, dtype=bool)
    np.testing.assert_allclose(
        found.covariance[off_diagonal], 25.0 * left[off_diagonal], rtol=1e-7, atol=1e-9
    )


@pytest.mark.parametrize("number", [3, 9])
def test_points_beside_blocks_of_many_places_have_a_covariance(number):
    """Levels of a block are averaged over its points; those of a way are not."""
    x_m = np.linspace(0.0, 400.0, 400)
    obs = walks.observations(x_m, np.zeros(400), np.full(400, -75.0))
    walk = blocks(obs, 8)
    assert not walk.of_one_point
    forecast = Forecaster(_sample(number), walk, Prior()).at(Places.of(x_m[::8], np.zeros(50)))
    assert np.min(np.linalg.eigvalsh(forecast.covariance)) > 0.0


def test_unknown_coefficients_add_what_linear_propagation_gives():
    walk, prior = _walk(np.random.default_rng(1)), Prior()
    x_m, y_m = np.array([120.0, 200.0]), np.array([90.0, 90.0])
    without = Forecaster(_sample(0), walk, prior).at(Places.of(x_m, y_m)).covariance
    sample = _sample(0, theta_cov=1.0)
    added = Forecaster(sample, walk, prior).at(Places.of(x_m, y_m)).covariance - without
    expected = np.zeros((2, 2))
    for i, weight in enumerate(sample.weight):
        east, north = sample.places.x_m[i] - x_m, sample.places.y_m[i] - y_m
        away_db = log_distance_db(east, north, prior.height_m, SIGMA_M)
        var_p0, cov, var_eta = sample.theta_cov[:, i]
        slopes = np.stack([np.ones(2), -away_db])
        expected += weight * slopes.T @ np.array([[var_p0, cov], [cov, var_eta]]) @ slopes
    np.testing.assert_allclose(added, expected, rtol=1e-9)


def test_a_street_that_was_walked_is_known():
    walk, prior = _walk(np.random.default_rng(2)), Prior()
    forecaster = Forecaster(_sample(2), walk, prior)
    walked = forecaster.at(Places.of(np.array([100.0]), np.array([0.0]))).covariance[0, 0]
    new = forecaster.at(Places.of(np.array([100.0]), np.array([10.0 * STEP_M]))).covariance[0, 0]
    assert walked < 0.5 * new


def _mutual_information(forecast, draws=20_000):
    """Mutual information of position and levels by Monte Carlo, from the definition."""
    rng = np.random.default_rng(1)
    mean, weight = forecast.level_dbm, forecast.weight
    root = np.linalg.cholesky(forecast.covariance)
    drawn = rng.choice(len(weight), draws, p=weight)
    level = mean[drawn] + rng.standard_normal((draws, mean.shape[1])) @ root.T
    white = np.linalg.solve(root, (level[:, None] - mean).reshape(-1, mean.shape[1]).T).T
    log_p = -0.5 * np.sum(white**2, axis=1).reshape(draws, len(weight))
    own = log_p[np.arange(draws), drawn]
    return float(np.mean(own - np.log(np.exp(log_p) @ weight)))


@pytest.mark.parametrize("apart_db", [0.5, 2.0, 5.0, 20.0])
def test_is_a_close_lower_bound(apart_db):
    rng = np.random.default_rng(0)
    mean = -80.0 + apart_db * rng.standard_normal((6, 4))
    covariance = 4.0 * (np.eye(4) + 0.5)
    forecast = Forecast(mean, covariance, rng.dirichlet(np.ones(6)))
    true_nats = _mutual_information(forecast)
    bound_nats = information_nats(forecast, np.arange(4))
    assert bound_nats <= true_nats + 0.02
    assert bound_nats >= 0.25 * true_nats - 0.01


def test_positions_with_equal_levels_say_nothing():
    forecast = Forecast(np.full((3, 2), -70.0), np.eye(2), np.full(3, 1 / 3))
    assert information_nats(forecast, np.arange(2)) == pytest.approx(0.0)


def test_positions_far_apart_say_which_one_it_is():
    forecast = Forecast(np.array([[-60.0], [-90.0]]), np.eye(1), np.array([0.5, 0.5]))
    assert information_nats(forecast, np.array([0])) == pytest.approx(np.log(2.0))
