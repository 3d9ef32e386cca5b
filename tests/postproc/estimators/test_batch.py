from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

from logger.core.errors import EstimationError
from logger.core.geo import Utm
from logger.core.observations import CellObservations
from postproc.estimators import batch

SOURCE = np.array([60.0, 90.0, -30.0, 3.0])


def walk(rng, *, noise_db=3.0, count=400, correlation=0.0, straight=False):
    """An L-shaped or straight walk of 2 m steps past SOURCE."""
    s = 2.0 * np.arange(count)
    x = s - count if straight else np.minimum(s, count)
    y = 0.0 * s if straight else np.maximum(s - count, 0.0)
    noise = rng.normal(size=count)
    for k in range(1, count):
        noise[k] = correlation * noise[k - 1] + np.sqrt(1.0 - correlation**2) * noise[k]
    level = SOURCE[2] - 10.0 * SOURCE[3] * np.log10(np.hypot(x - SOURCE[0], y - SOURCE[1])) + noise_db * noise
    at = np.arange(count)
    return CellObservations("c", None, Utm(32), at * 10**9, x, y, np.zeros(count), level, at)


def test_linear_part_agrees_with_dense_least_squares():
    rng = np.random.default_rng(1)
    distance_db, level = rng.uniform(10.0, 25.0, 50), rng.normal(-80.0, 5.0, 50)
    design = np.column_stack([np.ones(50), -distance_db])
    theta, cofactor = batch.fit_linear(distance_db, level)
    np.testing.assert_allclose(theta, scipy.linalg.lstsq(design, level)[0], rtol=1e-9)
    np.testing.assert_allclose(cofactor, np.linalg.inv(design.T @ design), rtol=1e-9)


def test_jacobian_agrees_with_central_differences():
    obs = walk(np.random.default_rng(2))
    step = 1e-4
    numeric = [
        (batch.residuals(SOURCE + d, obs) - batch.residuals(SOURCE - d, obs)) / (2 * step) for d in step * np.eye(4)
    ]
    np.testing.assert_allclose(batch.jacobian(SOURCE, obs), np.column_stack(numeric), rtol=1e-6, atol=1e-8)


def test_finds_the_minimum_scipy_finds():
    obs = walk(np.random.default_rng(3))
    fit = batch.fit(obs, [(40.0, 70.0), (300.0, 300.0)])
    expected = scipy.optimize.least_squares(
        lambda s: batch.residuals(s, obs), SOURCE, x_scale=(10, 10, 3, 0.3), xtol=1e-12
    )
    assert fit.converged
    np.testing.assert_allclose(fit.state, expected.x, rtol=1e-4)
    assert fit.cost == pytest.approx(expected.cost, rel=1e-9)
    assert fit.sigma_db == pytest.approx(3.0, abs=0.4)


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_robust_losses_withstand_outliers(loss):
    rng = np.random.default_rng(4)
    obs = walk(rng)
    level = obs.level_dbm.copy()
    level[rng.choice(len(obs), 40, replace=False)] += 25.0
    fit = batch.fit(replace(obs, level_dbm=level), [(40.0, 70.0)], loss=loss)
    assert np.hypot(*(fit.state[:2] - SOURCE[:2])) < 30.0


@pytest.mark.parametrize(("correlation", "whiten"), [(0.0, False), (0.8, False), (0.8, True)])
def test_covariance_is_true(correlation, whiten):
    rng = np.random.default_rng(5)
    nees = []
    for _ in range(60):
        obs = walk(rng, noise_db=2.0, correlation=correlation)
        fit = batch.fit(obs, [(60.0, 90.0)], whiten=whiten)
        error = (fit.state - SOURCE)[:2]
        nees.append(error @ np.linalg.solve(fit.covariance[:2, :2], error))
    assert np.mean(np.array(nees) < 5.991) > 0.8


def test_mirror_image_is_a_rival():
    obs = walk(np.random.default_rng(6), straight=True)
    fit = batch.fit(obs, [(60.0, 80.0), (60.0, -80.0), (50.0, 85.0)])
    assert len(fit.rivals) == 1
    assert fit.rivals[0][1] == pytest.approx(-fit.state[1], abs=0.1)


def test_what_is_not_observed_is_uncertain():
    obs = walk(np.random.default_rng(7))
    still = replace(obs, x_m=np.zeros(len(obs)), y_m=np.zeros(len(obs)))
    fit = batch.fit(still, [(50.0, 0.0)])
    assert np.sqrt(fit.covariance[0, 0]) > 1000.0


def test_too_few_readings():
    with pytest.raises(EstimationError, match="at least 5"):
        batch.fit(walk(np.random.default_rng(8), count=4), [(0.0, 0.0)])
