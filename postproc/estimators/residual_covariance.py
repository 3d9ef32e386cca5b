"""How residuals of a walk vary together: the covariance behind every honest standard error.

Shadowing belongs to the ground, so residuals are alike where points are near, whenever measured.
With D_ij the distance of two squares, a the white share, d_c the decorrelation distance and n_i the
readings of a square, `model.noise` has

    cov(e_i, e_j) = sigma^2 [(1 - a) exp(-D_ij / d_c) + delta_ij (a / n_i + rounding)]

(Gudmundson, Electron. Lett. 27(23), 1991). Residuals of a fit look whiter than the noise was, since
the fit follows it; restricted likelihood allows for that (Patterson & Thompson, Biometrika 58(3),
1971). With X the fit's design of k columns, m squares and s the squared residuals off X in the
metric of K:

    log p(a, d_c | e) = -1/2 log|K| - 1/2 log|X' K^-1 X| - (m - k) / 2 log s + const
    E sigma^2 = (s + SIGMA_DB^2) / (m - k - 1)

The covariance returned is the mean over the hypotheses short enough for the walk to tell.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model import marginal
from logger.core.model.blocks import squares
from logger.core.model.noise import independent_variance, shadowing
from logger.core.model.prior import WHITE, Hypothesis, Prior
from logger.core.places import Places

_WHITE_SHARES = 0.1, 0.5
_DECORRELATION_M = 12.0, 35.0, 110.0, 350.0, 1100.0
_TRUST = 0.5
"""Noise considered: each pair of share and distance is as likely as white noise alone.

Half of 464 measured walks decorrelated within 22 m, nearly all within 12 to 390 m. Variances of
correlated noise are divided by the trust: an exponential is a guess about houses and hills, and
regions that trusted it fully held the truth in 78 % of 165 measured walks where 95 % were meant.
"""
SIGMA_DB = Prior().sigma_db
"""Median of those walks with the true position known; counts as one more reading."""

_MOST_SQUARES = 300  # their covariance is factored for each hypothesis
_FLAT = 1e-9  # precision of columns whose mean square is 1: nothing but keeps them invertible
_NEGLIGIBLE_DB2 = 1e-9  # misfit of levels that fit exactly


class ResidualNoise(NamedTuple):
    """Noise of residuals averaged over squares.

    `square` (n,) is the number of the square each row lies in; `covariance_db2` (m, m) is that of
    the squares' means; `white` the probability that nothing is correlated; `white_share` and
    `decorrelation_m` are means over the correlated hypotheses.
    """

    square: IntArray
    covariance_db2: FloatArray
    white: float
    white_share: float
    decorrelation_m: float


def averages(square: IntArray, weight: FloatArray, values: FloatArray) -> FloatArray:
    """Weighted means of the rows of `values`, (n,) or (n, k), in each square."""
    total = np.bincount(square, weight)
    columns = [np.bincount(square, weight * column) / total for column in np.atleast_2d(values.T)]
    return np.asarray(columns[0] if values.ndim == 1 else np.column_stack(columns), float)


def unit_columns(design: FloatArray) -> FloatArray:
    """The design (n, k) with columns of unit mean square, for rank and rounding."""
    scale = np.sqrt(np.mean(design**2, axis=0))
    return np.asarray(design / np.maximum(scale, 1e-300), float)


def residual_noise(
    places: Places,
    readings: FloatArray,
    weight: FloatArray,
    design: FloatArray,
    residual_db: FloatArray,
) -> ResidualNoise:
    """Noise that the residuals (n,) of a weighted fit with this design (n, k) show.

    `readings` (n,) is how many a row stands for; the weights (n,) are positive.
    """
    square, _ = squares(places, _MOST_SQUARES)
    x, y, e = (averages(square, weight, v) for v in (places.x_m, places.y_m, residual_db))
    scaled = averages(square, weight, unit_columns(design))
    n_there = np.bincount(square, readings).astype(float)
    apart_m = np.hypot(x[:, None] - x, y[:, None] - y)
    hypotheses = _testable(0.5 * float(np.max(apart_m)))
    shapes = np.array([_shape(apart_m, n_there, h) for h in hypotheses])
    likelihoods = [_restricted_likelihood(shape, scaled, e) for shape in shapes]
    log_p, variance_db2 = np.array(likelihoods).T
    p = np.exp(log_p - np.max(log_p))
    p /= np.sum(p)
    white_share, decorrelation_m = np.array([(h.white_share, h.short_m) for h in hypotheses]).T
    trust = np.where(white_share < 1.0, _TRUST, 1.0)
    covariance = np.einsum("h,hij->ij", p * variance_db2 / trust, shapes)
    correlated = p[1:] / max(np.sum(p[1:]), 1e-300)
    return ResidualNoise(
        square,
        covariance,
        white=float(p[0]),
        white_share=float(correlated @ white_share[1:]),
        decorrelation_m=float(correlated @ decorrelation_m[1:]),
    )


def _testable(longest_m: float) -> list[Hypothesis]:
    """Hypotheses whose decorrelation distance the walk can tell from a trend; the first is white.

    A trend is taken up by the fit.
    """
    longest_m = max(longest_m, _DECORRELATION_M[0])
    distances_m = [distance_m for distance_m in _DECORRELATION_M if distance_m <= longest_m]
    return [WHITE, *(Hypothesis(a, d_m) for a in _WHITE_SHARES for d_m in distances_m)]


def _shape(apart_m: FloatArray, readings: FloatArray, hypothesis: Hypothesis) -> FloatArray:
    """K of one hypothesis in units of sigma^2, shape (m, m)."""
    independent = independent_variance(readings, hypothesis.white_share, SIGMA_DB)
    return shadowing(apart_m, hypothesis) + np.diag(independent)


def _restricted_likelihood(
    shape: FloatArray, design: FloatArray, e: FloatArray
) -> tuple[float, float]:
    """Log restricted likelihood of K, and the mean of sigma^2 under it.

    The coefficients of the design are integrated out by the model's marginaliser under a prior that
    is flat beside any reading.
    """
    k = design.shape[1]
    root = np.linalg.cholesky(shape)
    white = np.linalg.solve(root, np.column_stack([e, design]))
    sums = (white.T @ white)[np.tril_indices(k + 1)]
    flat = marginal.prior_sums(np.zeros(k), _FLAT * np.eye(k))
    no_weight, sigma_1 = 0.0, np.zeros((1, 1))
    rest = marginal.fit(np.append(sums, no_weight)[:, None, None], flat[:, None, None], sigma_1)
    misfit_db2, free = max(float(rest.misfit[0, 0]), 0.0), max(len(e) - k, 0)
    log_det = 2.0 * float(np.sum(np.log(np.diag(root)))) + float(rest.log_det[0, 0])
    log_p = -0.5 * (log_det + free * np.log(misfit_db2 + _NEGLIGIBLE_DB2))
    return log_p, (misfit_db2 + SIGMA_DB**2) / max(free - 1.0, 0.5)
