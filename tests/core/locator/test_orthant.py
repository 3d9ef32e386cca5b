import numpy as np
import pytest
import scipy.stats

from logger.core.locator.orthant import log_all_positive, log_cdf_and_slope


def random_gaussian(rng, count, spread=3.0):
    """Some Gaussian levels: mean (count,) and covariance (count, count)."""
    root = rng.normal(size=(count, count))
    return rng.normal(0.0, spread, count), root @ root.T + 0.1 * np.eye(count)


def one_by_one(mean, covariance, limit, readings, own_variance):
    """The same as a box probability of every single reading, by scipy."""
    of = np.repeat(np.arange(len(mean)), readings)
    total = covariance[np.ix_(of, of)] + np.diag(own_variance[of])
    box = scipy.stats.multivariate_normal(-mean[of], total, maxpts=200_000)
    return float(box.logcdf(-limit[of]))


@pytest.mark.parametrize("seed", range(8))
def test_agrees_with_the_box_probability(seed):
    rng = np.random.default_rng(seed)
    mean, covariance = random_gaussian(rng, 4)
    limit, own, readings = rng.normal(0.0, 2.0, 4), rng.uniform(0.2, 3.0, 4), np.array([1, 1, 2, 3])
    found, _ = log_all_positive(mean - limit, covariance, readings.astype(float), own)
    assert found == pytest.approx(one_by_one(mean, covariance, limit, readings, own), abs=0.15)


def test_independent_readings_multiply():
    mean, own = np.array([-0.5, 1.0, -5.0]), np.array([1.0, 2.0, 4.0])
    found, _ = log_all_positive(mean, 1e-9 * np.eye(3), np.array([1.0, 4.0, 2.0]), own)
    each = scipy.stats.norm.logcdf(mean / np.sqrt(own))
    assert found == pytest.approx(float(each @ [1.0, 4.0, 2.0]), abs=1e-3)


def test_sites_of_a_similar_case_lead_to_the_same():
    rng = np.random.default_rng(9)
    mean, covariance = random_gaussian(rng, 30)
    one, own = np.ones(30), np.full(30, 2.0)
    cold, sites = log_all_positive(mean + 0.3, covariance, one, own)
    assert log_all_positive(mean, covariance, one, own, sites)[0] == pytest.approx(
        log_all_positive(mean, covariance, one, own)[0], abs=0.2
    )
    assert np.all(sites.precision >= 0.0)
    assert cold < 0.0


@pytest.mark.parametrize("limit", [-1e3, 60.0])
def test_what_is_certain_or_hopeless_stays_finite(limit):
    mean, covariance = random_gaussian(np.random.default_rng(4), 20)
    found, sites = log_all_positive(mean - limit, covariance, np.full(20, 5.0), np.full(20, 1.0))
    assert np.isfinite(found)
    assert found <= 1e-6
    assert all(np.all(np.isfinite(column)) for column in sites)


def test_log_normal_cdf_over_its_whole_range():
    u = np.linspace(-40.0, 10.0, 20_001)
    expected = scipy.stats.norm.logcdf(u)
    found, slope = log_cdf_and_slope(u)
    np.testing.assert_allclose(found, expected, atol=2e-7, rtol=0)
    low = u < 5.0  # beyond, the logarithm is smaller than the error that is allowed
    np.testing.assert_allclose(found[low], expected[low], atol=2e-7, rtol=1e-6)
    np.testing.assert_allclose(slope, np.exp(scipy.stats.norm.logpdf(u) - expected), rtol=1e-6)


def test_log_normal_cdf_stays_finite_and_rises():
    u = np.concatenate([-np.logspace(6, -6, 2000), np.logspace(-6, 6, 2000)])
    found, slope = log_cdf_and_slope(u)
    assert np.all(np.isfinite(found))
    assert np.all(found <= 0.0)
    assert np.all(np.diff(found) > -1e-7)
    assert np.all(np.isfinite(slope))
