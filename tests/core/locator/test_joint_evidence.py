from dataclasses import replace

import numpy as np
import pytest
import scipy.special
import scipy.stats

from logger.core.locator.joint_evidence import Joint, log_weights
from logger.core.locator.pipeline import locate
from logger.core.model.blocks import NOTHING_CENSORED, Censored, blocks
from logger.core.model.noise import whiteners
from logger.core.model.prior import Hypothesis, Prior, Station
from logger.core.places import Places
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import FLOOR_DBM, censor_at_floor, observations, simulate

PRIOR = Prior(noise=noise_groups(Hypothesis(0.3, 30.0)), stations=(Station(1.0, 5.0),))


def track_of(side=-1.0, limit_dbm=-82.0, count=4):
    """Six blocks of one reading, and places beyond the scale between them."""
    x = np.arange(6) * 25.0
    level = -70.0 - 2.0 * np.arange(6) + 3.0 * np.random.default_rng(8).normal(size=6)
    positions = np.linspace(10.0, 160.0, count), np.full(count, 5.0)
    gone = Censored(Places.of(*positions), *(np.full(count, v) for v in (limit_dbm, side, 1.0)))
    return replace(blocks(observations(x, 0 * x, level), 300), censored=gone)


def by_boxes(track, number, x_m, y_m):
    """Log evidence from the covariance of all levels, P0 and eta in it: a density times the
    probability of a box.
    """
    gone, (a, d_c, *_) = track.censored, PRIOR.hypotheses[number]
    x, y = (
        np.append(track.places.x_m, gone.places.x_m),
        np.append(track.places.y_m, gone.places.y_m),
    )
    n = len(track)
    shadow = (1.0 - a) * np.exp(-np.hypot(x[:, None] - x, y[:, None] - y) / max(d_c, 1.0))
    rounding = np.where(np.arange(len(x)) < n, 1.0 / 12.0 / PRIOR.sigma_db**2, 0.0)
    distance_db = 5.0 * np.log10((x - x_m) ** 2 + (y - y_m) ** 2 + PRIOR.height_m**2)
    mean = PRIOR.p0_dbm - PRIOR.eta * distance_db
    of_theta = PRIOR.p0_sigma_db**2 + PRIOR.eta_sigma**2 * distance_db[:, None] * distance_db
    taus = np.log(PRIOR.sigma_db) + np.linspace(-2.0, 2.0, 41)
    found = []
    for tau in taus:
        total = np.exp(2.0 * tau) * (shadow + np.diag(a + rounding)) + of_theta
        levels = scipy.stats.multivariate_normal(mean[:n], total[:n, :n])
        gain = total[n:, :n] @ np.linalg.inv(total[:n, :n])
        there, left = (
            mean[n:] + gain @ (track.level_dbm - mean[:n]),
            total[n:, n:] - gain @ total[:n, n:],
        )
        sign = gone.side
        box = scipy.stats.multivariate_normal(
            -sign * there, sign[:, None] * left * sign, maxpts=200_000
        )
        beyond = box.logcdf(-sign * gone.limit_dbm + 0.5)
        found.append(levels.logpdf(track.level_dbm) + beyond)
    weight = scipy.stats.norm.logpdf(taus, np.log(PRIOR.sigma_db), PRIOR.sigma_log_sd)
    return scipy.special.logsumexp(np.array(found) + weight) + np.log(taus[1] - taus[0])


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(("side", "limit_dbm"), [(-1.0, -82.0), (-1.0, -90.0), (1.0, -74.0)])
def test_evidence_agrees_with_brute_force(number, side, limit_dbm):
    track = track_of(side, limit_dbm)
    joint = Joint(track, PRIOR, whiteners(track, PRIOR, [number])[0])
    for position in ((100.0, 60.0), (20.0, -150.0)):
        assert joint.log_p(Places.of(*position)) == pytest.approx(
            by_boxes(track, number, *position), abs=0.2
        )


def test_asked_again_it_says_the_same():
    """It begins where it ended before: at sigma and sites of another place."""
    track = track_of(count=30)
    for noise in whiteners(track, PRIOR):
        joint = Joint(track, PRIOR, noise)
        first = joint.log_p(Places.of(100.0, 60.0))
        joint.log_p(Places.of(400.0, -300.0))
        assert joint.log_p(Places.of(100.0, 60.0)) == pytest.approx(first, abs=0.3)


def test_evidence_over_places_agrees_with_the_sum_over_all_of_them():
    track = track_of(count=12)
    net = np.linspace(-200.0, 300.0, 16)
    x, y = (v.ravel() for v in np.meshgrid(net, net))
    found = whiteners(track, PRIOR)
    exact = np.array(
        [
            [joint.log_p(Places.of(*at)) for at in zip(x, y, strict=True)]
            for joint in _joints(track, found)
        ]
    )
    about = exact + 0.5 * np.sin(x / 40.0)  # what says where to look is wrong by half a nat
    log_p = log_weights(track, PRIOR, found, about, np.zeros(len(x)), Places.of(x, y), 24)
    summed = scipy.special.logsumexp(exact, axis=1) - np.log(len(x)) + PRIOR.noise_table.log_odds
    np.testing.assert_allclose(log_p, summed, atol=0.35)


def _joints(track, found):
    return [Joint(track, PRIOR, noise) for noise in found]


def dense_walk(rng, white_db, shadow_db):
    """Readings every 1.4 m: what is beyond the floor alternates with what is not, or comes in
    stretches.
    """
    return censor_at_floor(
        simulate(rng, "L", white_db=white_db, shadow_db=shadow_db, d_c=15.0, count=300)[0], 0.45
    )


@pytest.mark.slow
def test_what_is_beyond_the_floor_tells_white_noise_from_shadowing():
    rng = np.random.default_rng(12)
    white = [locate(dense_walk(rng, 3.0, 0.0)) for _ in range(3)]
    shadowed = [locate(dense_walk(rng, 0.0, 6.0)) for _ in range(3)]
    assert np.median([found.white_share for found in white]) > 0.9
    assert np.median([found.white_share for found in shadowed]) < 0.2


def test_nothing_beyond_the_scale_is_the_evidence_of_the_levels():
    """One place where any level would be beyond the scale leaves that of the levels."""
    track = track_of(count=1)
    far = track.censored._replace(
        places=Places.of(3e4, 5.0), limit_dbm=np.array([FLOOR_DBM + 80.0])
    )
    one = Joint(replace(track, censored=far), PRIOR, whiteners(track, PRIOR, [0])[0])
    none = Joint(replace(track, censored=NOTHING_CENSORED), PRIOR, whiteners(track, PRIOR, [0])[0])
    assert one.log_p(Places.of(100.0, 60.0)) == pytest.approx(
        none.log_p(Places.of(100.0, 60.0)), abs=0.01
    )
