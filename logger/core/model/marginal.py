"""The one marginaliser: linear coefficients and sigma integrated out of the evidence.

With whitened columns X = W [columns], z = W levels, weights of rows w, s2 = sigma^2 and the prior
N(m0, Lambda0^-1) of the coefficients, all that a position needs are the sums X'wX, X'wz and z'wz:

    A = X'wX / s2 + Lambda0,    b = X'wz / s2 + Lambda0 m0
    log p(z | x, y, sigma) = -n/2 log 2pi - n log sigma - 1/2 log|K| + 1/2 log|w|
                             + 1/2 log|Lambda0| - 1/2 log|A|
                             - 1/2 (z'wz / s2 + m0' Lambda0 m0 - b' A^-1 b)

Sums are packed lower triangles with z as row 0 (see `elimination`), then one row more, the log
weight of all rows. log sigma is integrated by Gauss-Hermite nodes about its mode (Naylor & Smith,
Appl. Statist. 31(3), 1982), or by Laplace's method.
"""

from functools import cache, cached_property, lru_cache
from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.model.blocks import Blocks
from logger.core.model.columns import receiver_variance, varying_columns
from logger.core.model.elimination import (
    eliminate,
    inverse,
    log_determinant,
    packed_index,
    side,
    solution,
)
from logger.core.model.evidence import PAIRS, Evidence
from logger.core.model.prior import Prior
from logger.core.places import Places

NODES = 7
"""Gauss-Hermite nodes for log sigma."""

_NEWTON_STEPS = 2  # from a start that is close: the third changes the mode by less than 1e-3
_LARGEST_STEP = 0.5  # of log sigma, so that Newton's method does not leave the region it describes
_LEAST_SIGMA_DB = 0.05
"""Below it, as where all levels are equal, residuals are rounding errors."""
_SMALL_STEP = 0.05  # of log sigma: log p changes by its slope, within 1e-3 nats
_AT_ONCE = 16  # weights multiplied before their logarithm is taken: each is above 1e-19
_STRIP = 64  # rows of a whitener multiplied at once
_IN_CACHE = 65_536  # entries of a whitened column, of all hypotheses: half a megabyte


class Fit:
    """Coefficients given sigma, from an eliminated system (m, c, h)."""

    def __init__(self, system: FloatArray) -> None:
        self._system = system
        self._covariance: FloatArray | None = None

    @cached_property
    def theta(self) -> FloatArray:
        """Means of all coefficients, shape (q, c, h)."""
        return solution(self._system, side(self._system) - 1)

    def covariance(self, count: int) -> FloatArray:
        """Covariance of the first `count` coefficients, shape (count, count, c, h)."""
        if self._covariance is None or len(self._covariance) < count:
            self._covariance = inverse(self._system, count)
        return self._covariance[:count, :count]

    @property
    def log_det(self) -> FloatArray:
        """Log |A|, shape (c, h)."""
        return log_determinant(self._system)

    @property
    def misfit(self) -> FloatArray:
        """Z'wz / s2 + m0' Lambda0 m0 - b' A^-1 b, shape (c, h)."""
        return np.asarray(self._system[0], float)


def walk_sums(
    blocks: Blocks,
    matrices: FloatArray,
    prior: Prior,
    positions: Places,
    columns: list[FloatArray] | None = None,
) -> FloatArray:
    """Sums over all blocks for each hypothesis and position (h,), shape (m + 1, c, h).

    `matrices` (c, n, n) are the whiteners of the hypotheses, `columns` those that vary, if known.
    """
    columns = columns or varying_columns(blocks, prior, positions)
    extra = receiver_variance(blocks, prior, -columns[0])
    fixed = np.stack([blocks.level_dbm, np.ones(len(blocks))])
    at_once = max(_IN_CACHE // (max(len(matrices), 1) * len(blocks)), 1)
    parts = []
    for first in range(0, len(positions), at_once):
        some = slice(first, first + at_once)
        of_some = None if extra is None else extra[:, some]
        parts.append(sums(matrices, fixed, [column[:, some] for column in columns], of_some))
    return np.concatenate(parts, axis=-1)


class SharedSums(NamedTuple):
    """Which sums of the first station of a prior are part of another's.

    A station with a pattern, as high as a first one without, has all sums of that one under the
    hypotheses `rows` that it is possible under; `rest` are the others. `patterned` is its number, 0
    where there is none.
    """

    patterned: int
    rows: IntArray
    rest: IntArray

    @classmethod
    def of(cls, prior: Prior, is_possible: BoolArray) -> "SharedSums":
        """`is_possible` (s, c): whether each station is, under some hypotheses."""
        first = prior.stations[0]
        for k, one in enumerate(prior.stations):
            if one.antenna_db and not first.antenna_db and one.height_m == first.height_m:
                return cls(k, np.flatnonzero(is_possible[k]), np.flatnonzero(~is_possible[k]))
        return cls(0, np.array([], np.int64), np.arange(is_possible.shape[1]))

    def join(self, of_rest: FloatArray, of_patterned: FloatArray) -> FloatArray:
        """Sums (m + 1, c, h) of the first station; the harmonics come last in packed sums."""
        count = packed_index(3, 0)  # levels, P0 and eta
        total = np.empty((count + 1, len(self.rows) + len(self.rest), of_rest.shape[-1]))
        total[:, self.rest] = of_rest
        total[:count, self.rows], total[-1, self.rows] = of_patterned[:count], of_patterned[-1]
        return total


def sums(
    whitener: FloatArray,
    fixed: FloatArray,
    varying: list[FloatArray],
    extra: FloatArray | None,
) -> FloatArray:
    """Sums for W (..., n, n), of one hypothesis or of several, shape (m + 1, ..., h).

    `fixed` (f, n) are the levels and the columns that are the same for all positions, `varying` the
    others, (n, h) each. A row of W with diagonal d predicts its block with variance 1 / d^2; an
    independent `extra` variance (n, h) of the block gives it the weight 1 / (1 + d^2 extra).
    """
    weight = None if extra is None else row_weights(whitener, extra)
    of_fixed = fixed @ np.swapaxes(whitener, -1, -2)
    return products(of_fixed, [whiten(whitener, v) for v in varying], weight)


def products(fixed: FloatArray, varying: list[FloatArray], weight: FloatArray | None) -> FloatArray:
    """Sums over whitened rows, shape (m + 1, ..., h).

    `fixed` has shape (..., f, n), `varying` and `weight` have (..., n, h).
    """
    i, j = _lower_triangle(fixed.shape[-2])
    pairs = fixed[..., i, :] * fixed[..., j, :]
    if weight is None:
        h = varying[0].shape[-1]
        rows = [np.repeat(np.sum(pairs, axis=-1)[..., None], h, axis=-1)]
        weighted, log_weight = varying, np.zeros((*pairs.shape[:-2], 1, h))
    else:
        rows = [pairs @ weight]
        weighted = [weight * column for column in varying]
        log_weight = 0.5 * _log_of_product(weight)
    for k, column in enumerate(weighted):
        rows.append(fixed @ column)
        rows += [
            np.einsum("...nh,...nh->...h", column, other)[..., None, :]
            for other in varying[: k + 1]
        ]
    return np.moveaxis(np.concatenate([*rows, log_weight], axis=-2), -2, 0)


def _log_of_product(weight: FloatArray) -> FloatArray:
    """Log of the products of (..., n, h) over the rows, (..., 1, h), without underflow."""
    first = range(0, weight.shape[-2], _AT_ONCE)
    parts = [np.prod(weight[..., i : i + _AT_ONCE, :], axis=-2, keepdims=True) for i in first]
    return np.asarray(sum(map(np.log, parts)), float)


@cache
def _lower_triangle(count: int) -> tuple[IntArray, IntArray]:
    i, j = np.tril_indices(count)
    return i, j


def row_weights(whitener: FloatArray, extra: FloatArray) -> FloatArray:
    """Weights (..., n, h) of rows of W (..., n, n), blocks having `extra` variance (n, h)."""
    diagonal = np.diagonal(whitener, axis1=-2, axis2=-1)
    weight = np.asarray(diagonal[..., None] ** 2 * extra, float)
    weight += 1.0
    np.reciprocal(weight, out=weight)
    return weight


def whiten(whitener: FloatArray, column: FloatArray) -> FloatArray:
    """W (..., n, n) times a column (n, h), in strips: right of the diagonal W is zero."""
    product = np.empty((*whitener.shape[:-1], column.shape[1]))
    for i in range(0, len(column), _STRIP):
        end = i + _STRIP
        np.matmul(whitener[..., i:end, :end], column[:end], out=product[..., i:end, :])
    return product


def prior_sums(mean: FloatArray, precision: FloatArray) -> FloatArray:
    """Packed sums (m, ...) that a normal prior adds: mean (q,), inverse covariance (q, q, ...)."""
    q = len(mean)
    matrix = np.zeros((q + 1, q + 1, *precision.shape[2:]))
    matrix[1:, 1:] = precision
    matrix[1:, 0] = np.einsum("ij...,j->i...", precision, mean)
    matrix[0, 0] = np.einsum("i,i...->...", mean, matrix[1:, 0])
    return matrix[np.tril_indices(q + 1)]


def fit(total: FloatArray, of_prior: FloatArray, log_sigma: FloatArray) -> Fit:
    """Coefficients given sigma, from sums (m + 1, c, h) and the `prior_sums` prior (m, ...)."""
    system = total[:-1] * np.exp(-2.0 * log_sigma)
    system += of_prior
    eliminate(system)
    return Fit(system)


def marginal(
    total: FloatArray,
    n: int,
    log_det: FloatArray,
    prior: Prior,
    nodes: int = NODES,
    near_db: FloatArray | None = None,
) -> Evidence:
    """Integrate coefficients and sigma: from sums (m + 1, c, h) of n rows and log |K| (c, 1).

    `near_db` (c, h) is a sigma that cannot be far off, as that of one reading less. One node stands
    for Laplace's method.
    """
    law = SigmaLaw(total, n, prior)
    tau = law.first_log_sigma() if near_db is None else np.log(near_db)
    for _ in range(min(_NEWTON_STEPS, nodes)):
        before, given = tau, law.fit(tau)
        slope, curvature = law.slopes(tau, given)
        step = np.clip(slope / curvature, -_LARGEST_STEP, _LARGEST_STEP)
        tau = np.maximum(tau + step, log(_LEAST_SIGMA_DB))
    constant = 0.5 * (2.0 * total[-1] - log_det - n * log(2.0 * pi))
    if nodes > 1:
        return _over_nodes(law, tau, 1.0 / np.sqrt(curvature), constant, nodes)
    if np.max(np.abs(step)) < _SMALL_STEP:  # as after most live readings: the last fit is as good
        log_p = law.log_p(before, given) + 0.5 * slope * step
    else:
        given = law.fit(tau)
        log_p = law.log_p(tau, given)
    log_p += constant - 0.5 * np.log(curvature / (2.0 * pi))
    covariance = given.covariance(2)
    spread = np.stack([covariance[i, j] for i, j in PAIRS])
    return Evidence(log_p, given.theta, spread, np.exp(tau), np.ones((1, *log_p.shape)))


class SigmaLaw:
    """Log density of levels and log sigma, the coefficients integrated out."""

    def __init__(self, total: FloatArray, n: int, prior: Prior) -> None:
        self._total, self._n, self._prior = total, n, prior
        self._mean, self._precision = (of_one[:, None, None] for of_one in prior.coefficients)
        self._of_prior = _sums_of(prior)
        self._log_det = float(np.sum(np.log(prior.coefficients.precision)))
        self._weight = 1.0 / prior.sigma_log_sd**2

    def fit(self, tau: FloatArray) -> Fit:
        """Coefficients given sigma = exp(tau)."""
        return fit(self._total, self._of_prior, tau)

    def log_p(self, tau: FloatArray, given: Fit) -> FloatArray:
        """Log density; `given` belongs to the same tau."""
        prior = self._prior
        off = (tau - log(prior.sigma_db)) / prior.sigma_log_sd
        log_p = 0.5 * (self._log_det - given.log_det - given.misfit - off * off) - self._n * tau
        return np.asarray(log_p - log(prior.sigma_log_sd * sqrt(2.0 * pi)), float)

    def residual(self, given: Fit) -> FloatArray:
        """Weighted sum of squares of what the fit leaves of the levels, by sigma^2."""
        off = given.theta - self._mean
        return np.asarray(given.misfit - np.sum(self._precision * off * off, axis=0), float)

    def slopes(self, tau: FloatArray, given: Fit) -> tuple[FloatArray, FloatArray]:
        """Derivative of `log_p` by tau, and minus the second one, for many levels."""
        residual, q = self.residual(given), len(self._precision)
        covariance = given.covariance(q)
        of_prior = sum(self._precision[i] * covariance[i, i] for i in range(q))
        slope = residual - self._n + q - of_prior
        slope -= self._weight * (tau - log(self._prior.sigma_db))
        return slope, 2.0 * residual + self._weight

    def first_log_sigma(self) -> FloatArray:
        """Log sigma of the residuals at the prior's sigma, shrunk towards the prior."""
        n, sigma_db, q = self._n, self._prior.sigma_db, len(self._precision)
        start = np.full(self._total.shape[1:], log(sigma_db))
        residual = sigma_db**2 * self.residual(self.fit(start))
        variance = np.maximum(residual, n * _LEAST_SIGMA_DB**2) / max(n - q, 1)
        pulled = n * np.log(variance) + self._weight * start
        return np.asarray(pulled / (2.0 * n + self._weight), float)


@lru_cache(maxsize=16)  # needed after each live reading
def _sums_of(prior: Prior) -> FloatArray:
    """`prior_sums` of a prior, shape (m, 1, 1)."""
    mean, precision = prior.coefficients
    return prior_sums(mean, np.diag(precision))[:, None, None]


@cache
def _gauss_hermite(nodes: int) -> tuple[FloatArray, FloatArray]:
    at, weights = np.polynomial.hermite_e.hermegauss(nodes)
    return np.asarray(at, float), np.asarray(weights, float)


def _over_nodes(
    law: SigmaLaw, tau: FloatArray, sd: FloatArray, constant: FloatArray, nodes: int
) -> Evidence:
    at, weights = _gauss_hermite(nodes)
    taus = tau + sd * at[:, None, None]
    each = [law.fit(one) for one in taus]
    log_p = np.stack([law.log_p(*pair) for pair in zip(taus, each, strict=True)])
    log_p += (0.5 * at**2 + np.log(weights))[:, None, None]
    top = np.max(log_p, axis=0)
    share = np.exp(log_p - top)
    total = np.sum(share, axis=0)
    share /= total
    theta = [one.theta for one in each]
    mean = sum(weight * one for weight, one in zip(share, theta, strict=True))
    spread = np.zeros((3, *tau.shape))
    for weight, given, at_node in zip(share, each, theta, strict=True):
        covariance, off = given.covariance(2), at_node[:2] - mean[:2]
        for k, (i, j) in enumerate(PAIRS):
            spread[k] += weight * (covariance[i, j] + off[i] * off[j])
    sigma_db = np.sum(share * np.exp(taus), axis=0)
    log_p = top + np.log(total * sd) + constant
    return Evidence(log_p, mean, spread, sigma_db, np.ones((1, *log_p.shape)))
