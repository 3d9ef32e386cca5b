"""Readings at the end of the modem's scale: information, but not a level.

A level known only to be at most c has the likelihood Phi((c - mu) / s) (Tobin, Econometrica 26(1), 1958; for
localisation Gustafson et al., arXiv 1504.03977). What the levels z tell of it is taken first. With W as in `evidence`,
K_c the covariance of censored places and blocks, gain G = K_c W'W, and H = [1, -L]:

    level at c | z, P0, eta, sigma ~ N(H_c t + G (z - H t), sigma^2 (K_cc - G K_c')),  t = (P0, eta)

The product of these terms and the density of z is integrated over P0, eta and log sigma together by Laplace's method:
near the end of the scale the levels kept are the high ones, and alone they tell too small a sigma.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.blocks import Blocks, Censored
from logger.core.locator.evidence import Evidence, Whitener, distances_db, marginal, own_variance
from logger.core.locator.prior import Hypothesis, Prior

_NEWTON_STEPS = 12
_LARGEST_STEP = 0.4
_SHORTER = 0.25
_CLOSE_NATS = 1e-3
_LEAST_SHARE = 0.2
_HALF_STEP_DB = 0.5
_SQRT_2PI = float(np.sqrt(2.0 * np.pi))


class Given(NamedTuple):
    """What blocks of known level tell of the censored places under one hypothesis.

    `gain` (g, n) is G, `known_dbm` (g,) is G z, `power` (g,) how much P0 still counts, `spread` (g,) the standard
    deviation of a level in units of sigma, `worth` (g,) how many independent readings those of the place are.
    """

    gain: FloatArray
    known_dbm: FloatArray
    power: FloatArray
    spread: FloatArray
    worth: FloatArray


def given_levels(blocks: Blocks, noise: Whitener, hypothesis: Hypothesis) -> Given:
    """What the levels of blocks tell of their censored places."""
    gone = blocks.censored
    known = noise.matrix @ shadowing(gone, hypothesis, blocks.x_m, blocks.y_m).T
    left = shadowing(gone, hypothesis, gone.x_m, gone.y_m) - known.T @ known
    gain = known.T @ noise.matrix
    spread = np.sqrt(np.maximum(np.diagonal(left), 0.0) + hypothesis.white_share)
    worth = effective(left, spread, hypothesis.white_share, gone.readings)
    return Given(gain, gain @ blocks.level_dbm, 1.0 - np.sum(gain, axis=1), spread, worth)


def shadowing(gone: Censored, hypothesis: Hypothesis, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Covariance, in units of sigma^2, of the shadowing at censored places with that at places (n,), shape (g, n)."""
    a, d_c, _ = hypothesis
    apart_m = np.hypot(gone.x_m[:, None] - x_m, gone.y_m[:, None] - y_m)
    return np.asarray((1.0 - a) * np.exp(-apart_m / max(d_c, 1.0)), float)


def effective(left: FloatArray, spread: FloatArray, white_share: float, readings: FloatArray) -> FloatArray:
    """How many independent readings those of each place are worth, shape (g,).

    Correlated shadowing, of which `left` (g, g) is unknown, hides several places at once: together they count as the
    1' K^-1 1 of a common mean.
    """
    k = left + np.diag(own_variance(readings, white_share, np.inf))
    k /= spread[:, None] * spread
    share = 1.0 / np.diagonal(k)
    worth = float(np.sum(np.linalg.solve(k, np.ones(len(k)))))
    return np.asarray(share * min(worth / float(np.sum(share)), 1.0), float)


def beyond_dbm(gone: Censored) -> FloatArray:
    """What the level was beyond: it is rounded to the end of the scale from inside it too, shape (g,)."""
    return np.asarray(gone.limit_dbm - _HALF_STEP_DB * gone.side, float)


def distances_to(gone: Censored, height_m: float, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """L = 10 log10 d of each censored place from each place (h,), shape (g, h)."""
    d2 = (x_m - gone.x_m[:, None]) ** 2 + (y_m - gone.y_m[:, None]) ** 2 + height_m**2
    return np.asarray(5.0 * np.log10(np.maximum(d2, 1.0)), float)


def joined(
    total: FloatArray,
    log_det: FloatArray,
    blocks: Blocks,
    given: list[Given],
    prior: Prior,
    x_m: FloatArray,
    y_m: FloatArray,
) -> Evidence:
    """As `evidence.marginal`, of levels and censored readings; one of `given` for each hypothesis."""
    start = marginal(total, len(blocks), log_det, prior, 1)
    gone_db = distances_to(blocks.censored, prior.height_m, x_m, y_m)
    levels_db = distances_db(blocks, prior.height_m, x_m, y_m)
    constant = -0.5 * (log_det + len(blocks) * np.log(2.0 * np.pi))
    parts = []
    for row, one in enumerate(given):
        terms = _Terms.of(blocks.censored, one, gone_db - one.gain @ levels_db if np.any(one.gain) else gone_db)
        begun = np.stack([*start.theta[:, row], np.log(start.sigma_db[row])])
        parts.append(_laplace(total[:, row], len(blocks), terms, prior, begun))
    log_p, mean, spread = (np.stack(values, axis=-2) for values in zip(*parts, strict=True))
    return Evidence(log_p + constant, mean[:2], spread, np.exp(mean[2]))


class _Terms(NamedTuple):
    """Censored terms worth * log Phi((of_p0 P0 + of_eta eta + of_one) / sigma); shapes (g, 1), `of_eta` (g, h)."""

    of_p0: FloatArray
    of_eta: FloatArray
    of_one: FloatArray
    worth: FloatArray

    @classmethod
    def of(cls, gone: Censored, given: Given, distance_db: FloatArray) -> "_Terms":
        sign = gone.side / given.spread
        one = sign * (given.known_dbm - beyond_dbm(gone))
        return cls((sign * given.power)[:, None], -sign[:, None] * distance_db, one[:, None], given.worth[:, None])


def _laplace(
    total: FloatArray, n: int, terms: _Terms, prior: Prior, at: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log evidence (h,), mode (3, h), covariance of P0 and eta (3, h); Newton's method begins at `at` (3, h).

    A step that does not lead up is shortened.
    """
    bend, length = _bend(total, n, terms, prior, at), np.ones(at.shape[1])
    for _ in range(_NEWTON_STEPS):
        step, gain = _newton_step(bend)
        if np.max(length * gain) < _CLOSE_NATS:
            break
        tried = _bend(total, n, terms, prior, at + length * step)
        up = tried[0] >= bend[0]
        at, bend = np.where(up, at + length * step, at), np.where(up, tried, bend)
        length = np.where(up, 1.0, _SHORTER * length)
    (h00, h01, h11), (k0, k1), corner = bend[4:7], *_column(bend)
    det = h00 * h11 - h01 * h01
    spread = np.stack([h11 / det + k0 * k0 / corner, -h01 / det + k0 * k1 / corner, h00 / det + k1 * k1 / corner])
    return bend[0] - 0.5 * np.log(det * corner), at, spread


def _newton_step(bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Step (3, h), and twice what it is expected to gain (h,)."""
    (g0, g1, g2), (h00, h01, h11), (k0, k1), corner = bend[1:4], bend[4:7], *_column(bend)
    of_sigma = np.clip((g2 - k0 * g0 - k1 * g1) / corner, -_LARGEST_STEP, _LARGEST_STEP)
    det = h00 * h11 - h01 * h01
    of_p0, of_eta = (h11 * g0 - h01 * g1) / det - k0 * of_sigma, (h00 * g1 - h01 * g0) / det - k1 * of_sigma
    step = np.stack([of_p0, of_eta, of_sigma])
    return step, np.asarray(np.sum(step * bend[1:4], axis=0), float)


def _column(bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Last column of the negative Hessian solved for the first two unknowns (2, h), and what is left of its corner."""
    h00, h01, h11, h02, h12, h22 = bend[4:]
    solved = np.stack([h11 * h02 - h01 * h12, h00 * h12 - h01 * h02]) / (h00 * h11 - h01 * h01)
    return solved, np.maximum(h22 - solved[0] * h02 - solved[1] * h12, _LEAST_SHARE * h22)


def _bend(total: FloatArray, n: int, terms: _Terms, prior: Prior, at: FloatArray) -> FloatArray:
    """Log density in P0, eta and log sigma, its gradient, its negative Hessian (00, 01, 11, 02, 12, 22): (10, h)."""
    oo, ol, ll, oz, lz, zz, log_weight = total
    p0, eta, tau = at
    lam0, lam1, lam2 = prior.p0_sigma_db**-2, prior.eta_sigma**-2, prior.sigma_log_sd**-2
    off0, off1, off2 = p0 - prior.p0_dbm, eta - prior.eta, tau - np.log(prior.sigma_db)
    s = np.exp(-tau)
    w = s * s
    r0, r1 = w * (oz - p0 * oo - eta * ol), w * (lz - p0 * ol - eta * ll)
    residual = np.maximum(w * (zz - p0 * oz - eta * lz) - p0 * r0 - eta * r1, 0.0)

    x0, x1 = terms.of_p0[:, 0], terms.of_eta
    u = s * (terms.of_p0 * p0 + x1 * eta + terms.of_one)
    log_phi = log_normal_cdf(u)
    mills = np.exp(-0.5 * u * u - log_phi) / _SQRT_2PI
    first, second = terms.worth * mills, terms.worth * mills * (mills + u)
    mixed, second1 = second * u - first, second * x1

    log_p = log_weight - n * tau + 0.5 * np.log(lam0 * lam1 * lam2) + terms.worth[:, 0] @ log_phi
    log_p -= 0.5 * (residual + lam0 * off0 * off0 + lam1 * off1 * off1 + lam2 * off2 * off2)
    return np.stack(
        [
            log_p,
            r0 - lam0 * off0 + s * (x0 @ first),
            r1 - lam1 * off1 + s * np.sum(first * x1, axis=0),
            residual - n - lam2 * off2 - np.sum(first * u, axis=0),
            w * (oo + (x0 * x0) @ second) + lam0,
            w * (ol + x0 @ second1),
            w * (ll + np.sum(second1 * x1, axis=0)) + lam1,
            2.0 * r0 - s * (x0 @ mixed),
            2.0 * r1 - s * np.sum(mixed * x1, axis=0),
            np.maximum(2.0 * residual + lam2 + np.sum(mixed * u, axis=0), 0.5 * lam2),
        ]
    )


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
