from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
import scipy.stats

from logger.core.locator import censored
from logger.core.locator.blocks import Censored, blocks
from logger.core.locator.evidence import Evidence
from logger.core.locator.posterior import locate
from logger.core.locator.prior import Prior
from tests.kit.walks import FLOOR_DBM, clipped, observations, simulate

PRIOR = Prior(decorrelation_m=(30.0,), white_shares=(0.3,))
WHITE = [0]


# --- the normal distribution function ---


def test_log_normal_cdf_over_its_whole_range():
    u = np.linspace(-40.0, 10.0, 20_001)
    expected = scipy.stats.norm.logcdf(u)
    np.testing.assert_allclose(censored.log_normal_cdf(u), expected, atol=2e-7, rtol=0)
    low = u < 5.0  # beyond, the logarithm is smaller than the error that is allowed
    np.testing.assert_allclose(censored.log_normal_cdf(u[low]), expected[low], atol=2e-7, rtol=1e-6)


def test_log_normal_cdf_stays_finite_and_rises():
    u = np.concatenate([-np.logspace(6, -6, 2000), np.logspace(-6, 6, 2000)])
    found = censored.log_normal_cdf(u)
    assert np.all(np.isfinite(found))
    assert np.all(found <= 0.0)
    assert np.all(np.diff(found) > -1e-7)


# --- Laplace's integral ---


def levels_and_limits(side, count=5, at_m=(60.0, 300.0), limit_dbm=None):
    """Blocks of a walk with `count` places beyond the scale on one side, as some_evidence would have it."""
    x = np.arange(12) * 25.0
    obs = observations(x, 0 * x, -70.0 - np.arange(12))
    likely = -82.0 if side < 0 else -88.0
    limit = np.full(count, likely if limit_dbm is None else limit_dbm)
    place = np.linspace(*at_m, count), np.full(count, 40.0)
    ends = Censored(*place, limit, np.full(count, float(side)), np.arange(count) % 3 + 1.0)
    return replace(blocks(obs, 300), censored=ends)


def some_evidence(sigma_db=5.0, cov=(30.0, 0.62, 0.02)):
    """What levels might say of P0 and eta at two places, with one hypothesis."""
    theta = np.array([[[-25.0, -30.0]], [[2.6, 2.2]]])
    return Evidence(
        np.array([[-50.0, -52.0]]),
        theta,
        np.repeat(np.array(cov)[:, None, None], 2, axis=2),
        np.full((1, 2), sigma_db),
    )


def by_net(of_levels, h, track, worth, x_m, y_m):
    """Integral over P0 and eta of the product of all terms, with the mean and covariance it leaves."""
    gone, sigma_db = track.censored, of_levels.sigma_db[0, h]
    before, (v00, v01, v11) = of_levels.theta[:, 0, h], of_levels.theta_cov[:, 0, h]
    root = np.linalg.cholesky(np.array([[v00, v01], [v01, v11]]))
    distance_db = 5.0 * np.log10((gone.x_m - x_m) ** 2 + (gone.y_m - y_m) ** 2 + PRIOR.height_m**2)

    def log_p(u):
        theta = before + u @ root.T
        beyond = gone.side * (theta[..., :1] - theta[..., 1:] * distance_db - gone.limit_dbm) + 0.5  # half a step
        return scipy.stats.norm.logcdf(beyond / sigma_db) @ worth - 0.5 * np.sum(u * u, axis=-1) - np.log(2.0 * np.pi)

    mean = scipy.optimize.minimize(lambda u: -log_p(u), np.zeros(2), method="Nelder-Mead").x
    cov, v = 0.25 * np.eye(2), np.linspace(-8.0, 8.0, 81)
    for _ in range(6):  # the net is laid anew, turned and scaled, by the mass found before
        u = mean + np.stack(np.meshgrid(v, v, indexing="ij"), -1) @ np.linalg.cholesky(cov).T
        at = log_p(u)
        share = np.exp(at - at.max())
        total, share = share.sum() * (v[1] - v[0]) ** 2 * np.sqrt(np.linalg.det(cov)), share / share.sum()
        mean = np.einsum("ab,abi->i", share, u)
        cov = np.einsum("ab,abi,abj->ij", share, u - mean, u - mean) + 1e-6 * np.eye(2)
    return np.log(total) + at.max(), before + root @ mean, root @ cov @ root.T


def worst_laplace(track, before):
    """Largest error of the log integral, and of the means in their standard deviations."""
    x_m, y_m = np.array([100.0, 250.0]), np.array([60.0, -90.0])
    after = censored.added(before, track, WHITE, PRIOR, x_m, y_m)
    worth = censored.effective(track.censored, PRIOR, 0)
    errors = []
    for h in range(2):
        log_p, mean, cov = by_net(before, h, track, worth, x_m[h], y_m[h])
        off = np.abs(after.theta[:, 0, h] - mean) / np.sqrt(np.diag(cov))
        errors.append((abs(after.log_p[0, h] - before.log_p[0, h] - log_p), off.max()))
    return np.max(errors, axis=0)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("surprise_db", [0.0, 15.0])
@pytest.mark.parametrize("count", [1, 5, 40])
@pytest.mark.parametrize(
    ("sigma_db", "known", "nats", "deviations"), [(5, 1, 0.02, 0.2), (2, 0.1, 0.02, 0.1), (2, 1, 0.15, 0.4)]
)
def test_laplace_agrees_with_the_integral(sigma_db, known, nats, deviations, count, surprise_db, side):
    """Best where the levels tell P0 and eta well; in the last case the level to expect is open by 1.8 sigma."""
    track, before = levels_and_limits(side, count), some_evidence(sigma_db)
    gone = track.censored
    track = replace(track, censored=gone._replace(limit_dbm=gone.limit_dbm + side * surprise_db))
    assert np.all(worst_laplace(track, before._replace(theta_cov=known * before.theta_cov)) < (nats, deviations))


def test_what_is_known_anyway_adds_nothing():
    """A place where any level would be beyond the scale."""
    track, before = levels_and_limits(-1, 5, (40_000.0, 50_000.0)), some_evidence(1.0, (0.1, 0.0, 1e-4))
    after = censored.added(before, track, WHITE, PRIOR, np.array([0.0, 100.0]), np.array([50.0, 50.0]))
    np.testing.assert_allclose(after.log_p, before.log_p, atol=1e-4)
    np.testing.assert_allclose(after.theta, before.theta, atol=1e-4)
    np.testing.assert_allclose(after.theta_cov, before.theta_cov, rtol=1e-3)


@pytest.mark.parametrize("sigma_db", [0.05, 0.5, 5.0])
@pytest.mark.parametrize("limit_dbm", [-300.0, -110.0, 50.0])
def test_what_contradicts_the_levels_costs_but_stays_finite(sigma_db, limit_dbm):
    track = levels_and_limits(-1, 40, limit_dbm=limit_dbm)
    before = some_evidence(sigma_db)
    after = censored.added(before, track, WHITE, PRIOR, np.array([100.0, 250.0]), np.array([60.0, -90.0]))
    assert all(np.all(np.isfinite(values)) for values in after)
    assert np.all(after.log_p <= before.log_p + 1e-6)
    assert np.all(after.theta_cov[[0, 2]] > 0.0)
    assert np.all(after.theta_cov[[0, 2]] <= before.theta_cov[[0, 2]] * (1.0 + 1e-6))


# --- how much they are worth ---


def ends(x_m, readings=1.0):
    x_m = np.asarray(x_m, float)
    return Censored(
        x_m, 0 * x_m, np.full(len(x_m), FLOOR_DBM), np.full(len(x_m), -1.0), np.full(len(x_m), float(readings))
    )


def test_white_noise_leaves_every_reading_its_worth():
    np.testing.assert_allclose(censored.effective(ends(np.arange(10) * 20.0), PRIOR, 0), 1.0, rtol=0.01)
    np.testing.assert_allclose(censored.effective(ends(np.arange(10) * 20.0, 4), PRIOR, 0), 4.0, rtol=0.02)


def test_one_shadow_over_all_places_counts_once():
    near = censored.effective(ends(np.arange(10) * 0.01), PRIOR, 1)
    k = 0.7 + (0.3 + 1.0 / 12.0 / PRIOR.sigma_db**2) * np.eye(10)
    assert near.sum() == pytest.approx(np.linalg.inv(k).sum(), rel=0.01)
    assert near.sum() < 1.5
    far = censored.effective(ends(np.arange(10) * 1e4), PRIOR, 1)
    np.testing.assert_allclose(far, 1.0, rtol=0.01)


# --- what they are good for ---


def taken_as_levels(obs):
    """The floor as if it were a level: a hair's breadth off, so that it is no pile."""
    floor = obs.level_dbm == FLOOR_DBM
    return replace(obs, level_dbm=obs.level_dbm + 1e-6 * floor * np.arange(1, len(obs) + 1))


def dropped(obs):
    keep = obs.limit == 0
    names = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
    return replace(obs, **{name: getattr(obs, name)[keep] for name in names})


def errors_m(way, walks, share):
    found = [locate(way(clipped(obs, share))) for obs, _ in walks]
    return [np.hypot(f.x_m - x, f.y_m - y) for f, (_, (x, y)) in zip(found, walks, strict=True)]


def test_the_kit_clips_as_much_as_it_is_asked():
    obs, _ = simulate(np.random.default_rng(31), "square", count=150, step=5.6)
    for share in (0.2, 0.45, 0.7):
        assert np.mean(clipped(obs, share).limit == -1) == pytest.approx(share, abs=0.05)
        assert not np.any(taken_as_levels(clipped(obs, share)).limit)
        assert not np.any(dropped(clipped(obs, share)).limit)


def test_readings_at_the_floor_do_not_change_what_noise_is_believed():
    """They hold no residual to judge it by. Of noises that let them count for less none may win for that."""
    rng = np.random.default_rng(30)
    for _ in range(3):
        obs = clipped(simulate(rng, "square", count=150, step=5.6)[0], 0.45)
        used, without = locate(obs), locate(dropped(obs))
        assert used.decorrelation_m < 1.5 * without.decorrelation_m


@pytest.mark.slow
def test_readings_at_the_floor_are_better_used_than_dropped_or_believed():
    rng = np.random.default_rng(77)
    walks = [simulate(rng, "square", count=150, step=5.6) for _ in range(12)]
    ways = {"used": lambda obs: obs, "dropped": dropped, "believed": taken_as_levels}
    every = {name: [errors_m(way, walks, share) for share in (0.2, 0.45, 0.7)] for name, way in ways.items()}
    for name, errors in every.items():
        print(name, "median error with 20, 45, 70 % at the floor:", np.round(np.median(errors, axis=1)), "m")
    middle = {name: np.median(errors) for name, errors in every.items()}
    assert middle["used"] < middle["dropped"]
    assert middle["used"] < middle["believed"]
