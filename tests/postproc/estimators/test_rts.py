from math import log, log10

import numpy as np
import pytest
from filterpy.kalman import rts_smoother

from logger.core import shadow_ekf
from logger.core.places import Places
from logger.core.shadow_ekf import ShadowNoise
from postproc.estimators import rts
from postproc.estimators.filters import retained_rows, shadow_pass
from tests.kit.walks import simulate

NOISE = ShadowNoise(5.0, 15.0, 2.0, 4.0)
STATIC = [True] * 4 + [False]


def covariance(rng):
    root = np.diag([12.0, 9.0, 3.0, 0.3]) @ (rng.normal(size=(4, 4)) + 2.0 * np.eye(4)) / 2.0
    return root @ root.T


def problem(seed, count=40, noise=NOISE, still=()):
    """A walk, the mean it is started with and its covariance; the walker does not move before the
    readings `still`.
    """
    rng = np.random.default_rng(seed)
    obs, source = simulate(rng, "square", count=count, step=8.0, shadow_db=5.0, white_db=2.0)
    for k in still:
        obs.x_m[k], obs.y_m[k] = obs.x_m[k - 1], obs.y_m[k - 1]
    p = covariance(rng)
    return obs, rng.multivariate_normal([*source, -30.0, 3.0], p), p, noise


def smooth_naively(obs, mean, p, noise, rows=None):
    conditionals = np.empty((len(obs), 6))
    state = shadow_ekf.release(
        shadow_ekf.hold(mean, noise, Places.of(float(obs.x_m[0]), float(obs.y_m[0]))), p
    )
    ahead = shadow_pass(obs, state, noise, conditionals=conditionals)
    rows = retained_rows(len(obs)) if rows is None else rows
    return ahead, rts.smooth(conditionals, shift_positions(obs), noise, mean, ahead.end, rows)


def shift_positions(obs):
    return np.hypot(np.diff(obs.x_m), np.diff(obs.y_m))


def recall(obs, noise):
    if noise.decorrelation_m == 0.0:
        return np.zeros(len(obs) - 1)
    return np.exp(-shift_positions(obs) / noise.decorrelation_m)


def linearise(obs, ahead, mean):
    """Rows h, values z and variances r of the linear problem that the EKF has solved: linearised
    where it stood.
    """
    before = np.vstack([mean, ahead.path.x[:-1, :4]])
    rows, values, variances = [], [], []
    for (x, y, p0, eta), x_m, y_m, level in zip(
        before, obs.x_m, obs.y_m, obs.level_dbm, strict=True
    ):
        d2 = (x - x_m) ** 2 + (y - y_m) ** 2 + NOISE.height_m**2
        slope = -10.0 / log(10.0) * eta / d2
        h = np.array([slope * (x - x_m), slope * (y - y_m), 1.0, -5.0 * log10(d2)])
        rows.append(h)
        values.append(level - (p0 - 5.0 * eta * log10(d2)) + h @ (x, y, p0, eta))
        variances.append(NOISE.white_db**2 + 1.0 / 12.0)
    return np.array(rows), np.array(values), np.array(variances)


def dense_batch(obs, mean, p, noise, linear):
    """Mean and covariance of [x, y, P0, eta, s_1 ... s_n], conditioned on all levels at once."""
    h, z, r = linear
    n = len(obs)
    way = np.concatenate([[0.0], np.cumsum(shift_positions(obs))])
    prior = np.zeros((4 + n, 4 + n))
    prior[:4, :4] = p
    prior[4:, 4:] = noise.shadow_db**2 * np.exp(-np.abs(way[:, None] - way) / noise.decorrelation_m)
    rows = np.hstack([h, np.eye(n)])
    start = np.append(mean, np.zeros(n))
    gain = np.linalg.solve(rows @ prior @ rows.T + np.diag(r), rows @ prior).T
    return start + gain @ (z - rows @ start), prior - gain @ rows @ prior


@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_dense_batch_solution(seed):
    obs, mean, p, noise = problem(seed, still=(7, 8, 20))
    ahead, (x, covariances) = smooth_naively(obs, mean, p, noise)
    expected, whole = dense_batch(obs, mean, p, noise, linearise(obs, ahead, mean))
    for k in range(len(obs)):
        own = [0, 1, 2, 3, 4 + k]
        np.testing.assert_allclose(x[k], expected[own], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covariances[k], whole[np.ix_(own, own)], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_filterpy(seed):
    obs, mean, p, noise = problem(seed)
    ahead, (x, covariances) = smooth_naively(obs, mean, p, noise)
    fs = [np.diag([1.0, 1.0, 1.0, 1.0, rho]) for rho in recall(obs, noise)]
    qs = [np.diag([0.0, 0.0, 0.0, 0.0, noise.shadow_db**2 * (1.0 - f[4, 4] ** 2)]) for f in fs]
    # one more of each than it uses
    x_filterpy, p_filterpy, *_ = rts_smoother(
        ahead.path.x, ahead.path.p, [*fs, fs[0]], [*qs, qs[0]]
    )
    np.testing.assert_allclose(x, x_filterpy, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(covariances, p_filterpy, rtol=1e-6, atol=1e-8)


def test_what_stands_still_is_smoothed_to_the_last_filtered_state():
    ahead, (x, p) = smooth_naively(*problem(6))
    np.testing.assert_array_equal(
        x[:, STATIC], np.broadcast_to(ahead.path.x[-1, STATIC], (len(x), 4))
    )
    np.testing.assert_allclose(p[:, :4, :4] - ahead.path.p[-1, :4, :4], 0.0, atol=1e-12)
    np.testing.assert_allclose(x[-1], ahead.path.x[-1], rtol=1e-12)
    np.testing.assert_allclose(p[-1], ahead.path.p[-1], rtol=1e-9, atol=1e-12)


def test_where_the_walker_stood_the_shadowing_is_one():
    obs, *rest = problem(7, still=(11, 12, 13))
    _, (x, p) = smooth_naively(obs, *rest)
    np.testing.assert_allclose(x[10:14, 4], x[10, 4], rtol=1e-9)
    np.testing.assert_allclose(p[10:14, 4, 4], p[10, 4, 4], rtol=1e-9)


@pytest.mark.parametrize(
    "noise", [ShadowNoise(0.0, 15.0, 3.0, 4.0), ShadowNoise(0.0, 0.0, 3.0, 4.0)]
)
def test_without_shadowing_there_is_none_to_find(noise):
    obs, mean, p, _ = problem(8)
    _, (x, covariances) = smooth_naively(obs, mean, p, noise)
    assert np.all(x[:, 4] == 0.0)
    assert np.all(covariances[:, 4] == 0.0)


def test_shadowing_is_consistent():
    """Over simulated walks the smoothed shadowing misses the true one by as much as its variance
    says.
    """
    rng = np.random.default_rng(9)
    errors = []
    for _ in range(60):
        obs, source = simulate(rng, "square", count=100, step=8.0, white_db=0.0)
        true = NOISE.shadow_db * rng.normal(size=100)
        for k, rho in enumerate(recall(obs, NOISE), start=1):
            true[k] = rho * true[k - 1] + np.sqrt(1.0 - rho**2) * true[k]
        p = covariance(rng) * 0.1
        truth = np.array([*source, -30.0, 3.0])
        d2 = (obs.x_m - source[0]) ** 2 + (obs.y_m - source[1]) ** 2 + NOISE.height_m**2
        obs.level_dbm[:] = np.round(
            -30.0 - 15.0 * np.log10(d2) + true + NOISE.white_db * rng.normal(size=100)
        )
        _, (x, covariances) = smooth_naively(obs, rng.multivariate_normal(truth, p), p, NOISE)
        errors.append(np.mean((x[:, 4] - true) ** 2 / covariances[:, 4, 4]))
    assert np.mean(errors) == pytest.approx(1.0, abs=0.15)


def test_rows_are_those_asked_for():
    obs, *rest = problem(10)
    rows = np.array([3, 4, 17, 39])
    _, (x, p) = smooth_naively(obs, *rest)
    _, (x_some, p_some) = smooth_naively(obs, *rest, rows=rows)
    np.testing.assert_array_equal(x_some, x[rows])
    np.testing.assert_array_equal(p_some, p[rows])


def test_one_reading_comes_back():
    obs, mean, p, noise = problem(11, count=40)
    conditionals = np.empty((1, 6))
    state = shadow_ekf.release(
        shadow_ekf.hold(mean, noise, Places.of(float(obs.x_m[0]), float(obs.y_m[0]))), p
    )
    ahead = shadow_pass(obs, state, noise, readings=slice(1), conditionals=conditionals)
    x, covariances = rts.smooth(conditionals, np.empty(0), noise, mean, ahead.end, np.array([0]))
    np.testing.assert_allclose(x, ahead.path.x, rtol=1e-12)
    np.testing.assert_allclose(covariances, ahead.path.p, rtol=1e-9, atol=1e-12)
