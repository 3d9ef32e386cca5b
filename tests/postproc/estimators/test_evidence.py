import numpy as np
import pytest
import scipy.integrate
import scipy.stats

from postproc.estimators import evidence
from postproc.estimators.evidence import Prior
from tests.kit.walks import observations, simulate


def brute_force_log_p(track, prior, x, y):
    """Log of the integral over P0, eta and sigma, mean over the noise hypotheses, by quadrature."""
    distance_db = evidence.distances_db(track, prior.height_m, np.array([x]), np.array([y]))
    weight = evidence.receiver_weights(track, prior, distance_db)[:, 0]
    distance_db = distance_db[:, 0]
    middle = np.mean(distance_db)
    best, cofactor = np.polyfit(middle - distance_db, track.level_dbm, 1, cov="unscaled")
    spread = 9.0 * np.sqrt(np.diag(cofactor)) + [0.3, 3.0]
    log_sigma = np.linspace(np.log(1.0), np.log(20.0), 81)
    etas, levels = np.linspace(-1, 1, 161), np.linspace(-1, 1, 161)
    total = 0.0
    for noise in evidence.noises(track, prior):
        k = np.linalg.inv(noise.whitener) @ np.linalg.inv(noise.whitener).T / np.outer(weight, weight)
        inverse, (_, log_det) = np.linalg.inv(k), np.linalg.slogdet(k)
        inner = []
        for s in np.exp(log_sigma):
            eta = best[0] + 2.0 * s * spread[0] * etas
            at_middle = best[1] + 2.0 * s * spread[1] * levels
            p0 = at_middle[:, None] + eta * middle
            r = track.level_dbm - at_middle[:, None, None] - eta[None, :, None] * (middle - distance_db)
            log_p = -0.5 * np.einsum("abn,nm,abm->ab", r, inverse, r, optimize=True) / s**2
            log_p -= len(r[0, 0]) * np.log(s) + 0.5 * log_det
            log_p += scipy.stats.norm.logpdf(p0, prior.p0_dbm, prior.p0_sigma_db)
            log_p += scipy.stats.norm.logpdf(eta, prior.eta, prior.eta_sigma)
            over_eta = scipy.integrate.trapezoid(np.exp(log_p + 30.0), eta, axis=1)
            inner.append(scipy.integrate.trapezoid(over_eta, at_middle))
        density = scipy.stats.norm.pdf(log_sigma, np.log(prior.sigma_db), prior.sigma_log_sd)
        total += scipy.integrate.trapezoid(np.array(inner) * density, log_sigma)
    return np.log(total)


@pytest.mark.parametrize("position_sigma", [0.0, 5.0])
def test_closed_form_agrees_with_brute_force(position_sigma):
    rng = np.random.default_rng(1)
    x, y = np.arange(14) * 20.0, np.where(np.arange(14) < 7, 0.0, 60.0)
    obs = observations(x, y, -30 - 28 * np.log10(np.hypot(x - 90, y - 40)) + 4 * rng.normal(size=14), position_sigma)
    prior = Prior(decorrelation_m=(30.0,), white_shares=(0.3,))
    track = evidence.blocks(obs)
    xs, ys = np.array([90.0, 200.0, -400.0]), np.array([40.0, -50.0, 300.0])
    ours = evidence.evidence(track, evidence.noises(track, prior), prior, xs, ys).log_p
    brute = np.array([brute_force_log_p(track, prior, *p) for p in zip(xs, ys, strict=True)])
    np.testing.assert_allclose(ours - ours[0], brute - brute[0], atol=1e-6)


def test_p0_and_eta_given_the_position():
    rng = np.random.default_rng(2)
    obs, source = simulate(rng, "square")
    flat = Prior(p0_sigma_db=1e4, eta_sigma=1e3, decorrelation_m=(), white_shares=(), height_m=0.0)
    track = evidence.blocks(obs)
    at = np.array([source[0]]), np.array([source[1]])
    ours = evidence.evidence(track, evidence.noises(track, flat), flat, *at)
    distance_db = 10 * np.log10(np.hypot(track.block_x_m - source[0], track.block_y_m - source[1]))
    root = np.sqrt(1.0 / (1.0 / track.readings + 1.0 / 12.0 / flat.sigma_db**2))
    design = np.column_stack([np.ones_like(distance_db), -distance_db])
    expected = np.linalg.lstsq(root[:, None] * design, root * track.level_dbm, rcond=None)[0]
    np.testing.assert_allclose(ours.theta[:, 0], expected, rtol=2e-3)


def test_blocks_are_bounded_and_keep_every_reading():
    rng = np.random.default_rng(3)
    x, y = np.cumsum(rng.normal(size=(2, 200_000)), axis=1)
    track = evidence.blocks(observations(x, y, rng.normal(-80, 5, 200_000)))
    assert len(track.readings) <= 300
    assert track.readings.sum() == 200_000


def test_walking_a_street_twice_adds_no_block():
    x = np.arange(100) * 3.0
    there = observations(x, 0 * x, -80 - x / 10)
    and_back = observations(np.append(x, x[::-1]), np.zeros(200), np.append(-80 - x / 10, -80 - x[::-1] / 10))
    assert len(evidence.blocks(and_back).readings) == len(evidence.blocks(there).readings)
