from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
import scipy.stats

from logger.core.locator import tobit
from logger.core.locator.pipeline import locate
from logger.core.locator.quadtree import Effort
from logger.core.model.blocks import Censored, blocks
from logger.core.model.marginal import marginal, walk_sums
from logger.core.model.noise import covariances, matrices_of, whiteners
from logger.core.model.prior import Hypothesis, Prior, Station
from logger.core.places import Places
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import FLOOR_DBM, censor_at_floor, observations, simulate

PRIOR = Prior(noise=noise_groups(Hypothesis(0.3, 30.0)), stations=(Station(1.0, 5.0),))


# --- what the levels tell of them ---


def ends(x_m, side=-1.0, limit_dbm=FLOOR_DBM, readings=1.0, y_m=40.0):
    columns = np.broadcast_arrays(np.asarray(x_m, float), y_m, limit_dbm, side, readings)
    x, y, *others = (np.array(column, float) for column in columns)
    return Censored(Places.of(x, y), *others)


def track_of(gone, count=12, apart_m=25.0, noise_db=0.0):
    """Blocks of a straight walk, with censored places."""
    x = np.arange(count) * apart_m
    level = -70.0 - np.arange(count) + noise_db * np.random.default_rng(5).normal(size=count)
    return replace(blocks(observations(x, 0 * x, level), 300), censored=gone)


def evidence_of(track, number, prior=PRIOR):
    (noise,) = whiteners(track, prior, [number])
    return tobit.conditional_levels(track, noise, prior.hypotheses[number])


def test_white_noise_leaves_every_reading_its_worth_and_nothing_known():
    found = evidence_of(track_of(ends(np.arange(10) * 20.0, readings=4.0)), 0)
    np.testing.assert_allclose(found.effective_readings, 4.0, rtol=1e-9)
    np.testing.assert_allclose(found.sd, 1.0)
    assert not found.predicted_dbm.any()


def test_one_shadow_over_all_places_counts_once():
    away = evidence_of(track_of(ends(1e6 + np.arange(10) * 0.01)), 1)
    k = 0.7 + 0.3 * np.eye(10)
    assert away.effective_readings.sum() == pytest.approx(np.linalg.inv(k).sum(), rel=0.01)
    assert away.effective_readings.sum() < 1.5
    np.testing.assert_allclose(
        evidence_of(track_of(ends(np.arange(1, 11) * 1e4)), 1).effective_readings, 1.0, rtol=0.01
    )


@pytest.mark.parametrize("number", [0, 1])
def test_what_the_levels_tell_is_the_conditional_gaussian(number):
    """Against the joint covariance of blocks and places, cut by the rules of the multivariate
    normal distribution.
    """
    track = track_of(ends(np.linspace(10.0, 280.0, 7), readings=3.0), noise_db=5.0)
    gone, hypothesis = track.censored, PRIOR.hypotheses[number]
    x, y = (
        np.append(track.places.x_m, gone.places.x_m),
        np.append(track.places.y_m, gone.places.y_m),
    )
    complete = (1.0 - hypothesis.white_share) * np.exp(
        -np.hypot(x[:, None] - x, y[:, None] - y) / 30.0 if number else -1e9
    )
    k, cross = covariances(track, PRIOR)[number], (complete * np.ones((19, 19)))[12:, :12]
    gain = cross @ np.linalg.inv(k)
    variance = hypothesis.white_share + (0.7 if number else 0.0) - np.sum(gain * cross, axis=1)
    found = evidence_of(track, number)
    np.testing.assert_allclose(found.gain, gain, atol=1e-9)
    np.testing.assert_allclose(found.predicted_dbm, gain @ track.level_dbm, atol=1e-7)
    np.testing.assert_allclose(found.sd, np.sqrt(variance), atol=1e-9)


def test_large_blocks_tell_no_more_than_there_is_to_know():
    """Their means and the places between them are one field: what is left to know of it is a
    covariance.
    """
    rng, prior = (
        np.random.default_rng(2),
        Prior(noise=noise_groups(Hypothesis(0.0, 15.0), Hypothesis(0.0, 700.0))),
    )
    x, y = np.tile(np.linspace(0.0, 200.0, 400), 3), rng.normal(0.0, 1.0, 1200)
    gone = ends(np.arange(200.0), y_m=0.0)
    track = replace(blocks(observations(x, y, rng.normal(-80.0, 5.0, 1200)), 12), censored=gone)
    assert len(track) <= 12
    for noise in whiteners(track, prior)[1:]:
        hypothesis = prior.hypotheses[noise.number]
        known = noise.matrix @ tobit.shadowing_in_blocks(track, hypothesis).T
        left = (
            tobit.shadowing_between(track.censored, hypothesis, track.censored.places)
            - known.T @ known
        )
        assert np.min(np.linalg.eigvalsh(left)) > -1e-9


# --- the integral over P0, eta and sigma ---

PLACES = np.array([100.0, 250.0]), np.array([60.0, -90.0])


def joint_evidence_of(track, number, prior=PRIOR):
    found = whiteners(track, prior, [number])
    total = walk_sums(track, matrices_of(found), prior, Places.of(*PLACES))
    log_det = np.array([[found[0].log_det]])
    both = tobit.tobit_evidence(
        total, log_det, track, [evidence_of(track, number, prior)], prior, Places.of(*PLACES)
    )
    return both, marginal(total, len(track), log_det, prior)


def by_net(track, number, h):
    """Integral over P0, eta and log sigma, with the mean and covariance of the first two."""
    one, gone, n = evidence_of(track, number), track.censored, len(track)
    x_m, y_m = PLACES[0][h], PLACES[1][h]
    of_levels = 5.0 * np.log10(
        (track.places.x_m - x_m) ** 2 + (track.places.y_m - y_m) ** 2 + PRIOR.height_m**2
    )
    of_gone = (
        5.0
        * np.log10((gone.places.x_m - x_m) ** 2 + (gone.places.y_m - y_m) ** 2 + PRIOR.height_m**2)
        - one.gain @ of_levels
    )
    k = covariances(track, PRIOR)[number]
    inverse, log_det = np.linalg.inv(k), np.linalg.slogdet(k)[1]
    normal = scipy.stats.norm

    def log_p(t):
        p0, eta, tau = t[..., 0], t[..., 1], t[..., 2]
        off = track.level_dbm - p0[..., None] + eta[..., None] * of_levels
        squares = np.einsum("...i,ij,...j->...", off, inverse, off)
        levels = -0.5 * (n * np.log(2.0 * np.pi) + log_det + squares * np.exp(-2.0 * tau)) - n * tau
        mean = (
            p0[..., None] * (1.0 - one.gain.sum(axis=1))
            - eta[..., None] * of_gone
            + one.predicted_dbm
        )
        beyond = gone.side * (mean - gone.limit_dbm) + 0.5  # half a step
        ends = normal.logcdf(beyond / one.sd * np.exp(-tau)[..., None]) @ one.effective_readings
        priors = normal.logpdf(p0, PRIOR.p0_dbm, PRIOR.p0_sigma_db) + normal.logpdf(
            eta, PRIOR.eta, PRIOR.eta_sigma
        )
        return (
            levels + ends + priors + normal.logpdf(tau, np.log(PRIOR.sigma_db), PRIOR.sigma_log_sd)
        )

    start = np.array([-40.0, 2.0, np.log(5.0)])
    mean = scipy.optimize.minimize(
        lambda t: -log_p(t), start, method="Nelder-Mead", options={"maxiter": 2000}
    ).x
    cov, v = np.diag([9.0, 0.04, 0.04]), np.linspace(-5.0, 5.0, 25)
    for _ in range(5):  # the net is laid anew, turned and scaled, by the mass found before
        root = np.linalg.cholesky(cov)
        t = mean + np.stack(np.meshgrid(v, v, v, indexing="ij"), -1).reshape(-1, 3) @ root.T
        at = log_p(t)
        share = np.exp(at - at.max())
        total, share = (
            share.sum() * (v[1] - v[0]) ** 3 * np.prod(np.diag(root)),
            share / share.sum(),
        )
        mean = share @ t
        cov = (share[:, None] * (t - mean)).T @ (t - mean)
    return np.log(total) + at.max(), mean[:2], cov[:2, :2]


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("count", "surprise_db"), [(1, 0.0), (8, 0.0), (8, 12.0), (20, 6.0)])
def test_laplace_agrees_with_the_integral(count, surprise_db, side, number):
    limit_dbm = -82.0 + side * surprise_db if side < 0 else -76.0 + side * surprise_db
    track = track_of(
        ends(np.linspace(60.0, 300.0, count), side, limit_dbm, np.arange(count) % 3 + 1.0),
        noise_db=4.0,
    )
    both, _ = joint_evidence_of(track, number)
    for h in range(2):
        log_p, mean, cov = by_net(track, number, h)
        assert both.log_p[0, h] == pytest.approx(log_p, abs=0.15)
        off = np.abs(both.theta[:, 0, h] - mean) / np.sqrt(np.diag(cov))
        assert np.max(off) < 0.35
        assert both.theta_cov[[0, 2], 0, h] == pytest.approx(np.diag(cov), rel=0.4)


def test_without_an_end_near_by_it_is_what_the_levels_say():
    """Places where any level would be beyond the scale; sigma is integrated by Laplace here, by a
    quadrature there.
    """
    track = track_of(ends([40_000.0, 50_000.0], limit_dbm=-60.0), noise_db=4.0)
    both, levels = joint_evidence_of(track, 0)
    np.testing.assert_allclose(both.log_p, levels.log_p, atol=0.12)
    off = np.abs(both.theta - levels.theta)[:, 0] / np.sqrt(levels.theta_cov[[0, 2], 0])
    assert np.max(off) < 0.25


@pytest.mark.parametrize("sigma_db", [0.05, 0.5, 5.0])
@pytest.mark.parametrize("limit_dbm", [-300.0, -110.0, 50.0])
def test_what_contradicts_the_levels_costs_but_stays_finite(sigma_db, limit_dbm):
    track = track_of(ends(np.linspace(60.0, 300.0, 40), limit_dbm=limit_dbm))
    for number in (0, 1):
        both, levels = joint_evidence_of(track, number, replace(PRIOR, sigma_db=sigma_db))
        assert all(np.all(np.isfinite(values)) for values in both)
        assert np.all(both.log_p <= levels.log_p + 0.1)
        assert np.all(both.theta_cov[[0, 2]] > 0.0)


def test_levels_near_the_floor_do_not_pass_for_all_there_are():
    """Of white noise about a level at the floor half is left: alone that is too high, and too
    little noise.
    """
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0.0, 40.0, (2, 400))
    levels_dbm = np.round(rng.normal(FLOOR_DBM, 4.0, 400))
    track = blocks(observations(x + 300.0, y, np.maximum(levels_dbm, FLOOR_DBM)), 300)
    both, levels = joint_evidence_of(track, 0)
    assert np.all(levels.sigma_db < 3.2)
    np.testing.assert_allclose(both.sigma_db, 4.0, rtol=0.15)


# --- what they are good for ---


def taken_as_levels(obs):
    """The floor as if it were a level: a hair's breadth off, so that it is no pile."""
    floor = obs.level_dbm == FLOOR_DBM
    return replace(obs, level_dbm=obs.level_dbm + 1e-6 * floor * np.arange(1, len(obs) + 1))


def without_floor(obs):
    return replace(obs.part(obs.limit == 0), known_limit=None)


def errors_m(way, walks, share):
    found = [locate(way(censor_at_floor(obs, share))) for obs, _ in walks]
    return [np.hypot(f.x_m - x, f.y_m - y) for f, (_, (x, y)) in zip(found, walks, strict=True)]


def test_the_kit_clips_as_much_as_it_is_asked():
    obs, _ = simulate(np.random.default_rng(31), "square", count=150, step=5.6)
    for share in (0.2, 0.45, 0.7):
        assert np.mean(censor_at_floor(obs, share).limit == -1) == pytest.approx(share, abs=0.05)
        assert not np.any(taken_as_levels(censor_at_floor(obs, share)).limit)
        assert not np.any(without_floor(censor_at_floor(obs, share)).limit)


def test_with_readings_at_the_floor_noise_is_believed_as_without_a_floor():
    """Levels alone are the high ones near the floor, which looks like less and like correlated
    noise.
    """
    rng, quick = np.random.default_rng(30), Effort(most_squares=1000, samples=4)
    walks = [simulate(rng, "square", count=120, step=7.0)[0] for _ in range(2)]
    ways = (
        lambda obs: obs,
        lambda obs: censor_at_floor(obs, 0.45),
        lambda obs: without_floor(censor_at_floor(obs, 0.45)),
    )
    complete, used, alone = (
        np.array([locate(way(obs), effort=quick).white_share for obs in walks]) for way in ways
    )
    assert np.mean(np.abs(used - complete)) < 0.15
    assert np.mean(np.abs(used - complete)) < np.mean(np.abs(alone - complete))


@pytest.mark.slow
def test_readings_at_the_floor_are_better_used_than_dropped_or_believed():
    rng = np.random.default_rng(77)
    walks = [simulate(rng, "square", count=150, step=5.6) for _ in range(12)]
    ways = {"used": lambda obs: obs, "dropped": without_floor, "believed": taken_as_levels}
    every = {
        name: [errors_m(way, walks, share) for share in (0.2, 0.45, 0.7)]
        for name, way in ways.items()
    }
    for name, errors in every.items():
        print(
            name,
            "median error with 20, 45, 70 % at the floor:",
            np.round(np.median(errors, axis=1)),
            "m",
        )
    middle = {name: np.median(errors) for name, errors in every.items()}
    assert middle["used"] < middle["dropped"]
    assert middle["used"] < middle["believed"]
