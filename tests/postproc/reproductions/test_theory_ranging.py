import numpy as np
import pytest

from postproc.reproductions.theory import range_errors, slope_db_per_m


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
