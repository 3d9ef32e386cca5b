"""The direct test on a walk: residuals at the claimed position, without finding the position.

Residuals of a wrong claim are not any residuals: a displaced transmitter bends them in few ways.
With X0 = [1, -L(c)] the model of the claim c and B (n, q) the strongest directions in which places
around it differ from the span of X0,

    F = S_B / (q s^2)  ~  F(q, n - 2 - q, delta)
    e = (eta^ - eta0) / sqrt(eta_sigma^2 + var eta^)  ~  N(0, 1)

S_B is the weighted sum of squares that B takes off the residuals of X0, s^2 what neither explains
by its n - 2 - q degrees of freedom; weights are by the full covariance of a hypothesis of the
noise, with the uncertainty of the claim and of the receiver in it. So P0 is integrated out with a
flat prior, eta with its normal one, and sigma need not be known. An exponent that cannot be speaks
against a claim too: 95 % of the false alarms are spent on F, 5 % on e. Hypotheses are weighed by
their restricted likelihood off [X0, B] (Patterson & Thompson, Biometrika 58(3), 1971), which a
displacement does not touch. p is that of the likeliest where the noise is stationary; of a measured
walk it is the mean over all, F and e^2 counting with the trust of their hypothesis. Taken as it is
p is too small: the longer shadowing lasts the more often it is taken for shorter. Walks drawn from
the claim (`drawn`) make it right.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from logger.core.arrays import FloatArray
from logger.core.model.blocks import Blocks
from logger.core.model.columns import distances_db, receiver_variance, varying_columns
from logger.core.model.noise import inverse_of_lower
from logger.core.model.prior import Prior
from logger.core.places import Places

_ENERGY = 0.95
_MOST_DIRECTIONS = 5
_SHARES = (0.3, 1.0, 3.0, 9.0)
_BEARINGS = 12
_FEWEST_FREE = 8
_LEAST_SLOPE = 1e-6
_SPENT_ON_ETA = 0.05


@dataclass(frozen=True)
class DirectTest:
    """The test of one claim, ready for any levels of the walk.

    `bent` (n, q) is B. For each hypothesis c: `whiten` (c, n, n), `basis` (c, 2 + q, n) the
    orthonormal rows of 1,
    -L(c) and B times `whiten`, `slope` (c,) the size of the second of them per unit of eta,
    `log_weight` (c,), and `trust` (c,).
    """

    bent: FloatArray
    free: int
    whiten: FloatArray
    basis: FloatArray
    slope: FloatArray
    log_weight: FloatArray
    trust: FloatArray
    prior: Prior

    def p_values(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """Probability (b,) of statistics as large as those of levels (n, b) under a true claim.

        `trusting` the noise to be stationary, by the likeliest hypothesis; else all of them, each
        with its own trust.
        """
        ratio, odd, weight = self._statistic(level_dbm)
        if trusting:
            likeliest = np.argmax(weight, axis=0)[None]
            return self._p(*(np.take_along_axis(v, likeliest, axis=0)[0] for v in (ratio, odd)))
        trust = self.trust[:, None]
        return np.asarray(np.sum(weight * self._p(trust * ratio, trust * odd), axis=0), float)

    def _p(self, ratio: FloatArray, odd: FloatArray) -> FloatArray:
        of_bend = fdtrc(self.bent.shape[1], self.free, ratio) / (1.0 - _SPENT_ON_ETA)
        of_eta = chdtrc(1, odd) / _SPENT_ON_ETA
        return np.asarray(np.minimum(np.minimum(of_bend, of_eta), 1.0), float)

    def residuals(self, level_dbm: FloatArray) -> FloatArray:
        """Residuals (n,) of levels (n,) at the claim, whitened by the likeliest hypothesis."""
        best = int(np.argmax(self._statistic(level_dbm[:, None])[2][:, 0]))
        rows = np.linalg.solve(self.whiten[best].T, self.basis[best, :2].T).T
        white = self.whiten[best] @ level_dbm
        return np.asarray(white - rows.T @ (rows @ white), float)

    def _statistic(self, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """F, e^2 and weight of each hypothesis, shape (c, b)."""
        taken = self.basis @ level_dbm
        left = np.sum((self.whiten @ level_dbm) ** 2, axis=1) - np.sum(taken**2, axis=1)
        left = np.maximum(left, 1e-9)
        variance = left / self.free
        eta, spread = taken[:, 1] / self.slope[:, None], variance / self.slope[:, None] ** 2
        off = (eta - self.prior.eta) ** 2 / (self.prior.eta_sigma**2 + spread)
        log_weight = self.log_weight[:, None] - 0.5 * self.free * np.log(left)
        weight = np.exp(log_weight - np.max(log_weight, axis=0))
        return (
            np.sum(taken[:, 2:] ** 2, axis=1) / (variance * self.bent.shape[1]),
            off,
            weight / np.sum(weight, axis=0),
        )


def direct_test(
    blocks: Blocks, prior: Prior, k: FloatArray, claim: FloatArray, sigma_db: float
) -> DirectTest | None:
    """Prepare the test of a claim of equally likely positions (2, m).

    None for a walk of too few blocks.

    `k` (c, n, n) is the covariance by each hypothesis in units of sigma^2, `sigma_db` the noise by
    which the uncertainty of claim and receiver is weighed.
    """
    n = len(blocks)
    possible = distances_db(blocks, prior.height_m, Places.of(claim[0], claim[1]))
    claim_db = np.mean(possible, axis=1)
    bent = _directions(blocks, prior, claim, claim_db)
    free = n - 2 - bent.shape[1]
    if free < _FEWEST_FREE:
        return None
    own = prior.eta**2 * np.cov(possible, bias=True) if claim.shape[1] > 1 else np.zeros((n, n))
    extra = receiver_variance(blocks, prior, claim_db[:, None])
    if prior.antenna_db:
        own = own + _antenna_covariance(blocks, prior, claim)
    more = own / sigma_db**2 + (np.diag(extra[:, 0]) if extra is not None else 0.0)
    design = np.column_stack([np.ones(n), -claim_db, bent])
    root = np.asarray(np.linalg.cholesky(k + more), float)
    whiten = inverse_of_lower(root)
    rows, triangle = np.linalg.qr(whiten @ design)
    size = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
    log_det = np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1) + np.sum(
        np.log(np.maximum(size, 1e-9)), axis=1
    )
    slope = triangle[:, 1, 1]
    slope = np.where(np.abs(slope) < _LEAST_SLOPE, _LEAST_SLOPE, slope)
    return DirectTest(
        bent,
        free,
        whiten,
        np.swapaxes(rows, 1, 2) @ whiten,
        slope,
        prior.noise_table.log_odds - log_det,
        prior.noise_table.trust,
        prior,
    )


def _antenna_covariance(blocks: Blocks, prior: Prior, claim: FloatArray) -> FloatArray:
    """Covariance (n, n) in dB^2 of the levels by an unknown antenna pattern at the claim (2, m)."""
    _, *harmonics = varying_columns(blocks, prior, Places.of(*np.mean(claim, axis=1)))
    pattern = np.concatenate(harmonics, axis=1) * np.repeat(prior.antenna_db, 2)
    return np.asarray(pattern @ pattern.T, float)


def _directions(
    blocks: Blocks, prior: Prior, claim: FloatArray, claim_db: FloatArray
) -> FloatArray:
    """Orthonormal directions (n, q) in which displacements of the transmitter change the levels."""
    middle = np.mean(claim, axis=1)
    away_m = max(float(np.min(blocks.places.distances_m(Places.of(*middle)))), 2.0 * blocks.size_m)
    angle = 2.0 * np.pi * np.arange(_BEARINGS) / _BEARINGS
    radius = away_m * np.array(_SHARES)[:, None]
    x, y = ((middle[i] + radius * f(angle)).ravel() for i, f in enumerate((np.cos, np.sin)))
    shift = distances_db(blocks, prior.height_m, Places.of(x, y)) - claim_db[:, None]
    known = np.linalg.qr(np.column_stack([np.ones(len(blocks)), claim_db]))[0]
    shift -= known @ (known.T @ shift)
    shift /= np.maximum(np.linalg.norm(shift, axis=0), 1e-9)
    left, size, _ = np.linalg.svd(shift, full_matrices=False)
    held = np.cumsum(size**2) / np.sum(size**2)
    return np.asarray(
        left[:, : min(int(np.searchsorted(held, _ENERGY)) + 1, _MOST_DIRECTIONS)], float
    )
