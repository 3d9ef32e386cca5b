import numpy as np
import pytest
from scipy.stats import multivariate_normal

from logger.core.model.noise import whiteners_of
from logger.core.model.prior import Hypothesis
from logger.core.places import Places
from postproc.estimators import residuals


def lines(rng, count=600):
    """A walk of 1.4 m steps along a bent line."""
    s = 1.4 * np.arange(count)
    return np.minimum(s, 400.0), np.maximum(s - 400.0, 0.0) + 0.01 * rng.normal(size=count)


def noise(rng, x, y, white_db, shadow_db, d_c):
    rho = np.exp(-np.hypot(np.diff(x), np.diff(y)) / d_c)
    s = rng.normal(size=len(x))
    for k, r in enumerate(rho, start=1):
        s[k] = r * s[k - 1] + np.sqrt(1.0 - r * r) * s[k]
    return shadow_db * s + white_db * rng.normal(size=len(x))


def estimate(x, y, e, design):
    one = np.ones(len(x))
    left = e - design @ np.linalg.lstsq(design, e, rcond=None)[0]
    return residuals.residual_noise(residuals.Shapes.of(Places.of(x, y), one, one), design, left)


def test_averages_are_weighted():
    square, weight = np.array([0, 1, 0]), np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(
        residuals.averages(square, weight, np.array([4.0, 5.0, 8.0])), [7.0, 5.0]
    )
    rows = np.array([[4.0, 1.0], [5.0, 2.0], [8.0, 3.0]])
    np.testing.assert_allclose(residuals.averages(square, weight, rows), [[7.0, 2.5], [5.0, 2.0]])


def test_white_noise_is_estimated_white_and_of_its_size():
    rng = np.random.default_rng(2)
    x, y = lines(rng)
    estimated = estimate(x, y, noise(rng, x, y, 3.0, 0.0, 1.0), np.ones((600, 1)))
    assert estimated.white > 0.9
    readings = np.bincount(estimated.square)
    np.testing.assert_allclose(np.diag(estimated.covariance_db2) * readings, 9.0, rtol=0.25)


@pytest.mark.parametrize("d_c", [12.0, 35.0])
def test_correlation_is_estimated_and_doubled_for_lack_of_trust(d_c):
    rng = np.random.default_rng(3)
    x, y = lines(rng)
    estimated = estimate(x, y, noise(rng, x, y, 1.0, 6.0, d_c), np.ones((600, 1)))
    assert estimated.white < 0.01
    assert 0.5 * d_c < estimated.decorrelation_m < 2.0 * d_c
    assert np.mean(np.diag(estimated.covariance_db2)) == pytest.approx(2.0 * 37.0, rel=0.5)


def test_restricted_likelihood_is_that_of_the_contrasts():
    """Residuals of a fit are A'e with A' X = 0: their own likelihood, scale free, is the restricted
    one.
    """
    rng = np.random.default_rng(4)
    count, columns = 12, 3
    x = np.arange(count) * 3.0
    distance = np.abs(x[:, None] - x)
    design, e = rng.normal(size=(count, columns)), rng.normal(size=count)
    shapes = [
        residuals._shape(distance, np.ones(count), Hypothesis(a, d_c, 1.0))
        for a, d_c in ((1.0, 0.0), (0.1, 12.0), (0.5, 35.0))
    ]
    contrasts = np.linalg.svd(design)[0][:, columns:]
    sigma = np.geomspace(1e-3, 1e3, 4001)
    expected = []
    for shape in shapes:
        inner = contrasts.T @ shape @ contrasts
        density = [multivariate_normal(cov=s * s * inner).pdf(contrasts.T @ e) for s in sigma[::20]]
        expected.append(
            np.log(np.trapezoid(density, np.log(sigma[::20])))
        )  # over a flat prior of log sigma
    whitened = whiteners_of(np.array(shapes))
    got = [residuals._restricted_likelihood(one, design, e)[0] for one in whitened]
    np.testing.assert_allclose(np.diff(got), np.diff(expected), atol=1e-2)


def test_very_few_squares_are_not_taken_for_certainty():
    one = np.ones(6)
    shapes = residuals.Shapes.of(Places.of(np.zeros(6), np.zeros(6)), one, one)
    still = residuals.residual_noise(shapes, np.ones((6, 4)), np.zeros(6))
    assert still.covariance_db2.shape == (1, 1)
    assert still.covariance_db2[0, 0] > 1.0
