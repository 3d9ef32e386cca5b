import math

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy import integrate, stats

from logger.core import ekf, shadow_ekf
from logger.core.errors import EstimationError
from logger.core.shadow_ekf import ShadowNoise

NOISE = ShadowNoise(shadow_db=6.0, decorrelation_m=15.0, white_db=2.0, height_m=8.0)
TRUTH = np.array([150.0, -80.0, -30.0, 3.1])
SPREAD = np.diag([15.0, 12.0, 4.0, 0.3])


def covariance(rng):
    root = rng.normal(size=(4, 4)) + 2.0 * np.eye(4)
    return SPREAD @ root @ root.T @ SPREAD / 6.0


def distance2(place, x_m, y_m, sigma_m, height_m):
    return (place[0] - x_m) ** 2 + (place[1] - y_m) ** 2 + height_m**2 + 2.0 * sigma_m**2


def expected_level(x, x_m, y_m, sigma_m=0.0, noise=NOISE):
    return x[2] - 5.0 * x[3] * math.log10(distance2(x, x_m, y_m, sigma_m, noise.height_m))


def walk(rng, count=600, noise=NOISE, truth=TRUTH, sigma_m=3.0):
    """Readings (x, y, sigma, level) of a walk round three sides of the truth, and the shadowing at
    each.
    """
    s = np.linspace(0.0, 3.0, count)
    x = truth[0] + 120.0 * np.interp(s, [0, 1, 2, 3], [-1, 1, 1, -1])
    y = truth[1] + 120.0 * np.interp(s, [0, 1, 2, 3], [-1, -1, 1, 1])
    shadow = noise.shadow_db * rng.normal(size=count)
    for k in range(1, count):
        rho = math.exp(-math.hypot(x[k] - x[k - 1], y[k] - y[k - 1]) / noise.decorrelation_m)
        shadow[k] = rho * shadow[k - 1] + math.sqrt(1.0 - rho * rho) * shadow[k]
    level = [expected_level(truth, *place, sigma_m, noise) for place in zip(x, y, strict=True)]
    level = np.round(np.array(level) + shadow + noise.white_db * rng.normal(size=count))
    return list(zip(x.tolist(), y.tolist(), [sigma_m] * count, level.tolist(), strict=True)), shadow


def started(mean, p, noise, reading):
    return shadow_ekf.release(shadow_ekf.hold(mean, noise, reading[0], reading[1]), p)


def run(state, noise, readings):
    for reading in readings:
        state = shadow_ekf.step(state, noise, *reading).state
    return state


# --- the step ---


def test_agrees_with_filterpy():
    rng = np.random.default_rng(1)
    readings, _ = walk(rng)
    p = covariance(rng)
    mean = rng.multivariate_normal(TRUTH, p)
    state = started(mean, p, NOISE, readings[0])
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
    state = started(TRUTH, np.diag([1e12, 1e12, 1e6, 1e6]), noise, (0.0, 0.0))._replace(
        receiver_x_m=0.0
    )
    plain = ekf.EkfState(*TRUTH.tolist(), ekf.upper_triangle(np.diag([1e12, 1e12, 1e6, 1e6])))
    rng = np.random.default_rng(2)
    lost = False
    for _ in range(200):
        x_m, y_m = (TRUTH[:2] + rng.choice([-1, 1], 2) * rng.uniform(50, 1000, 2)).tolist()
        level = expected_level(plain, x_m, y_m, noise=noise)
        plain = ekf.step(plain, x_m, y_m, level, q=0.0, r_db2=1e-18).state
        lost |= np.linalg.eigvalsh(ekf.covariance_matrix(plain.p)).min() < 0.0
        state = shadow_ekf.step(
            state, noise, x_m, y_m, 0.0, expected_level(state, x_m, y_m, noise=noise)
        ).state
        assert all(d > 0.0 for d in state.factors[1:5])
        assert state.factors[0] == 0.0
    assert lost


def test_standing_still_keeps_the_shadowing_and_a_long_way_forgets_it():
    rng = np.random.default_rng(3)
    readings, _ = walk(rng)
    state = run(started(TRUTH, covariance(rng), NOISE, readings[0]), NOISE, readings[:50])
    x_m, y_m = readings[49][:2]
    still = shadow_ekf.step(state, NOISE._replace(white_db=1e6), x_m, y_m, 0.0, -80.0).state
    assert still.shadow_db == pytest.approx(state.shadow_db, abs=1e-6)
    assert still.factors == pytest.approx(state.factors, rel=1e-6)
    far = shadow_ekf.step(state, NOISE._replace(white_db=1e6), x_m + 1e4, y_m, 0.0, -80.0).state
    assert far.shadow_db == pytest.approx(0.0, abs=1e-6)
    assert shadow_ekf.covariance_matrix(far.factors)[4] == pytest.approx(
        [0, 0, 0, 0, 36.0], abs=1e-6
    )


def test_without_a_level_it_only_walks():
    rng = np.random.default_rng(10)
    readings, _ = walk(rng)
    state = run(started(TRUTH, covariance(rng), NOISE, readings[0]), NOISE, readings[:50])
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
        state = started(rng.multivariate_normal(TRUTH, p), p, NOISE, readings[0])
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
    state = run(shadow_ekf.hold(TRUTH, NOISE, *readings[0][:2]), NOISE, readings)
    shadow_db, variance = dense_shadowing(TRUTH, readings, NOISE)
    assert state[:4] == pytest.approx(tuple(TRUTH), abs=1e-12)
    assert state.shadow_db == pytest.approx(shadow_db, rel=1e-9)
    assert state.factors[0] == pytest.approx(variance, rel=1e-9)


def test_releasing_gives_the_covariance_and_how_the_shadowing_leans_on_the_rest():
    rng = np.random.default_rng(6)
    readings, _ = walk(rng, 40, sigma_m=0.0)
    held = run(shadow_ekf.hold(TRUTH, NOISE, *readings[0][:2]), NOISE, readings)
    p = covariance(rng)
    whole = shadow_ekf.covariance_matrix(shadow_ekf.release(held, p).factors)
    steps = np.array([1e-3, 1e-3, 1e-4, 1e-5])
    slope = [
        (
            dense_shadowing(TRUTH + h, readings, NOISE)[0]
            - dense_shadowing(TRUTH - h, readings, NOISE)[0]
        )
        / (2 * h.sum())
        for h in np.diag(steps)
    ]
    np.testing.assert_allclose(whole[:4, :4], p, rtol=1e-10)
    np.testing.assert_allclose(whole[4, :4], p @ slope, rtol=1e-4)
    np.testing.assert_allclose(whole[4, 4], held.factors[0] + slope @ p @ slope, rtol=1e-4)


def test_a_covariance_that_is_none_is_refused():
    state = shadow_ekf.hold(TRUTH, NOISE, 0.0, 0.0)
    with pytest.raises(EstimationError, match="positive definite"):
        shadow_ekf.release(state, np.diag([1.0, 1.0, -1.0, 1.0]))


def test_static_covariance_is_a_block_of_the_whole():
    rng = np.random.default_rng(7)
    readings, _ = walk(rng, 60)
    state = run(started(TRUTH, covariance(rng), NOISE, readings[0]), NOISE, readings)
    block = ekf.covariance_matrix(shadow_ekf.static_covariance(state.factors))
    np.testing.assert_allclose(
        block, shadow_ekf.covariance_matrix(state.factors)[:4, :4], rtol=1e-12
    )


def test_noise_is_split_by_the_white_share():
    assert shadow_ekf.split_noise(5.0, 20.0, 0.36, 4.0) == pytest.approx((4.0, 20.0, 3.0, 4.0))
    assert shadow_ekf.split_noise(5.0, 0.0, 0.36, 4.0) == pytest.approx((0.0, 0.0, 5.0, 4.0))


# --- readings at the modem's limit ---


@pytest.mark.parametrize("limit", [-1, 1])
@pytest.mark.parametrize("beyond_db", [-25.0, -6.0, 0.0, 4.0, 20.0])
def test_a_limit_leaves_the_moments_that_integration_finds(limit, beyond_db):
    """With the rest certain, the shadowing s below a limit has the density N(s; 0, v) Phi((limit -
    s) / sqrt(r)).
    """
    v, r = NOISE.shadow_db**2, NOISE.white_db**2 + 1.0 / 12.0
    level = (
        expected_level(TRUTH, 0.0, 0.0) - limit * beyond_db
    )  # beyond_db > 0: the limit lies where levels are likely
    state = shadow_ekf.hold(TRUTH, NOISE, 0.0, 0.0)
    step = shadow_ekf.step(state, NOISE, 0.0, 0.0, 0.0, level, limit)
    offset = level - expected_level(TRUTH, 0.0, 0.0)

    def moment(power):
        def density(s):
            weight = stats.norm.cdf(-limit * (offset - s) / math.sqrt(r))
            return s**power * math.exp(-0.5 * s * s / v) * weight

        return integrate.quad(density, -60.0, 60.0, epsabs=0.0, epsrel=1e-11, limit=200)[0]

    mean = moment(1) / moment(0)
    variance = moment(2) / moment(0) - mean**2
    assert step.state.shadow_db == pytest.approx(mean, rel=1e-6, abs=1e-9)
    assert step.state.factors[0] == pytest.approx(variance, rel=1e-6)
    assert math.isnan(step.innovation_db)
    assert math.isnan(step.innovation_var_db2)


def test_absurd_limits_are_survived():
    rng = np.random.default_rng(8)
    state = started(TRUTH, covariance(rng), NOISE, (0.0, 0.0))
    for level, limit in ((1e4, -1), (-1e4, -1), (1e4, 1), (-1e4, 1)):
        after = shadow_ekf.step(state, NOISE, 0.0, 0.0, 0.0, level, limit).state
        assert np.all(np.isfinite(after[:5]))
        assert all(d > 0.0 for d in after.factors[:5])


def test_levels_cut_off_at_the_floor_do_not_flatten_the_exponent():
    """Half the walk at the floor: taken as levels they bias the exponent, as limits they do not."""
    rng = np.random.default_rng(9)
    noise = ShadowNoise(3.0, 15.0, 2.0, 8.0)
    error = {False: [], True: []}
    for _ in range(30):
        readings, _ = walk(rng, 200, noise)
        floor = float(np.median([reading[3] for reading in readings]))
        p = np.diag([20.0, 20.0, 6.0, 0.4]) ** 2
        mean = rng.multivariate_normal(TRUTH, p)
        for known, found in error.items():
            state = started(mean, p, noise, readings[0])
            for x_m, y_m, sigma_m, level in readings:
                limit = -1 if known and level <= floor else 0
                state = shadow_ekf.step(
                    state, noise, x_m, y_m, sigma_m, max(level, floor), limit
                ).state
            off = np.array(state[:4]) - TRUTH
            found.append(
                off @ np.linalg.solve(shadow_ekf.covariance_matrix(state.factors)[:4, :4], off)
            )
    assert np.mean(error[True]) < stats.chi2.ppf(0.9999, 120) / 30
    assert np.mean(error[False]) > 2.0 * np.mean(error[True])
