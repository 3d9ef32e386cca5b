import numpy as np
import pytest

from logger.core.model import noise
from logger.core.model.blocks import blocks
from logger.core.model.prior import Hypothesis, Prior
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, path

PRIOR = Prior(noise=noise_groups(Hypothesis(0.3, 30.0)))


def test_shadowing_of_a_block_is_the_mean_over_its_points():
    """Against drawn fields."""
    x, y = path("random", 240, 3.0)
    walk = blocks(observations(x, y, np.zeros(240)), 20)
    rng, prior = np.random.default_rng(1), Prior(noise=noise_groups(Hypothesis(0.0, 15.0)))
    apart = np.hypot(*(v[:, None] - v for v in (walk.points.x_m, walk.points.y_m)))
    samples = np.linalg.cholesky(np.exp(-apart / 15.0)) @ rng.normal(size=(len(apart), 20_000))
    means = np.add.reduceat(walk.weight[:, None] * samples, walk.first)
    rounding = np.eye(len(walk)) / 12.0 / prior.sigma_db**2
    found = noise.covariances(walk, prior)[1]
    assert found - rounding == pytest.approx(np.cov(means), abs=0.04)
    assert np.max(np.diagonal(found)) < 0.9


def test_levels_that_a_modem_averages_are_as_a_filter_gives_them():
    """Against the filter itself: shadowing at each 0.1 m of a way, with a memory of 5 m."""
    step_m, memory_m, scale_m = 0.1, 5.0, 30.0
    way_m = np.arange(0.0, 60.0, step_m)
    weight = np.exp(-way_m / memory_m) * step_m / memory_m
    apart_m = np.array([0.0, 2.0, 10.0, 40.0])
    between_m = np.abs(apart_m[:, None, None] + way_m[:, None] - way_m)
    seen = np.einsum("i,kij,j->k", weight, np.exp(-between_m / scale_m), weight)
    hypothesis = Hypothesis(0.2, scale_m, averaged_m=memory_m)
    assert noise.shadowing(apart_m, hypothesis) == pytest.approx(0.8 * seen / seen[0], abs=2e-3)


def test_what_is_whitened_is_white():
    x, y = path("square", 240, 3.0)
    walk = blocks(observations(x, y, np.zeros(240)), 20)
    k = noise.covariances(walk, PRIOR)
    for one, found in zip(k, noise.whiteners_of(k), strict=True):
        assert found.matrix @ one @ found.matrix.T == pytest.approx(np.eye(len(walk)), abs=1e-9)
        assert found.log_det == pytest.approx(np.linalg.slogdet(one)[1])
    assert [found.number for found in noise.whiteners_of(k)] == [0, 1]


@pytest.mark.parametrize("n", [1, 2, 16, 17, 75])
def test_inverse_of_lower_triangular_matrices(n):
    root = np.tril(np.random.default_rng(n).normal(size=(3, n, n)), -1) / n + 2.0 * np.eye(n)
    found = noise.inverse_of_lower(root)
    np.testing.assert_allclose(found @ root, np.broadcast_to(np.eye(n), root.shape), atol=1e-12)
    np.testing.assert_array_equal(found, np.tril(found))


def test_whiteners_of_some_hypotheses_are_those_of_all():
    level = np.linspace(-60.0, -90.0, 40)
    track = blocks(observations(np.linspace(0.0, 300.0, 40), np.zeros(40), level), 40)
    every = noise.whiteners(track, PRIOR)
    for one in noise.whiteners(track, PRIOR, [1]):
        np.testing.assert_allclose(one.matrix, every[one.number].matrix, rtol=1e-12, atol=1e-12)
        assert one.log_det == pytest.approx(every[one.number].log_det)
