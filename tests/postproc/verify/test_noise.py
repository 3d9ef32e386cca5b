import numpy as np
import pytest

from logger.core.locator.blocks import blocks
from logger.core.locator.evidence import covariance, whiteners_of
from logger.core.locator.prior import Prior
from postproc.verify.noise import covariances
from tests.kit.walks import observations, path

PRIOR = Prior(decorrelation_m=(15.0, 60.0), white_shares=(0.1,))


def test_blocks_of_one_point_are_points():
    x, y = path("L", 30, 9.0)
    walk = blocks(observations(x, y, np.zeros(30)), 40)
    for k, hypothesis in zip(covariances(walk, PRIOR), PRIOR.hypotheses, strict=True):
        assert k == pytest.approx(covariance(walk, hypothesis, PRIOR.sigma_db))


def test_shadowing_of_a_block_is_the_mean_of_its_readings():
    x, y = path("random", 240, 3.0)
    walk = blocks(observations(x, y, np.zeros(240)), 20)
    rng, prior = np.random.default_rng(1), Prior(decorrelation_m=(15.0,), white_shares=(0.0,))
    apart = np.hypot(*(v[:, None] - v for v in (walk.point_x_m, walk.point_y_m)))
    drawn = np.linalg.cholesky(np.exp(-apart / 15.0)) @ rng.normal(size=(len(apart), 20_000))
    means = np.add.reduceat(walk.weight[:, None] * drawn, walk.first)
    rounding = np.eye(len(walk)) / 12.0 / prior.sigma_db**2
    assert covariances(walk, prior)[1] - rounding == pytest.approx(np.cov(means), abs=0.04)
    assert np.max(np.diagonal(covariances(walk, prior)[1])) < 0.9


def test_what_is_whitened_is_white():
    x, y = path("square", 240, 3.0)
    walk = blocks(observations(x, y, np.zeros(240)), 20)
    k = covariances(walk, PRIOR)
    for one, found in zip(k, whiteners_of(k), strict=True):
        assert found.matrix @ one @ found.matrix.T == pytest.approx(np.eye(len(walk)), abs=1e-9)
        assert found.log_det == pytest.approx(np.linalg.slogdet(one)[1])
    assert [found.number for found in whiteners_of(k)] == [0, 1, 2]
