"""What a walk says about places: log evidence with power, exponent and sigma integrated out.

With K = R R' the covariance of a hypothesis, W = R^-1, and whitened rows o = W 1, l = -W L, z = W
z, everything a place needs to be judged are six sums over rows (and the log of the rows' weights).
With s2 = sigma^2, A = [[o'o, o'l], [o'l, l'l]] / s2 + Lambda0, b = (o'z, l'z) / s2 + Lambda0 m0:

    log p(z | x, y, sigma) = -n/2 log 2pi - n log sigma - 1/2 log|K| + 1/2 log|Lambda0| - 1/2 log|A|
                             - 1/2 (z'z / s2 + m0' Lambda0 m0 - b' A^-1 b)

log sigma is integrated by Gauss-Hermite nodes around its mode (Naylor & Smith, Appl. Statist.
31(3), 1982).
"""

from functools import cache
from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.blocks import Blocks
from logger.core.model.noise import Whitener
from logger.core.model.prior import Prior

C = 10.0 / log(10.0)
SUMS = 7
"""o'o, o'l, l'l, o'z, l'z, z'z and the log weight of all rows."""

_NEWTON_STEPS = 2
_LEAST_SIGMA_DB = 0.05
"""Below it, as where all levels are the same, what is left of them is rounding errors, of either
sign.
"""
_STEADY = 0.05
_STRIP = 64
NODES = 7


class Evidence(NamedTuple):
    """Of each hypothesis (c) at each place (h): log evidence, mean and covariance of P0 and eta,
    mean of sigma.

    `log_p` and `sigma_db` have shape (c, h), `theta` (2, c, h), `theta_cov` (3, c, h): var P0, cov,
    var eta.
    """

    log_p: FloatArray
    theta: FloatArray
    theta_cov: FloatArray
    sigma_db: FloatArray


def distances_db(blocks: Blocks, height_m: float, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """L = 10 log10 d of each block from each place, shape (n, h).

    An uncertain receiver is farther away on average, E d^2 = d^2 + 2 sigma^2; the height adds too;
    at least 1 m.
    """
    spread = 2.0 * blocks.position_sigma_m**2
    if not blocks.of_one_point:
        spread = np.repeat(spread, np.diff(np.append(blocks.first, len(blocks.point_x_m))))
    d2 = (x_m - blocks.point_x_m[:, None]) ** 2 + (y_m - blocks.point_y_m[:, None]) ** 2
    return blocks.mean(5.0 * np.log10(np.maximum(d2 + spread[:, None] + height_m**2, 1.0)))


def receiver_variance(blocks: Blocks, prior: Prior, distance_db: FloatArray) -> FloatArray | None:
    """Variance (n, h) that the error of the receiver's position adds, in units of sigma^2; None
    where there is none.

    An error sigma_g at distance d moves the level by C eta sigma_g / d.
    """
    error_db = C * prior.eta * blocks.position_sigma_m[:, None] * 10.0 ** (-0.1 * distance_db)
    ratio = (error_db / prior.sigma_db) ** 2
    return ratio if np.any(ratio) else None


def sums(
    whitener: FloatArray, level_dbm: FloatArray, distance_db: FloatArray, extra: FloatArray | None
) -> FloatArray:
    """The sums of one hypothesis over rows of W (k, n), for blocks (n,) and places: `distance_db`
    (n, h); shape (7, h).

    A row of W with diagonal w predicts its block with variance 1 / w^2 (of sigma^2); `extra`
    variance of the block weighs the row down by 1 / (1 + w^2 extra), as if it were independent.
    """
    rows, h = whitener.shape[0], distance_db.shape[1]
    o, z, slope = (
        whitener @ np.ones(whitener.shape[1]),
        whitener @ level_dbm,
        _slope(whitener, distance_db),
    )
    if extra is None:
        fixed = [np.full(h, value) for value in (o @ o, o @ z, z @ z)]
        return np.stack(
            [
                fixed[0],
                o @ slope,
                _squares(slope, slope),
                fixed[1],
                z @ slope,
                fixed[2],
                np.zeros(h),
            ]
        )
    last = whitener.shape[1] - rows
    own = np.diagonal(whitener, offset=last) ** 2
    weight = 1.0 / (1.0 + own[:, None] * extra[last:])
    weighed = weight * slope
    oo, oz, zz = np.stack([o * o, o * z, z * z]) @ weight
    return np.stack(
        [
            oo,
            o @ weighed,
            _squares(weighed, slope),
            oz,
            z @ weighed,
            zz,
            0.5 * np.sum(np.log(weight), axis=0),
        ]
    )


def _slope(whitener: FloatArray, distance_db: FloatArray) -> FloatArray:
    """-W L in strips of rows: what is right of W's diagonal is zero."""
    (rows, n), found = whitener.shape, np.empty((len(whitener), distance_db.shape[1]))
    for i in range(0, rows, _STRIP):
        end = n - rows + i + _STRIP
        np.matmul(whitener[i : i + _STRIP, :end], distance_db[:end], out=found[i : i + _STRIP])
    return np.asarray(np.negative(found, out=found), float)


def _squares(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nh,nh->h", a, b), float)


def walk_sums(
    blocks: Blocks, found: list[Whitener], prior: Prior, x_m: FloatArray, y_m: FloatArray
) -> FloatArray:
    """Sums of all rows for each hypothesis and place, shape (7, c, h)."""
    distance_db = distances_db(blocks, prior.height_m, x_m, y_m)
    extra = receiver_variance(blocks, prior, distance_db)
    return np.stack([sums(w.matrix, blocks.level_dbm, distance_db, extra) for w in found], axis=1)


class _Fit(NamedTuple):
    """P0 and eta given sigma: means and covariance; 1 / determinant of A, b, and w = 1 / sigma^2;
    shape (c, h) each.
    """

    p0: FloatArray
    eta: FloatArray
    v00: FloatArray
    v01: FloatArray
    v11: FloatArray
    inverse: FloatArray
    b0: FloatArray
    b1: FloatArray
    w: FloatArray


def marginal(
    total: FloatArray,
    n: int,
    log_det: FloatArray,
    prior: Prior,
    nodes: int = NODES,
    near_db: FloatArray | None = None,
) -> Evidence:
    """Integrate P0, eta and sigma: from sums (7, c, h) over n rows and log |K| (c, 1).

    `near_db` (c, h) is a sigma that cannot be far off, as that of one reading less.
    """
    tau = _first_tau(total, n, prior) if near_db is None else np.log(near_db)
    for _ in range(min(_NEWTON_STEPS, nodes)):
        before = tau
        fit = _fit(total, prior, before)
        slope, curvature = _slopes(total, n, prior, before, fit)
        step = np.clip(slope / curvature, -0.5, 0.5)
        tau = np.maximum(before + step, log(_LEAST_SIGMA_DB))
    constant = 0.5 * (2.0 * total[6] - log_det - n * log(2.0 * pi))
    if nodes > 1:
        return _over_sigma(total, n, prior, tau, 1.0 / np.sqrt(curvature), constant, nodes)
    if (
        np.max(np.abs(step)) < _STEADY
    ):  # as after most live readings: the fit is as good there, log p by its slope
        log_p = _log_p(total, n, prior, before, fit) + 0.5 * slope * step
    else:
        fit = _fit(total, prior, tau)
        log_p = _log_p(total, n, prior, tau, fit)
    log_p += constant - 0.5 * np.log(curvature / (2.0 * pi))  # Laplace's method
    return Evidence(log_p, np.stack(fit[:2]), np.stack(fit[2:5]), np.exp(tau))


def _slopes(
    total: FloatArray, n: int, prior: Prior, tau: FloatArray, fit: _Fit
) -> tuple[FloatArray, FloatArray]:
    """First derivative of `_log_p` by tau, and its second with the sign changed, for many
    levels.
    """
    scaled, weight = fit.w * _residual(total, fit), 1.0 / prior.sigma_log_sd**2
    of_prior = prior.p0_sigma_db**-2 * fit.v00 + prior.eta_sigma**-2 * fit.v11
    return scaled - n + 2.0 - of_prior - weight * (tau - log(prior.sigma_db)), 2.0 * scaled + weight


def _first_tau(total: FloatArray, n: int, prior: Prior) -> FloatArray:
    """Where log sigma is sought first: that of the residuals of the prior's sigma, drawn towards
    the prior.
    """
    start, weight = np.full(total.shape[1:], log(prior.sigma_db)), 1.0 / prior.sigma_log_sd**2
    residual = np.maximum(_residual(total, _fit(total, prior, start)), n * _LEAST_SIGMA_DB**2)
    return np.asarray(
        (n * np.log(residual / max(n - 2, 1)) + weight * start) / (2.0 * n + weight), float
    )


def _fit(total: FloatArray, prior: Prior, tau: FloatArray) -> _Fit:
    """P0 and eta given sigma = exp(tau)."""
    oo, ol, ll, oz, lz, _, _ = total
    w = np.exp(-2.0 * tau)
    lam0, lam1 = prior.p0_sigma_db**-2, prior.eta_sigma**-2
    a00, a01, a11 = oo * w + lam0, ol * w, ll * w + lam1
    b0, b1 = oz * w + lam0 * prior.p0_dbm, lz * w + lam1 * prior.eta
    inverse = 1.0 / (a00 * a11 - a01 * a01)
    p0, eta = (a11 * b0 - a01 * b1) * inverse, (a00 * b1 - a01 * b0) * inverse
    return _Fit(p0, eta, a11 * inverse, -a01 * inverse, a00 * inverse, inverse, b0, b1, w)


def _residual(total: FloatArray, fit: _Fit) -> FloatArray:
    """Sum of squares of what a fit leaves."""
    oo, ol, ll, oz, lz, zz, _ = total
    p0, eta = fit.p0, fit.eta
    return np.asarray(
        zz - 2.0 * (p0 * oz + eta * lz) + p0 * p0 * oo + 2.0 * p0 * eta * ol + eta * eta * ll, float
    )


def _log_p(total: FloatArray, n: int, prior: Prior, tau: FloatArray, fit: _Fit) -> FloatArray:
    """Log probability density of levels and tau, P0 and eta integrated out."""
    lam0, lam1 = prior.p0_sigma_db**-2, prior.eta_sigma**-2
    misfit = total[5] * fit.w + lam0 * prior.p0_dbm**2 + lam1 * prior.eta**2
    misfit -= fit.b0 * fit.p0 + fit.b1 * fit.eta
    off = (tau - log(prior.sigma_db)) / prior.sigma_log_sd
    log_p = 0.5 * (np.log(lam0 * lam1 * fit.inverse) - misfit - off * off) - n * tau
    return np.asarray(log_p - log(prior.sigma_log_sd * sqrt(2.0 * pi)), float)


@cache
def _gauss_hermite(nodes: int) -> tuple[FloatArray, FloatArray]:
    at, weights = np.polynomial.hermite_e.hermegauss(nodes)
    return np.asarray(at, float), np.asarray(weights, float)


def _over_sigma(
    total: FloatArray,
    n: int,
    prior: Prior,
    tau: FloatArray,
    sd: FloatArray,
    constant: FloatArray,
    nodes: int,
) -> Evidence:
    at, weights = _gauss_hermite(nodes)
    taus = [tau + sd * u for u in at]
    fits = [_fit(total, prior, one) for one in taus]
    of_tau = [_log_p(total, n, prior, one, fit) for one, fit in zip(taus, fits, strict=True)]
    each = np.stack(of_tau) + (0.5 * at**2 + np.log(weights))[:, None, None]
    top = np.max(each, axis=0)
    share = np.exp(each - top)
    summed = np.sum(share, axis=0)
    share /= summed
    p0, eta, v00, v01, v11 = (np.stack([fit[i] for fit in fits]) for i in range(5))
    mean0, mean1 = np.sum(share * p0, axis=0), np.sum(share * eta, axis=0)
    d0, d1 = p0 - mean0, eta - mean1
    cov = [np.sum(share * v, axis=0) for v in (v00 + d0 * d0, v01 + d0 * d1, v11 + d1 * d1)]
    sigma = np.sum(share * np.exp(tau + sd * at[:, None, None]), axis=0)
    log_p = top + np.log(summed * sd) + constant
    return Evidence(log_p, np.stack([mean0, mean1]), np.stack(cov), sigma)
