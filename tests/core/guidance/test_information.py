import numpy as np
import pytest

from logger.core.guidance.forecast import Forecast
from logger.core.guidance.information import information_nats


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
