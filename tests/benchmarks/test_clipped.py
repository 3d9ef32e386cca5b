import numpy as np
import pytest
import scipy.special
import scipy.stats

from benchmarks.scoreboard import exact, ours
from benchmarks.scoreboard.cases import CASES
from benchmarks.scoreboard.clipped import ClippedLikelihood
from benchmarks.scoreboard.likelihood import Likelihood, nearest_m
from benchmarks.scoreboard.score import EXACT_CLIPPED, score
from benchmarks.scoreboard.world import Noise, Walk

FLOOR_DBM = -110.0


def short_walk(count=30):
    rng = np.random.default_rng(4)
    x = np.arange(count) * 12.0
    level = -49.0 - 27.0 * np.log10(np.hypot(x - 60.0, 40.0)) + 3.0 * rng.normal(size=count)
    return Walk(x, np.zeros(count), np.maximum(np.round(level), FLOOR_DBM))


def by_net(walk, x_m, y_m):
    """The same by a sum over a grid of P0 and eta; only differences are defined."""
    uncensored = walk.level_dbm > FLOOR_DBM
    distance_db = 10.0 * np.log10(np.maximum(np.hypot(walk.x_m - x_m, walk.y_m - y_m), 1.0))
    prior, noise = ours.LINEAR_PRIOR, Noise(3.0, step_db=1.0)
    p0, eta = np.meshgrid(
        np.linspace(-110.0, 130.0, 600), np.linspace(-1.0, 9.0, 400), indexing="ij"
    )
    mean = p0[..., None] - eta[..., None] * distance_db
    log_p = np.sum(
        scipy.stats.norm.logpdf(walk.level_dbm[uncensored], mean[..., uncensored], noise.total_db),
        axis=-1,
    )
    log_p += np.sum(
        scipy.special.log_ndtr((FLOOR_DBM + 0.5 - mean[..., ~uncensored]) / 3.0), axis=-1
    )
    log_p -= 0.5 * (
        prior.precision[0] * (p0 - prior.mean[0]) ** 2
        + prior.precision[1] * (eta - prior.mean[1]) ** 2
    )
    place = np.array([x_m]), np.array([y_m])
    return float(scipy.special.logsumexp(log_p)) + float(
        ours.log_position_prior(nearest_m(walk, *place), ours.log_reach_odds(walk))[0]
    )


def test_agrees_with_a_sum_over_power_and_exponent():
    walk, places = (
        short_walk(),
        np.array([(60.0, 40.0), (90.0, -60.0), (150.0, 200.0), (-300.0, 100.0)]),
    )
    assert 5 < np.count_nonzero(walk.level_dbm == FLOOR_DBM) < 25
    found = ClippedLikelihood(walk, Noise(3.0, step_db=1.0), FLOOR_DBM).log_p(*places.T)
    expected = [by_net(walk, *place) for place in places.tolist()]
    np.testing.assert_allclose(found - found[0], np.subtract(expected, expected[0]), atol=0.1)


def test_without_a_clipped_level_it_is_the_plain_one():
    world = CASES["white-L"].world(1, 0)
    plain, clipped = (
        Likelihood(world.walk, world.noise),
        ClippedLikelihood(world.walk, world.noise, -300.0),
    )
    x_m, y_m = (world.sources[0][k] + np.array([0.0, 30.0, -80.0]) for k in range(2))
    np.testing.assert_allclose(clipped.log_p(x_m, y_m), plain.log_p(x_m, y_m), rtol=1e-9)


def test_clipping_costs_something_and_shadowing_has_no_such_limit():
    world = CASES["clip-70"].world(1, 0)
    whole = exact.answer(world.whole, world.noise)
    clipped = exact.posterior(ClippedLikelihood(world.walk, world.noise, world.floor_dbm))
    assert clipped.region.area_m2 > whole.region.area_m2
    assert score(CASES["clip-45-shadow"].world(1, 0), EXACT_CLIPPED, 0).failure is not None


@pytest.mark.parametrize("name", ["clip-20", "clip-45-shadow"])
def test_clipped_cases_are_told_what_was_rounded(name):
    world = CASES[name].world(1, 0)
    assert world.noise.step_db == 1.0
    assert np.array_equal(world.whole.level_dbm, np.round(world.whole.level_dbm))
