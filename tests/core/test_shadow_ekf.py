import math

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy import stats

from logger.core import ekf, shadow_ekf
from logger.core.errors import EstimationError
from logger.core.places import Places
from logger.core.shadow_ekf import ShadowNoise
from tests.kit.shadowed_walk import (
    NOISE,
    TRUTH,
    covariance,
    distance2,
    expected_level,
    released_state,
    run,
    walk,
)

# --- the step ---


def test_agrees_with_filterpy():
    rng = np.random.default_rng(1)
    readings, _ = walk(rng)
    p = covariance(rng)
    mean = rng.multivariate_normal(TRUTH, p)
    state = released_state(mean, p, NOISE, readings[0])
    oracle = ExtendedKalmanFilter(dim_x=5, dim_z=1)
    oracle.x = np.append(mean, 0.0).reshape(5, 1)
    oracle.P = np.zeros((5, 5))
    oracle.P[:4, :4], oracle.P[4, 4] = p, NOISE.shadow_db**2
    at = readings[0][:2]
    for x_m, y_m, sigma_m, level in readings:
        rho = math.exp(-math.hypot(x_m - at[0], y_m - at[1]) / NOISE.decorrelation_m)
        at = x_m, y_m
        oracle.F, oracle.Q = np.diag([1.0, 1.0, 1.0, 1.0, rho]), np.zeros((5, 5))
        oracle.Q[4, 4] = NOISE.shadow_db**2 * (1.0 - rho**2)
        oracle.predict()
        d2 = distance2(oracle.x[:, 0], x_m, y_m, sigma_m, NOISE.height_m)
        c_eta = 10.0 / math.log(10.0) * oracle.x[3, 0]
        oracle.R = np.array([[NOISE.white_db**2 + 1.0 / 12.0 + (c_eta * sigma_m) ** 2 / d2]])

        def row(x, d2=d2, x_m=x_m, y_m=y_m, c_eta=c_eta):
            return np.array(
                [
                    [
                        -c_eta * (x[0, 0] - x_m) / d2,
                        -c_eta * (x[1, 0] - y_m) / d2,
                        1.0,
                        -5.0 * math.log10(d2),
                        1.0,
                    ]
                ]
            )

        def level_of(x, x_m=x_m, y_m=y_m, sigma_m=sigma_m):
            return np.array([[expected_level(x[:, 0], x_m, y_m, sigma_m) + x[4, 0]]])

        oracle.update(np.array([[level]]), row, level_of)
        step = shadow_ekf.step(state, NOISE, x_m, y_m, sigma_m, level)
        state = step.state
        assert step.innovation_db == pytest.approx(float(oracle.y[0, 0]), rel=1e-9, abs=1e-9)
        assert step.innovation_var_db2 == pytest.approx(float(oracle.S[0, 0]), rel=1e-9)
        assert list(state[:5]) == pytest.approx(oracle.x.ravel().tolist(), rel=1e-9, abs=1e-9)
        assert shadow_ekf.covariance_matrix(state.factors) == pytest.approx(
            oracle.P, rel=1e-8, abs=1e-9
        )


def test_stays_positive_where_the_plain_update_does_not():
    noise = ShadowNoise(0.0, 0.0, 1e-9, 0.0)
    state = released_state(TRUTH, np.diag([1e12, 1e12, 1e6, 1e6]), noise, (0.0, 0.0))._replace(
        receiver_x_m=0.0
    )
    plain = ekf.EkfState(*TRUTH.tolist(), ekf.upper_triangle(np.diag([1e12, 1e12, 1e6, 1e6])))
    rng = np.random.default_rng(2)
    is_indefinite = False
    for _ in range(200):
        x_m, y_m = (TRUTH[:2] + rng.choice([-1, 1], 2) * rng.uniform(50, 1000, 2)).tolist()
        level = expected_level(plain, x_m, y_m, noise=noise)
        plain = ekf.step(plain, x_m, y_m, level, q=0.0, r_db2=1e-18).state
        is_indefinite |= np.linalg.eigvalsh(ekf.covariance_matrix(plain.p)).min() < 0.0
        state = shadow_ekf.step(
            state, noise, x_m, y_m, 0.0, expected_level(state, x_m, y_m, noise=noise)
        ).state
        assert all(d > 0.0 for d in state.factors[1:5])
        assert state.factors[0] == 0.0
    assert is_indefinite


def test_standing_still_keeps_the_shadowing_and_a_long_way_forgets_it():
    rng = np.random.default_rng(3)
    readings, _ = walk(rng)
    state = run(released_state(TRUTH, covariance(rng), NOISE, readings[0]), NOISE, readings[:50])
    x_m, y_m = readings[49][:2]
    still = shadow_ekf.step(state, NOISE._replace(white_db=1e6), x_m, y_m, 0.0, -80.0).state
    assert still.shadow_db == pytest.approx(state.shadow_db, abs=1e-6)
    assert still.factors == pytest.approx(state.factors, rel=1e-6)
    far = shadow_ekf.step(state, NOISE._replace(white_db=1e6), x_m + 1e4, y_m, 0.0, -80.0).state
    assert far.shadow_db == pytest.approx(0.0, abs=1e-6)
    assert shadow_ekf.covariance_matrix(far.factors)[4] == pytest.approx(
        [0, 0, 0, 0, 36.0], abs=1e-6
    )


def test_without_a_level_it_only_moves():
    rng = np.random.default_rng(10)
    readings, _ = walk(rng)
    state = run(released_state(TRUTH, covariance(rng), NOISE, readings[0]), NOISE, readings[:50])
    x_m, y_m = readings[49][0] + 10.0, readings[49][1]
    walked = shadow_ekf.step(state, NOISE, x_m, y_m, 3.0, math.nan)
    rho = math.exp(-10.0 / NOISE.decorrelation_m)
    assert walked.state[:7] == pytest.approx((*state[:4], rho * state.shadow_db, x_m, y_m))
    before, after = (shadow_ekf.covariance_matrix(s.factors) for s in (state, walked.state))
    f = np.diag([1.0, 1.0, 1.0, 1.0, rho])
    noise = np.diag([0.0, 0.0, 0.0, 0.0, NOISE.shadow_db**2 * (1.0 - rho**2)])
    np.testing.assert_allclose(after, f @ before @ f + noise, rtol=1e-9)
    assert math.isnan(walked.innovation_db)


def test_consistent_with_its_own_world():
    """Over 100 walks the final NEES is chi-square with 4 degrees of freedom."""
    rng = np.random.default_rng(4)
    nees, nis = [], []
    for _ in range(100):
        readings, _ = walk(rng, 150)
        p = covariance(rng) * 0.3
        state = released_state(rng.multivariate_normal(TRUTH, p), p, NOISE, readings[0])
        for reading in readings:
            state, e, s = shadow_ekf.step(state, NOISE, *reading)
            nis.append(e * e / s)
        error = np.array(state[:4]) - TRUTH
        nees.append(
            error @ np.linalg.solve(shadow_ekf.covariance_matrix(state.factors)[:4, :4], error)
        )
    low, high = stats.chi2.ppf([0.001, 0.999], 400) / 100
    assert low < np.mean(nees) < high
    assert np.mean(nis) == pytest.approx(1.0, abs=0.1)


# --- the start ---


def dense_shadowing(mean, readings, noise):
    """Mean and variance of the last shadowing, given the rest and the levels, by conditioning one
    large Gaussian.
    """
    x, y, sigma, level = np.array(readings).T
    lag = np.hypot(np.diff(x), np.diff(y))
    at = np.concatenate([[0.0], np.cumsum(lag)])
    prior = noise.shadow_db**2 * np.exp(-np.abs(at[:, None] - at) / noise.decorrelation_m)
    d2 = distance2(mean, x, y, sigma, noise.height_m)
    own = noise.white_db**2 + 1.0 / 12.0 + (10.0 / math.log(10.0) * mean[3] * sigma) ** 2 / d2
    off = level - (mean[2] - 5.0 * mean[3] * np.log10(d2))
    gain = np.linalg.solve(prior + np.diag(own), prior[:, -1])
    return gain @ off, prior[-1, -1] - gain @ prior[:, -1]


def test_holding_estimates_the_shadowing_given_the_rest():
    rng = np.random.default_rng(5)
    readings, _ = walk(rng, 40)
    state = run(shadow_ekf.hold(TRUTH, NOISE, Places.of(*readings[0][:2])), NOISE, readings)
    shadow_db, variance = dense_shadowing(TRUTH, readings, NOISE)
    assert state[:4] == pytest.approx(tuple(TRUTH), abs=1e-12)
    assert state.shadow_db == pytest.approx(shadow_db, rel=1e-9)
    assert state.factors[0] == pytest.approx(variance, rel=1e-9)


def test_releasing_gives_the_covariance_and_the_dependence_of_the_shadowing():
    rng = np.random.default_rng(6)
    readings, _ = walk(rng, 40, sigma_m=0.0)
    held = run(shadow_ekf.hold(TRUTH, NOISE, Places.of(*readings[0][:2])), NOISE, readings)
    p = covariance(rng)
    full = shadow_ekf.covariance_matrix(shadow_ekf.release(held, p).factors)
    steps = np.array([1e-3, 1e-3, 1e-4, 1e-5])
    slope = [
        (
            dense_shadowing(TRUTH + h, readings, NOISE)[0]
            - dense_shadowing(TRUTH - h, readings, NOISE)[0]
        )
        / (2 * h.sum())
        for h in np.diag(steps)
    ]
    np.testing.assert_allclose(full[:4, :4], p, rtol=1e-10)
    np.testing.assert_allclose(full[4, :4], p @ slope, rtol=1e-4)
    np.testing.assert_allclose(full[4, 4], held.factors[0] + slope @ p @ slope, rtol=1e-4)


def test_an_indefinite_covariance_is_refused():
    state = shadow_ekf.hold(TRUTH, NOISE, Places.of(0.0, 0.0))
    with pytest.raises(EstimationError, match="positive definite"):
        shadow_ekf.release(state, np.diag([1.0, 1.0, -1.0, 1.0]))


def test_static_covariance_is_a_block_of_the_whole():
    rng = np.random.default_rng(7)
    readings, _ = walk(rng, 60)
    state = run(released_state(TRUTH, covariance(rng), NOISE, readings[0]), NOISE, readings)
    block = ekf.covariance_matrix(shadow_ekf.static_covariance(state.factors))
    np.testing.assert_allclose(
        block, shadow_ekf.covariance_matrix(state.factors)[:4, :4], rtol=1e-12
    )


def test_noise_is_split_by_the_white_share():
    assert shadow_ekf.split_noise(5.0, 20.0, 0.36, 4.0) == pytest.approx((4.0, 20.0, 3.0, 4.0))
    assert shadow_ekf.split_noise(5.0, 0.0, 0.36, 4.0) == pytest.approx((0.0, 0.0, 5.0, 4.0))
