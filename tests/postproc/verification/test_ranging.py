import numpy as np
import pytest

from postproc.verification.ranging import normality, range_errors, slope_db_per_m


def test_slope_is_the_derivative_of_the_level():
    d, eta = 300.0, 3.2
    rise = -10 * eta * (np.log10(d + 0.01) - np.log10(d - 0.01)) / 0.02
    assert slope_db_per_m(d, eta) == pytest.approx(rise, rel=1e-6)


def test_errors_of_ranging_are_what_is_simulated():
    small, _ = range_errors(400.0, 3.0, 0.3, 0.2, 100_000, np.random.default_rng(1))
    assert small.mean_m == pytest.approx(small.simulated_mean_m, abs=0.4)
    assert small.sigma_m == pytest.approx(small.simulated_sigma_m, rel=0.02)
    large, drawn = range_errors(400.0, 3.0, 5.0, 2.0, 400_000, np.random.default_rng(2))
    assert large.exact_mean_m == pytest.approx(large.simulated_mean_m, abs=2.0)
    assert large.exact_sigma_m == pytest.approx(large.simulated_sigma_m, rel=0.02)
    assert abs(large.mean_m - large.simulated_mean_m) > 20.0  # where the first Taylor term ends
    assert np.min(drawn) > -400.0


@pytest.mark.parametrize("limit", [None, 2.0, 3.0])
def test_normal_values_pass_and_their_p_is_uniform(limit):
    rng = np.random.default_rng(5)
    p = [normality(rng.normal(7.0, 3.0, 60), limit, rng).p for _ in range(30)]
    assert 0.3 < np.mean(p) < 0.7
    assert np.mean(np.array(p) < 0.05) < 0.2


def test_outliers_fail_until_they_are_cut():
    rng = np.random.default_rng(6)
    values = np.concatenate([rng.normal(size=300), rng.normal(0.0, 12.0, 20)])
    whole, cut = normality(values, None, rng), normality(values, 3.0, rng)
    assert whole.p < 0.01
    assert cut.p > 0.05
    assert cut.n_cut >= 10
    assert cut.n + cut.n_cut == 320
    assert normality(np.arange(5.0), None, rng) is None
