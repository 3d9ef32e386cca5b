import numpy as np
import pytest
import scipy.stats

from benchmarks.scoreboard import exact, ours
from benchmarks.scoreboard.likelihood import Likelihood, nearest_m
from benchmarks.scoreboard.walks import SHAPES
from benchmarks.scoreboard.world import Noise, Walk

WHITE, SHADOWED = Noise(3.0), Noise(1.0, 5.0, 40.0, in_plane=True, step_db=1.0)
TWO_SCALE = Noise(1.0, 7.0, 20.0, in_plane=True, step_db=1.0, long_share=0.75, long_m=300.0)
SOURCE = np.array([110.0, 70.0])
AROUND = np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])


def simulated_walk(noise, shape="L", count=40, step_m=10.0, seed=1):
    rng = np.random.default_rng(seed)
    x_m, y_m = SHAPES[shape](rng, count, step_m)
    level_dbm = -35.0 - 28.0 * np.log10(np.hypot(x_m - SOURCE[0], y_m - SOURCE[1]))
    return Walk(
        x_m,
        y_m,
        level_dbm + np.linalg.cholesky(noise.covariance_db2(x_m, y_m)) @ rng.normal(size=count),
    )


def by_quadrature(walk, noise, x_m, y_m):
    """Log of the integral of likelihood times priors over P0 and eta on a fine grid.

    The prior of the position is included.
    """
    loss_db = 10.0 * np.log10(np.hypot(walk.x_m - x_m, walk.y_m - y_m))
    covariance = noise.covariance_db2(walk.x_m, walk.y_m)
    prior = ours.LINEAR_PRIOR
    sigma = prior.precision**-0.5
    middle = np.mean(loss_db)
    eta = np.linspace(-12.0, 12.0, 501)
    at_middle = 5.0 * noise.total_db * np.linspace(-1.0, 1.0, 301) + np.mean(walk.level_dbm)
    p0_dbm = at_middle[:, None] + eta * middle
    misfit = walk.level_dbm - p0_dbm[..., None] + eta[:, None] * loss_db
    log_p = -0.5 * np.einsum(
        "abn,nm,abm->ab", misfit, np.linalg.inv(covariance), misfit, optimize=True
    )
    log_p += scipy.stats.norm.logpdf(p0_dbm, prior.mean[0], sigma[0]) + scipy.stats.norm.logpdf(
        eta, prior.mean[1], sigma[1]
    )
    away_m = np.array(np.min(np.hypot(walk.x_m - x_m, walk.y_m - y_m)))
    odds = ours.log_reach_odds(walk)
    return scipy.special.logsumexp(log_p) + float(ours.log_position_prior(away_m, odds))


@pytest.mark.parametrize("noise", [WHITE, SHADOWED, TWO_SCALE])
def test_closed_form_agrees_with_brute_force(noise):
    walk = simulated_walk(noise)
    x_m, y_m = np.array([150.0, 60.0, -300.0, 900.0]), np.array([90.0, 200.0, -250.0, 40.0])
    closed = Likelihood(walk, noise).log_p(x_m, y_m)
    brute = np.array([by_quadrature(walk, noise, *place) for place in zip(x_m, y_m, strict=True)])
    np.testing.assert_allclose(closed - closed[0], brute - brute[0], atol=1e-6)


def test_the_prior_of_the_place_has_its_mass():
    """On a grid that is finest on the walk each reach has its probability."""
    walk = simulated_walk(WHITE, count=40, step_m=20.0)
    axis = np.sinh(np.linspace(-9.0, 9.0, 601)) * 3.0
    middle, size = 0.5 * (axis[1:] + axis[:-1]), np.diff(axis)
    x_m, y_m = np.meshgrid(middle + np.mean(walk.x_m), middle + np.mean(walk.y_m))
    area_m2 = np.outer(size, size).ravel()
    away_m = nearest_m(walk, x_m.ravel(), y_m.ravel())
    log_odds = ours.log_reach_odds(walk)
    total = np.exp(ours.log_position_prior(away_m, log_odds)) @ area_m2
    assert total == pytest.approx(sum(one.probability for one in ours.PRIOR.reaches), rel=0.01)
    for number, one in enumerate(ours.PRIOR.reaches):
        alone = np.full(len(log_odds), -np.inf)
        alone[number] = log_odds[number]
        held = np.exp(ours.log_position_prior(away_m, alone)) @ area_m2
        assert held == pytest.approx(one.probability, rel=0.01)


@pytest.mark.parametrize("noise", [Noise(1.0), Noise(0.5, 3.0, 20.0, step_db=1.0)])
def test_region_and_mode_agree_with_a_uniform_fine_grid(noise):
    walk = simulated_walk(noise, "square", count=60)
    found = exact.answer(walk, noise)
    mean = np.array([found.modes[0].x_m, found.modes[0].y_m])
    reach_m = 8.0 * np.sqrt(np.max(np.linalg.eigvalsh(found.modes[0].covariance)))
    cell_m = 0.1 * np.sqrt(np.min(np.linalg.eigvalsh(found.modes[0].covariance)))
    axis = np.arange(-reach_m, reach_m, cell_m)
    x_m, y_m = (v.ravel() for v in np.meshgrid(mean[0] + axis, mean[1] + axis))
    log_p = Likelihood(walk, noise).log_p(x_m, y_m)
    mass = np.exp(log_p - np.max(log_p))
    mass /= mass.sum()
    held = np.cumsum(np.sort(mass)[::-1])
    assert len(found.modes) == 1
    assert found.region.area_m2 == pytest.approx(np.searchsorted(held, 0.95) * cell_m**2, rel=0.04)
    # a mode is what holds 99.9 %
    assert np.hypot(mass @ x_m - mean[0], mass @ y_m - mean[1]) < 0.05 * reach_m / 8.0
    off_m = [
        mass @ np.hypot(x_m - found.x_m - dx, y_m - found.y_m - dy)
        for dx, dy in AROUND * 2.0 * cell_m
    ]
    assert np.argmin(off_m) == 0
    covariance = np.cov(np.vstack([x_m, y_m]), aweights=mass, ddof=0)
    np.testing.assert_allclose(
        found.modes[0].covariance, covariance, rtol=0.1, atol=0.05 * covariance.max()
    )


def test_cells_are_a_quarter_of_the_posterior_sigma():
    walk = simulated_walk(Noise(1.0), count=200, step_m=3.0)
    found = exact.answer(walk, Noise(1.0))
    thinnest_m = np.sqrt(np.min(np.linalg.eigvalsh(found.modes[0].covariance)))
    assert np.max(found.region.size_m) <= 0.3 * thinnest_m


def test_straight_walk_leaves_two_equal_places():
    found = exact.answer(simulated_walk(WHITE, "straight", count=120, step_m=5.0), WHITE)
    assert [mode.probability for mode in found.modes] == pytest.approx([0.5, 0.5], abs=0.01)
    assert found.modes[0].y_m == pytest.approx(-found.modes[1].y_m, rel=0.01)


def test_region_holds_95_percent_of_truths_drawn_from_the_prior():
    rng = np.random.default_rng(5)
    held = []
    for _ in range(40):
        x_m, y_m = SHAPES["random"](rng, 100, 8.0)
        # uniform in the part of the prior that is flat; the rest has little mass beside so short a
        # tail
        while True:
            source = np.add(rng.uniform(-200, 200, 2), (rng.choice(x_m), rng.choice(y_m)))
            if np.min(np.hypot(x_m - source[0], y_m - source[1])) < 200.0:
                break
        prior = ours.LINEAR_PRIOR
        p0_dbm, eta = prior.mean + rng.normal(size=2) / np.sqrt(prior.precision)
        loss_db = 10.0 * np.log10(np.maximum(np.hypot(x_m - source[0], y_m - source[1]), 1.0))
        walk = Walk(x_m, y_m, p0_dbm - eta * loss_db + 3.0 * rng.normal(size=100))
        held.append(exact.answer(walk, WHITE).region.holds(tuple(source), 0.0))
    assert np.mean(held) >= 0.85  # 40 runs of 0.95: fewer than 34 in 1.4 %
