"""Censored readings: the level is beyond a limit of the modem's scale, by an unknown amount.

A level known only to be at most c has the likelihood Phi((c - mu) / s) (Tobin, Econometrica 26(1),
1958; for localisation Gustafson et al., arXiv 1504.03977). It is taken given the levels z. With W
the whitener of the blocks, K_c the covariance of censored points and blocks, gain G = K_c W'W, and
H the columns of the model (H_c those at censored points):

    level at c | z, theta, sigma ~ N(H_c theta + G (z - H theta), sigma^2 (K_cc - G K_c'))

The product of these terms and the density of z is integrated over the coefficients theta and log
sigma together by Laplace's method: near the floor the levels received are the high ones, and alone
they suggest too small a sigma.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.orthant import log_cdf_and_slope
from logger.core.model.blocks import Blocks, Censored
from logger.core.model.columns import censored_columns, varying_columns
from logger.core.model.elimination import (
    eliminate,
    inverse,
    log_determinant,
    packed_index,
    side,
    solution,
)
from logger.core.model.evidence import Evidence
from logger.core.model.marginal import marginal
from logger.core.model.noise import Whitener, independent_variance, shadowing
from logger.core.model.prior import Hypothesis, Prior
from logger.core.places import Places

_NEWTON_STEPS = 12
_LARGEST_STEP = 0.4  # of log sigma
_SHORTER = 0.25  # of a step that does not lead up
_SMALL_GAIN_NATS = 1e-2  # expected of the next step: far below what decides between positions
_COLUMNS = 512  # at once: these matrices stay in the cache
_LEAST_SHARE = 0.2
"""Of the curvature in log sigma that must remain once the coefficients are eliminated."""
_HALF_STEP_DB = 0.5  # levels are rounded to 1 dB


_Single = npt.NDArray[np.float32]


class Conditional(NamedTuple):
    """Levels at censored points given those of the blocks, under one hypothesis.

    `gain` (g, n) is G, `predicted_dbm` (g,) is G z, `sd` (g,) the standard deviation of a level in
    units of sigma, `effective_readings` (g,) the number of independent readings with as much
    information.
    """

    gain: FloatArray
    predicted_dbm: FloatArray
    sd: FloatArray
    effective_readings: FloatArray


def conditional_levels(blocks: Blocks, noise: Whitener, hypothesis: Hypothesis) -> Conditional:
    """Distribution of the levels at the censored points of some blocks, given theirs."""
    gone = blocks.censored
    known = noise.matrix @ shadowing_in_blocks(blocks, hypothesis).T
    left = shadowing_between(gone, hypothesis, gone.places) - known.T @ known
    gain = known.T @ noise.matrix
    sd = np.sqrt(np.maximum(np.diagonal(left), 0.0) + hypothesis.white_share)
    effective = effective_readings(left, sd, hypothesis.white_share, gone.readings)
    return Conditional(gain, gain @ blocks.level_dbm, sd, effective)


def shadowing_between(gone: Censored, hypothesis: Hypothesis, places: Places) -> FloatArray:
    """Covariance (g, n), in units of sigma^2, of the shadowing at censored and other points."""
    return shadowing(gone.places.distances_m(places), hypothesis)


def shadowing_in_blocks(blocks: Blocks, hypothesis: Hypothesis) -> FloatArray:
    """The same with the means over the points of the blocks, shape (g, n)."""
    of_points = shadowing_between(blocks.censored, hypothesis, blocks.points)
    return blocks.mean(of_points.T).T


def effective_readings(
    left: FloatArray, sd: FloatArray, white_share: float, readings: FloatArray
) -> FloatArray:
    """Number of independent readings that those of each point are worth, shape (g,).

    Correlated shadowing, of which `left` (g, g) is unknown, hides several points at once: together
    they count as the 1' K^-1 1 of a common mean.
    """
    k = left + np.diag(independent_variance(readings, white_share, np.inf))
    k /= sd[:, None] * sd
    each = 1.0 / np.diagonal(k)
    together = float(np.sum(np.linalg.solve(k, np.ones(len(k)))))
    return np.asarray(each * min(together / float(np.sum(each)), 1.0), float)


def beyond_dbm(gone: Censored) -> FloatArray:
    """What the level was beyond, shape (g,): levels within half a step are rounded to the limit."""
    return np.asarray(gone.limit_dbm - _HALF_STEP_DB * gone.side, float)


def tobit_evidence(
    total: FloatArray,
    log_det: FloatArray,
    blocks: Blocks,
    conditional: list[Conditional],
    prior: Prior,
    positions: Places,
    near: Evidence | None = None,
    varying: list[FloatArray] | None = None,
) -> Evidence:
    """As `marginal`, of levels and censored readings, with one of `conditional` per hypothesis.

    The search for the mode begins at that of `near`, the evidence at positions nearby, else at that
    of the hypothesis before, and for the first one at that of the levels alone. `varying` are the
    columns of the blocks, if known.
    """
    censored = censored_columns(blocks.censored, prior, positions)
    varying = varying or varying_columns(blocks, prior, positions)
    at_once, parts = max(_COLUMNS // len(positions), 1), []
    before = near or marginal(total[:, :1], len(blocks), log_det[:1], prior, 1)
    begin = np.zeros((2 + len(varying), *before.sigma_db.shape))  # several stations: no pattern
    begin[0], begin[1 : 1 + len(before.theta)] = np.log(before.sigma_db), before.theta
    for i in range(0, len(conditional), at_once):
        some = slice(i, i + at_once)
        terms = _terms(blocks.censored, conditional[some], censored, varying)
        of_some = total[:, some]
        at = begin[:, some] if near else np.repeat(begin[:, -1:], of_some.shape[1], axis=1)
        flat, shape = at.reshape(len(at), -1), at.shape
        parts.append(_laplace(of_some.reshape(len(total), -1), flat, len(blocks), terms, prior))
        if near is None:
            begin = parts[-1][1].reshape(shape)
    log_p, mode, covariance = (np.concatenate(v, axis=-1) for v in zip(*parts, strict=True))
    mode = mode.reshape(len(mode), *total.shape[1:])
    constant = -0.5 * (log_det + len(blocks) * np.log(2.0 * np.pi))
    return Evidence(
        log_p.reshape(mode.shape[1:]) + constant,
        mode[1:],
        covariance.reshape(3, *mode.shape[1:]),
        np.exp(mode[0]),
        np.ones((1, *mode.shape[1:])),
    )


class _Terms(NamedTuple):
    """Censored terms, effective_readings * log Phi((columns . theta + of_one) / sigma).

    `columns` has shape (q, g, k), the others (g, k): k runs over the positions of each hypothesis
    in turn. Single precision is enough: `log_cdf_and_slope` is no more exact.
    """

    columns: _Single
    of_one: _Single
    effective_readings: _Single

    def part(self, some: IntArray) -> "_Terms":
        """Those of some k."""
        return _Terms(*(values[..., some] for values in self))


def _terms(
    gone: Censored,
    conditional: list[Conditional],
    censored: list[FloatArray],
    varying: list[FloatArray],
) -> _Terms:
    parts = [_of_hypothesis(gone, one, censored, varying) for one in conditional]
    return _Terms(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))


def _of_hypothesis(
    gone: Censored,
    conditional: Conditional,
    censored: list[FloatArray],
    varying: list[FloatArray],
) -> _Terms:
    gain, predicted_dbm, sd, effective = conditional
    sign = (gone.side / sd)[:, None]
    shape = censored[0].shape
    columns = np.empty((1 + len(censored), *shape))
    columns[0] = (1.0 - np.sum(gain, axis=1))[:, None]
    columns[1:] = censored
    if np.any(gain):
        columns[1:] -= gain @ np.stack(varying)
    columns *= sign
    of_one = sign * (predicted_dbm - beyond_dbm(gone))[:, None]
    one, weight = np.broadcast_to(of_one, shape), np.broadcast_to(effective[:, None], shape)
    return _Terms(*(values.astype(np.float32) for values in (columns, one, weight)))


def _laplace(
    total: FloatArray, begin: FloatArray, n: int, terms: _Terms, prior: Prior
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log evidence (k,), mode (q + 1, k) and covariance of P0 and eta (3, k) by Newton's method.

    `begin` (q + 1, k) has log sigma, then the coefficients. A step that does not lead up is
    shortened.
    """
    at, length, active = begin, np.ones(begin.shape[1]), np.arange(begin.shape[1])
    surface = _surface(total, n, terms, prior, at)
    for _ in range(_NEWTON_STEPS):
        step, gain = _newton_step(surface[:, active])
        moving = length[active] * gain > _SMALL_GAIN_NATS
        active = active[moving]
        if not len(active):
            break
        there = at[:, active] + length[active] * step[:, moving]
        tried = _surface(total[:, active], n, terms.part(active), prior, there)
        up = tried[0] >= surface[0, active]
        at[:, active[up]], surface[:, active[up]] = there[:, up], tried[:, up]
        length[active] = np.where(up, 1.0, _SHORTER * length[active])
    system = _newton_system(surface)
    covariance = inverse(system, 3)[[1, 2, 2], [1, 1, 2]]
    return surface[0] - 0.5 * log_determinant(system), at, covariance


def _newton_step(surface: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Step (q + 1, k), and twice the gain expected of it (k,)."""
    unknowns = side(surface) - 1
    step = solution(_newton_system(surface), unknowns)
    gradient = surface[[packed_index(i + 1, 0) for i in range(unknowns)]]
    return step, np.asarray(np.sum(step * gradient, axis=0), float)


def _newton_system(surface: FloatArray) -> FloatArray:
    """The coefficients are eliminated and the step of log sigma is bounded."""
    system = surface.copy()
    eliminate(system, first=2)
    gradient, curvature = packed_index(1, 0), packed_index(1, 1)
    system[curvature] = np.maximum(system[curvature], _LEAST_SHARE * surface[curvature])
    of_log_sigma = system[gradient] / system[curvature]
    system[gradient] = np.clip(of_log_sigma, -_LARGEST_STEP, _LARGEST_STEP)
    return system


def _surface(total: FloatArray, n: int, terms: _Terms, prior: Prior, at: FloatArray) -> FloatArray:
    """Log density at `at` (q + 1, k) with its gradient and negative Hessian, packed (m, k).

    Row 0 holds the log density, then follow the gradient by log sigma and the coefficients, and the
    negative second derivatives.
    """
    tau, theta = at[0], at[1:]
    columns, of_one, effective = terms
    mean, precision = (values[:, None] for values in prior.coefficients)
    off, precision_tau = theta - mean, prior.sigma_log_sd**-2
    off_tau = tau - np.log(prior.sigma_db)
    q, inverse_sigma = len(theta), np.exp(-tau)
    w = inverse_sigma * inverse_sigma

    # the levels: residuals projected on each column, and their sum of squares, by sigma^2
    pull = total[[packed_index(i + 1, 0) for i in range(q)]]
    of_levels = w * (pull - np.einsum("ijk,jk->ik", _square(total, q), theta))
    residual = w * (total[0] - np.sum(pull * theta, axis=0)) - np.sum(theta * of_levels, axis=0)
    residual = np.maximum(residual, 0.0)

    # the censored terms: derivatives of log Phi(u) by u, and of u by the unknowns
    u = np.einsum("igk,ik->gk", columns, theta.astype(np.float32))
    u += of_one
    u *= inverse_sigma.astype(np.float32)
    log_phi, slope = log_cdf_and_slope(u)
    first = effective * slope
    second = first * (slope + u)
    mixed = second * u - first

    log_p = total[-1] - n * tau + 0.5 * np.sum(np.log(precision)) + _dot(effective, log_phi)
    log_p += 0.5 * np.log(precision_tau)
    log_p -= 0.5 * (residual + np.sum(precision * off * off, axis=0) + precision_tau * off_tau**2)
    gradient_tau = residual - n - precision_tau * off_tau - _dot(first, u)
    curvature_tau = 2.0 * residual + precision_tau + _dot(mixed, u)
    rows = [log_p, gradient_tau, np.maximum(curvature_tau, 0.5 * precision_tau)]
    for i, column in enumerate(columns):
        rows.append(of_levels[i] - precision[i] * off[i] + inverse_sigma * _dot(first, column))
        rows.append(2.0 * of_levels[i] - inverse_sigma * _dot(mixed, column))
        bent = second * column
        rows += [
            w * (total[packed_index(i + 1, j + 1)] + _dot(bent, columns[j])) for j in range(i + 1)
        ]
        rows[-1] += precision[i]
    return np.stack(rows)


def _square(total: FloatArray, q: int) -> FloatArray:
    """X'wX of packed sums, shape (q, q, k)."""
    return total[
        [[packed_index(max(i, j), min(i, j)) for j in range(1, q + 1)] for i in range(1, q + 1)]
    ]


def _dot(a: _Single, b: _Single) -> FloatArray:
    return np.asarray(np.einsum("gk,gk->k", a, b), float)
