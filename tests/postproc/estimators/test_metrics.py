import numpy as np
import pytest
import scipy.stats
from filterpy.stats import NEES

from postproc.estimators import metrics


def ar1(rng, rho, count):
    series = np.zeros(count)
    for k in range(1, count):
        series[k] = rho * series[k - 1] + rng.normal()
    return series


def test_nees_of_consistent_errors_is_chi_square():
    rng = np.random.default_rng(3)
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]])
    errors = rng.multivariate_normal(np.zeros(2), covariance, size=4000)
    low, high = metrics.mean_bounds(4000, dof=2, level=0.999)
    assert low < np.mean(metrics.nees(errors, np.broadcast_to(covariance, (4000, 2, 2)))) < high


def test_nees_agrees_with_filterpy():
    rng = np.random.default_rng(4)
    truth, estimate = rng.normal(size=(2, 5, 3, 1))
    root = rng.normal(size=(5, 3, 3))
    covariance = root @ np.swapaxes(root, 1, 2) + np.eye(3)
    expected = np.ravel(NEES(truth, estimate, covariance))
    np.testing.assert_allclose(
        metrics.nees((truth - estimate)[..., 0], covariance), expected, rtol=1e-10
    )


def test_bounds_of_the_mean():
    # chi-square with 200 degrees of freedom: 162.73 and 241.06 hold 95 %
    assert metrics.mean_bounds(100, dof=2) == pytest.approx((1.62728, 2.41058), rel=1e-4)


@pytest.mark.parametrize("count", [1, 10, 199, 200, 1000, 100_000])
def test_bounds_agree_with_the_quantiles_of_scipy(count):
    expected = scipy.stats.chi2.ppf([0.025, 0.975], count) / count
    assert metrics.mean_bounds(count) == pytest.approx(tuple(expected), rel=5e-5)


def test_lag1_of_an_ar1_series():
    assert metrics.lag1(ar1(np.random.default_rng(5), 0.6, 20_000)) == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [3.0] * 9])
def test_correlation_of_constant_or_short_series_is_zero(values):
    assert metrics.lag1(np.array(values)) == 0.0
    assert metrics.autocorrelation(np.array(values), 5).tolist() == [1.0] + [0.0] * min(
        5, max(len(values) - 1, 0)
    )


@pytest.mark.parametrize("count", [7, 100, 257])
def test_autocorrelation_is_the_sum_over_pairs(count):
    series = ar1(np.random.default_rng(6), 0.5, count)
    off = series - np.mean(series)
    expected = [
        off[lag:] @ off[: count - lag] / (off @ off) for lag in range(min(20, count - 1) + 1)
    ]
    result = metrics.autocorrelation(series, 20)
    np.testing.assert_allclose(result, expected, atol=1e-12)
    assert result[1] == pytest.approx(metrics.lag1(series))


def test_white_innovations_of_the_right_size_are_consistent():
    rng = np.random.default_rng(7)
    variance = rng.uniform(1.0, 30.0, 20_000)
    result = metrics.consistency(np.sqrt(variance) * rng.normal(size=20_000), variance)
    assert (result.n, result.n_at_limit) == (20_000, 0)
    assert result.mean_nis == pytest.approx(1.0, abs=0.04)
    assert result.nis_bounds == pytest.approx((0.98, 1.02), abs=0.001)
    assert sum(abs(r) > result.white_bound for r in result.autocorrelation) <= 4
    assert len(result.autocorrelation) == 20


def test_small_and_correlated_innovations_are_detected():
    series = ar1(np.random.default_rng(8), 0.6, 5000)
    result = metrics.consistency(series, np.full(5000, 9.0))
    assert result.mean_nis < result.nis_bounds[0]
    assert result.autocorrelation[:3] == pytest.approx((0.6, 0.36, 0.216), abs=0.06)


def test_readings_at_the_limit_are_counted_apart():
    result = metrics.consistency(
        np.array([2.0, np.nan, -2.0, np.nan]), np.array([4.0, np.nan, 1.0, np.nan])
    )
    assert (result.n, result.n_at_limit, result.mean_nis) == (4, 2, 2.5)


def test_no_innovations_have_no_consistency():
    result = metrics.consistency(np.array([np.nan]), np.array([np.nan]))
    assert (result.n, result.n_at_limit) == (1, 1)
    assert np.isnan(result.mean_nis)
