"""Readings at the end of the modem's scale: information, but not a level.

A level known only to be at most c has the likelihood Phi((c - mu) / s) (Tobin, Econometrica 26(1),
1958; for localisation Gustafson et al., arXiv 1504.03977). What the levels z tell of it is taken
first. With W as in `evidence`, K_c the covariance of censored places and blocks, gain G = K_c W'W,
and H = [1, -L]:

    level at c | z, P0, eta, sigma ~ N(H_c t + G (z - H t), sigma^2 (K_cc - G K_c')),  t = (P0, eta)

The product of these terms and the density of z is integrated over P0, eta and log sigma together by
Laplace's method: near the end of the scale the levels kept are the high ones, and alone they tell
too small a sigma.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.evidence import Evidence, distances_db, marginal
from logger.core.model.blocks import Blocks, Censored
from logger.core.model.noise import Whitener, correlation, independent_variance
from logger.core.model.prior import Hypothesis, Prior

_NEWTON_STEPS = 12
_LARGEST_STEP = 0.4
_SHORTER = 0.25
_CLOSE_NATS = 1e-2
_COLUMNS = 512  # at once: these matrices stay in the cache
_LEAST_SHARE = 0.2
_HALF_STEP_DB = 0.5
_SQRT_2PI = float(np.sqrt(2.0 * np.pi))
_HALF_ROOT = float(np.sqrt(0.125))


class Given(NamedTuple):
    """What blocks of known level tell of the censored places under one hypothesis.

    `gain` (g, n) is G, `known_dbm` (g,) is G z, `power` (g,) how much P0 still counts, `spread`
    (g,) the standard deviation of a level in units of sigma, `worth` (g,) how many independent
    readings those of the place are.
    """

    gain: FloatArray
    known_dbm: FloatArray
    power: FloatArray
    spread: FloatArray
    worth: FloatArray


def given_levels(blocks: Blocks, noise: Whitener, hypothesis: Hypothesis) -> Given:
    """What the levels of blocks tell of their censored places."""
    gone = blocks.censored
    known = noise.matrix @ shadowing_in_blocks(blocks, hypothesis).T
    left = shadowing(gone, hypothesis, gone.x_m, gone.y_m) - known.T @ known
    gain = known.T @ noise.matrix
    spread = np.sqrt(np.maximum(np.diagonal(left), 0.0) + hypothesis.white_share)
    worth = effective(left, spread, hypothesis.white_share, gone.readings)
    return Given(gain, gain @ blocks.level_dbm, 1.0 - np.sum(gain, axis=1), spread, worth)


def shadowing(
    gone: Censored, hypothesis: Hypothesis, x_m: FloatArray, y_m: FloatArray
) -> FloatArray:
    """Covariance, in units of sigma^2, of the shadowing at censored places with that at places
    (n,), shape (g, n).
    """
    a, d_c, _ = hypothesis
    apart_m = np.hypot(gone.x_m[:, None] - x_m, gone.y_m[:, None] - y_m)
    return (1.0 - a) * correlation(apart_m, d_c)


def shadowing_in_blocks(blocks: Blocks, hypothesis: Hypothesis) -> FloatArray:
    """The same with the means over the points of the blocks, shape (g, n)."""
    return blocks.mean(
        shadowing(blocks.censored, hypothesis, blocks.point_x_m, blocks.point_y_m).T
    ).T


def effective(
    left: FloatArray, spread: FloatArray, white_share: float, readings: FloatArray
) -> FloatArray:
    """How many independent readings those of each place are worth, shape (g,).

    Correlated shadowing, of which `left` (g, g) is unknown, hides several places at once: together
    they count as the 1' K^-1 1 of a common mean.
    """
    k = left + np.diag(independent_variance(readings, white_share, np.inf))
    k /= spread[:, None] * spread
    share = 1.0 / np.diagonal(k)
    worth = float(np.sum(np.linalg.solve(k, np.ones(len(k)))))
    return np.asarray(share * min(worth / float(np.sum(share)), 1.0), float)


def beyond_dbm(gone: Censored) -> FloatArray:
    """What the level was beyond: it is rounded to the end of the scale from inside it too, shape
    (g,).
    """
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
    near: Evidence | None = None,
) -> Evidence:
    """As `evidence.marginal`, of levels and censored readings; one of `given` for each hypothesis.

    `near` is the evidence of places nearby, to begin with.
    """
    start = marginal(total, len(blocks), log_det, prior, 1) if near is None else near
    gone_db = distances_to(blocks.censored, prior.height_m, x_m, y_m)
    levels_db = distances_db(blocks, prior.height_m, x_m, y_m)
    begun = np.stack([*start.theta, np.log(start.sigma_db)])
    at_once, parts = max(_COLUMNS // len(x_m), 1), []
    for i in range(0, len(given), at_once):
        some = slice(i, i + at_once)
        terms = _Terms.of(blocks.censored, given[some], gone_db, levels_db)
        of_some = (
            total[:, some].reshape(len(total), -1),
            len(blocks),
            terms,
            prior,
            begun[:, some].reshape(3, -1),
        )
        parts.append(_laplace(*of_some))
    log_p, mean, spread = (np.concatenate(values, axis=-1) for values in zip(*parts, strict=True))
    mean, spread = mean.reshape(begun.shape), spread.reshape(begun.shape)
    constant = -0.5 * (log_det + len(blocks) * np.log(2.0 * np.pi))
    return Evidence(log_p.reshape(begun.shape[1:]) + constant, mean[:2], spread, np.exp(mean[2]))


class _Terms(NamedTuple):
    """Censored terms worth * log Phi((of_p0 P0 + of_eta eta + of_one) / sigma), shape (g, k) each.

    A column for each place under one hypothesis after the other.
    """

    of_p0: FloatArray
    of_eta: FloatArray
    of_one: FloatArray
    worth: FloatArray

    @classmethod
    def of(
        cls, gone: Censored, given: list[Given], gone_db: FloatArray, levels_db: FloatArray
    ) -> "_Terms":
        sign = np.stack([gone.side / one.spread for one in given], axis=1)
        power, known_dbm, worth = (
            np.stack(column, axis=1)
            for column in zip(*((g.power, g.known_dbm, g.worth) for g in given), strict=True)
        )
        apart_db = [
            gone_db - one.gain @ levels_db if np.any(one.gain) else gone_db for one in given
        ]
        of_one = sign * (known_dbm - beyond_dbm(gone)[:, None])
        of_p0, sign, of_one, worth = np.repeat(
            [sign * power, sign, of_one, worth], gone_db.shape[1], axis=2
        )
        return cls(of_p0, -sign * np.concatenate(apart_db, axis=1), of_one, worth)

    def some(self, columns: IntArray) -> "_Terms":
        """Those of some columns."""
        return _Terms(*(values[:, columns] for values in self))


def _laplace(
    total: FloatArray, n: int, terms: _Terms, prior: Prior, at: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log evidence (h,), mode (3, h), covariance of P0 and eta (3, h); Newton's method begins at
    `at` (3, h).

    A step that does not lead up is shortened.
    """
    bend, length, far = (
        _bend(total, n, terms, prior, at),
        np.ones(at.shape[1]),
        np.arange(at.shape[1]),
    )
    for _ in range(_NEWTON_STEPS):
        step, gain = _newton_step(bend[:, far])
        still = length[far] * gain > _CLOSE_NATS
        far = far[still]
        if not len(far):
            break
        there = at[:, far] + length[far] * step[:, still]
        tried = _bend(total[:, far], n, terms.some(far), prior, there)
        up = tried[0] >= bend[0, far]
        at[:, far[up]], bend[:, far[up]] = there[:, up], tried[:, up]
        length[far] = np.where(up, 1.0, _SHORTER * length[far])
    (h00, h01, h11), (k0, k1), corner = bend[4:7], *_column(bend)
    det = h00 * h11 - h01 * h01
    spread = np.stack(
        [h11 / det + k0 * k0 / corner, -h01 / det + k0 * k1 / corner, h00 / det + k1 * k1 / corner]
    )
    return bend[0] - 0.5 * np.log(det * corner), at, spread


def _newton_step(bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Step (3, h), and twice what it is expected to gain (h,)."""
    (g0, g1, g2), (h00, h01, h11), (k0, k1), corner = bend[1:4], bend[4:7], *_column(bend)
    of_sigma = np.clip((g2 - k0 * g0 - k1 * g1) / corner, -_LARGEST_STEP, _LARGEST_STEP)
    det = h00 * h11 - h01 * h01
    of_p0, of_eta = (
        (h11 * g0 - h01 * g1) / det - k0 * of_sigma,
        (h00 * g1 - h01 * g0) / det - k1 * of_sigma,
    )
    step = np.stack([of_p0, of_eta, of_sigma])
    return step, np.asarray(np.sum(step * bend[1:4], axis=0), float)


def _column(bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Last column of the negative Hessian solved for the first two unknowns (2, h), and what is
    left of its corner.
    """
    h00, h01, h11, h02, h12, h22 = bend[4:]
    solved = np.stack([h11 * h02 - h01 * h12, h00 * h12 - h01 * h02]) / (h00 * h11 - h01 * h01)
    return solved, np.maximum(h22 - solved[0] * h02 - solved[1] * h12, _LEAST_SHARE * h22)


def _bend(total: FloatArray, n: int, terms: _Terms, prior: Prior, at: FloatArray) -> FloatArray:
    """Log density in P0, eta and log sigma, its gradient, its negative Hessian (00, 01, 11, 02, 12,
    22): (10, h).
    """
    oo, ol, ll, oz, lz, zz, log_weight = total
    p0, eta, tau = at
    lam0, lam1, lam2 = prior.p0_sigma_db**-2, prior.eta_sigma**-2, prior.sigma_log_sd**-2
    off0, off1, off2 = p0 - prior.p0_dbm, eta - prior.eta, tau - np.log(prior.sigma_db)
    s = np.exp(-tau)
    w = s * s
    r0, r1 = w * (oz - p0 * oo - eta * ol), w * (lz - p0 * ol - eta * ll)
    residual = np.maximum(w * (zz - p0 * oz - eta * lz) - p0 * r0 - eta * r1, 0.0)

    x0, x1, of_one, worth = terms
    u = s * (x0 * p0 + x1 * eta + of_one)
    log_phi, slope = log_cdf_and_slope(u)
    first = worth * slope
    second = first * (slope + u)
    mixed, second0, second1 = second * u - first, second * x0, second * x1

    log_p = log_weight - n * tau + 0.5 * np.log(lam0 * lam1 * lam2) + _dot(worth, log_phi)
    log_p -= 0.5 * (residual + lam0 * off0 * off0 + lam1 * off1 * off1 + lam2 * off2 * off2)
    return np.stack(
        [
            log_p,
            r0 - lam0 * off0 + s * _dot(first, x0),
            r1 - lam1 * off1 + s * _dot(first, x1),
            residual - n - lam2 * off2 - _dot(first, u),
            w * (oo + _dot(second0, x0)) + lam0,
            w * (ol + _dot(second0, x1)),
            w * (ll + _dot(second1, x1)) + lam1,
            2.0 * r0 - s * _dot(mixed, x0),
            2.0 * r1 - s * _dot(mixed, x1),
            np.maximum(2.0 * residual + lam2 + _dot(mixed, u), 0.5 * lam2),
        ]
    )


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("gk,gk->k", a, b), float)


def log_cdf_and_slope(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log of the standard normal distribution function and its slope phi(u) / Phi(u), relative
    errors below 2e-7.

    From the rational approximation of erfc in Abramowitz & Stegun 7.1.26's successor (Press et al.,
    Numerical Recipes, sec. 6.2, erfcc), whose logarithm stays finite far in the tail.
    """
    squared = 0.5 * u * u
    t = 1.0 / (1.0 + np.abs(u) * _HALF_ROOT)
    power = np.full_like(t, _ERFC[0])
    for coefficient in _ERFC[1:]:
        power *= t
        power += coefficient
    tail = 0.5 * t * np.exp(power)  # of -|u|, times exp(u^2 / 2)
    bell, below = np.exp(-squared), u < 0.0
    share = np.where(below, tail, 1.0 - bell * tail)
    slope = np.where(below, 1.0, bell) / (_SQRT_2PI * share)
    return np.log(share) - np.where(below, squared, 0.0), slope


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
