import numpy as np
import pytest
from filterpy.stats import NEES

from postproc.estimators import metrics


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
    np.testing.assert_allclose(metrics.nees((truth - estimate)[..., 0], covariance), expected, rtol=1e-10)


def test_bounds_of_the_mean():
    # chi-square with 200 degrees of freedom: 162.73 and 241.06 hold 95 %
    assert metrics.mean_bounds(100, dof=2) == pytest.approx((1.62728, 2.41058), rel=1e-4)


def test_lag1_of_an_ar1_series():
    rng = np.random.default_rng(5)
    series = np.zeros(20_000)
    for k in range(1, len(series)):
        series[k] = 0.6 * series[k - 1] + rng.normal()
    assert metrics.lag1(series) == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [3.0] * 9])
def test_lag1_says_nothing_of_constant_or_short_series(values):
    assert metrics.lag1(np.array(values)) == 0.0
