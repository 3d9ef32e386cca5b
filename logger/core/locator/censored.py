"""Readings at the end of the modem's scale: information, but not a level.

A level known only to be at most c has the likelihood Phi((c - mu) / sigma) (Tobin, Econometrica 26(1), 1958; for
localisation Gustafson et al., arXiv 1504.03977). Given the posterior of (P0, eta) from the other readings, the product
of these terms is integrated by Laplace's method: two unknowns, a concave logarithm, Newton steps.
"""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.blocks import Blocks, Censored
from logger.core.locator.evidence import Evidence, covariance_of
from logger.core.locator.prior import Prior

_NEWTON_STEPS = 6
_HALF_STEP_DB = 0.5
_SQRT_2PI = float(np.sqrt(2.0 * np.pi))


def added(
    of_levels: Evidence, blocks: Blocks, numbers: list[int], prior: Prior, x_m: FloatArray, y_m: FloatArray
) -> Evidence:
    """Evidence of the levels joined by that of the censored readings."""
    gone = blocks.censored
    d2 = (x_m - gone.x_m[:, None]) ** 2 + (y_m - gone.y_m[:, None]) ** 2 + prior.height_m**2
    distance_db = 5.0 * np.log10(np.maximum(d2, 1.0))
    parts = [
        _one(of_levels, row, gone, effective(gone, prior, number), distance_db) for row, number in enumerate(numbers)
    ]
    log_p, p0, eta, v00, v01, v11 = (np.stack(values) for values in zip(*parts, strict=True))
    return Evidence(log_p, np.stack([p0, eta]), np.stack([v00, v01, v11]), of_levels.sigma_db)


def effective(gone: Censored, prior: Prior, number: int) -> FloatArray:
    """How many independent readings those of each place are worth, shape (g,).

    Correlated shadowing hides several places at once: together they count as the 1' K^-1 1 of a common mean.
    """
    distance = np.hypot(gone.x_m[:, None] - gone.x_m, gone.y_m[:, None] - gone.y_m)
    k = covariance_of(distance, gone.readings, prior.hypotheses[number], prior.sigma_db)
    share = 1.0 / np.diag(k)
    worth = float(np.sum(np.linalg.solve(k, np.ones(len(k)))))
    return np.asarray(share * min(worth / float(np.sum(share)), 1.0), float)


def _one(
    of_levels: Evidence, row: int, gone: Censored, worth: FloatArray, distance_db: FloatArray
) -> tuple[FloatArray, ...]:
    """Log evidence and moments of (P0, eta) for one hypothesis, each (h,)."""
    m0, m1 = of_levels.theta[:, row]
    c00, c01, c11 = of_levels.theta_cov[:, row]
    det = c00 * c11 - c01 * c01
    a00, a01, a11 = c11 / det, -c01 / det, c00 / det
    scale = gone.side[:, None] / of_levels.sigma_db[row]
    limit_dbm = gone.limit_dbm - _HALF_STEP_DB * gone.side  # rounded to the end of the scale from inside it too

    def terms(p0: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        u = scale * (p0 - eta * distance_db - limit_dbm[:, None])
        log_phi = log_normal_cdf(u)
        mills = np.exp(-0.5 * u * u - log_phi) / _SQRT_2PI
        return log_phi, mills, mills * (mills + u)

    p0, eta = m0.copy(), m1.copy()
    h00, h01, h11 = a00, a01, a11
    for _ in range(_NEWTON_STEPS):
        _, first, second = terms(p0, eta)
        g, w = worth[:, None] * first * scale, worth[:, None] * second * scale**2
        h00, h01, h11 = a00 + w.sum(0), a01 - (w * distance_db).sum(0), a11 + (w * distance_db**2).sum(0)
        d0, d1 = p0 - m0, eta - m1
        g0 = g.sum(0) - a00 * d0 - a01 * d1
        g1 = -(g * distance_db).sum(0) - a01 * d0 - a11 * d1
        inverse = 1.0 / (h00 * h11 - h01 * h01)
        p0, eta = p0 + (h11 * g0 - h01 * g1) * inverse, eta + (h00 * g1 - h01 * g0) * inverse
    log_phi = terms(p0, eta)[0]
    d0, d1 = p0 - m0, eta - m1
    away = 0.5 * (a00 * d0 * d0 + 2.0 * a01 * d0 * d1 + a11 * d1 * d1)
    after = h00 * h11 - h01 * h01
    log_p = of_levels.log_p[row] + worth @ log_phi - away - 0.5 * np.log(after * det)
    return log_p, p0, eta, h11 / after, -h01 / after, h00 / after


def log_normal_cdf(u: FloatArray) -> FloatArray:
    """Log of the standard normal distribution function, relative error of the function below 2e-7 for all u.

    From the rational approximation of erfc in Abramowitz & Stegun 7.1.26's successor (Press et al., Numerical Recipes,
    sec. 6.2, erfcc), whose logarithm stays finite far in the tail.
    """
    x = np.abs(u) / np.sqrt(2.0)
    t = 1.0 / (1.0 + 0.5 * x)
    power = np.zeros_like(x)
    for coefficient in _ERFC:
        power = power * t + coefficient
    tail = np.log(0.5 * t) - x * x + power
    return np.asarray(np.where(u < 0.0, tail, np.log1p(-np.exp(np.minimum(tail, -1e-300)))), float)


_ERFC = (
    0.17087277,
    -0.82215223,
    1.48851587,
    -1.13520398,
    0.27886807,
    -0.18628806,
    0.09678418,
    0.37409196,
    1.00002368,
    -1.26551223,
)
