"""The shadowing EKF with readings at the modem's limit."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from logger.core import shadow_ekf
from logger.core.places import Places
from logger.core.shadow_ekf import ShadowNoise
from tests.kit.shadowed_walk import (
    NOISE,
    TRUTH,
    covariance,
    expected_level,
    released_state,
    walk,
)


@pytest.mark.parametrize("limit", [-1, 1])
@pytest.mark.parametrize("beyond_db", [-25.0, -6.0, 0.0, 4.0, 20.0])
def test_a_limit_leaves_the_moments_of_numerical_integration(limit, beyond_db):
    """With the rest certain, the shadowing s below a limit has the density N(s; 0, v) Phi((limit -
    s) / sqrt(r)).
    """
    v, r = NOISE.shadow_db**2, NOISE.white_db**2 + 1.0 / 12.0
    level = (
        expected_level(TRUTH, 0.0, 0.0) - limit * beyond_db
    )  # beyond_db > 0: the limit lies where levels are likely
    state = shadow_ekf.hold(TRUTH, NOISE, Places.of(0.0, 0.0))
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
    state = released_state(TRUTH, covariance(rng), NOISE, (0.0, 0.0))
    for level, limit in ((1e4, -1), (-1e4, -1), (1e4, 1), (-1e4, 1)):
        after = shadow_ekf.step(state, NOISE, 0.0, 0.0, 0.0, level, limit).state
        assert np.all(np.isfinite(after[:5]))
        assert all(d > 0.0 for d in after.factors[:5])


def test_censored_levels_do_not_flatten_the_exponent():
    """Half the walk at the floor: taken as levels they bias the exponent, as limits they do not."""
    rng = np.random.default_rng(9)
    noise = ShadowNoise(3.0, 15.0, 2.0, 8.0)
    error = {False: [], True: []}
    for _ in range(30):
        readings, _ = walk(rng, 200, noise)
        floor = float(np.median([reading[3] for reading in readings]))
        p = np.diag([20.0, 20.0, 6.0, 0.4]) ** 2
        mean = rng.multivariate_normal(TRUTH, p)
        for as_limit, values in error.items():
            state = released_state(mean, p, noise, readings[0])
            for x_m, y_m, sigma_m, level in readings:
                limit = -1 if as_limit and level <= floor else 0
                state = shadow_ekf.step(
                    state, noise, x_m, y_m, sigma_m, max(level, floor), limit
                ).state
            off = np.array(state[:4]) - TRUTH
            values.append(
                off @ np.linalg.solve(shadow_ekf.covariance_matrix(state.factors)[:4, :4], off)
            )
    assert np.mean(error[True]) < stats.chi2.ppf(0.9999, 120) / 30
    assert np.mean(error[False]) > 2.0 * np.mean(error[True])
