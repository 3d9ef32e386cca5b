import numpy as np
import scipy.stats

from logger.core.locator import normal_tail


def test_log_normal_cdf_over_its_whole_range():
    u = np.linspace(-40.0, 10.0, 20_001)
    expected = scipy.stats.norm.logcdf(u)
    found, slope = normal_tail.log_cdf_and_slope(u)
    np.testing.assert_allclose(found, expected, atol=2e-7, rtol=0)
    low = u < 5.0  # beyond, the logarithm is smaller than the error that is allowed
    np.testing.assert_allclose(found[low], expected[low], atol=2e-7, rtol=1e-6)
    np.testing.assert_allclose(slope, np.exp(scipy.stats.norm.logpdf(u) - expected), rtol=1e-6)


def test_log_normal_cdf_stays_finite_and_rises():
    u = np.concatenate([-np.logspace(6, -6, 2000), np.logspace(-6, 6, 2000)])
    found, slope = normal_tail.log_cdf_and_slope(u)
    assert np.all(np.isfinite(found))
    assert np.all(found <= 0.0)
    assert np.all(np.diff(found) > -1e-7)
    assert np.all(np.isfinite(slope))
