"""Which hypothesis of the noise explains levels and censored readings together.

Near the floor only high levels are received, which by themselves look like less and like correlated
noise. Levels z and censored readings are therefore compared with one Gaussian: the evidence of the
levels times the probability that the others, given these, are beyond the limits. With W the
whitener of the blocks, H the columns of the model, H_c and K_c those at censored points, and
G = K_c W'W:

    theta | z ~ N(m, V),  V^-1 = (W H)'(W H) / s2 + Lambda0
    level at c | z ~ N(G z + D m, s2 (K_cc - G K_c') + D V D'),  D = H_c - G H

That is too much work for every position; it is done at a few, and the evidence integrated over
positions by importance sampling from what `tobit` makes of them, with the balance heuristic (Veach
& Guibas, SIGGRAPH 1995).
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.orthant import Sites, log_all_positive
from logger.core.locator.tobit import beyond_dbm, shadowing_between, shadowing_in_blocks
from logger.core.model.blocks import READINGS_BELIEVED, Blocks
from logger.core.model.columns import censored_columns, varying_columns
from logger.core.model.marginal import SigmaLaw, sums
from logger.core.model.noise import Whitener, shadowing, whiteners
from logger.core.model.prior import Hypothesis, Prior
from logger.core.places import Places

_STEP = 0.25  # of log sigma: a parabola through three such points has its top within 1 %
_MOST_STEPS = 8  # of log sigma: a factor of 7
_LEAST_CURVATURE = 1.0  # of one reading, about
_SAMPLED_FROM = 2  # likeliest hypotheses
_HOPELESS_NATS = 12.0  # less likely than the best: no longer compared
_SAMPLED_MASS = 0.9999
_LEAST_SHADOWED = 1e-9  # share of sigma^2: white noise has none to divide by
_MEAN_APART = 1.0 / 3.0  # of two readings of a square, by its side: a way straight across


class Joint:
    """Levels and censored readings under one hypothesis, evaluated at one position after another.

    The search for `sigma_db` and the expectation propagation (`sites`) begin at those of the last
    position, so nearby positions cost least.
    """

    def __init__(
        self,
        blocks: Blocks,
        prior: Prior,
        noise: Whitener,
        sigma_db: float | None = None,
        sites: Sites | None = None,
    ) -> None:
        gone, hypothesis = blocks.censored, prior.hypotheses[noise.number]
        shared = _shared_in_point(gone.readings, _side_m(gone.places), hypothesis)
        common = np.sqrt(shared)[:, None]
        known = noise.matrix @ (common * shadowing_in_blocks(blocks, hypothesis)).T
        between = common * shadowing_between(gone, hypothesis, gone.places) * common.T
        self._blocks, self._prior, self._noise = blocks, prior, noise
        self._independent = 1.0 - (1.0 - hypothesis.white_share) * shared
        self._gain = known.T @ noise.matrix
        self._predicted_dbm = self._gain @ blocks.level_dbm
        self._left = between - known.T @ known
        self._readings = np.minimum(gone.readings, READINGS_BELIEVED)
        self._fixed = np.stack([blocks.level_dbm, np.ones(len(blocks))])
        self.sites = sites
        self.sigma_db = prior.sigma_db if sigma_db is None else sigma_db

    def log_p(self, position: Places) -> float:
        """Log evidence at a position; log sigma is integrated out by Laplace's method."""
        varying = varying_columns(self._blocks, self._prior, position)
        censored = censored_columns(self._blocks.censored, self._prior, position)
        total = sums(self._noise.matrix[None], self._fixed, varying, None)
        law = SigmaLaw(total, len(self._blocks), self._prior)
        unknown = _design(censored) - self._gain @ _design(varying)

        def at(log_sigma: float) -> float:
            return self._given_sigma(law, unknown, log_sigma)

        middle = float(np.log(self.sigma_db))
        low, top, high = (at(middle + k * _STEP) for k in (-1, 0, 1))
        for _ in range(_MOST_STEPS):
            if low > top:
                middle, low, top, high = middle - _STEP, at(middle - 2.0 * _STEP), low, top
            elif high > top:
                middle, low, top, high = middle + _STEP, top, high, at(middle + 2.0 * _STEP)
            else:
                break
        slope = 0.5 * (high - low) / _STEP
        curvature = max((2.0 * top - low - high) / _STEP**2, _LEAST_CURVATURE)
        step = float(np.clip(slope / curvature, -_STEP, _STEP))
        self.sigma_db = float(np.exp(middle + step))
        at_mode = top + slope * step - 0.5 * curvature * step**2
        return at_mode + 0.5 * float(np.log(2.0 * np.pi / curvature))

    def _given_sigma(self, law: SigmaLaw, unknown: FloatArray, log_sigma: float) -> float:
        """Log density of levels, censored readings and log sigma; `unknown` (g, q) is D.

        Levels are counted from the limit in units of sigma, so that the sites of another sigma
        nearly fit.
        """
        gone, tau = self._blocks.censored, np.array([[log_sigma]])
        given, sigma_db = law.fit(tau), float(np.exp(log_sigma))
        log_p = float(law.log_p(tau, given)[0, 0]) - 0.5 * self._noise.log_det
        log_p -= 0.5 * len(self._blocks) * float(np.log(2.0 * np.pi))
        theta, covariance = given.theta[:, 0, 0], given.covariance(unknown.shape[1])[..., 0, 0]
        spread = self._left + unknown @ (covariance / sigma_db**2) @ unknown.T
        above_db = gone.side * (self._predicted_dbm + unknown @ theta - beyond_dbm(gone))
        beyond, self.sites = log_all_positive(
            above_db / sigma_db,
            gone.side[:, None] * spread * gone.side,
            self._readings,
            self._independent,
            self.sites,
        )
        return log_p + beyond


def _shared_in_point(readings: FloatArray, side_m: float, hypothesis: Hypothesis) -> FloatArray:
    """Correlation of the shadowing of two readings gathered in one point, shape (g,)."""
    apart_m = np.full(readings.shape, _MEAN_APART * side_m)
    shadowed = max(1.0 - hypothesis.white_share, _LEAST_SHADOWED)
    return np.where(readings > 1.0, shadowing(apart_m, hypothesis) / shadowed, 1.0)


def _design(varying: list[FloatArray]) -> FloatArray:
    """Shape (n, q) for one position, of columns (n, 1) that vary with it."""
    return np.concatenate([np.ones_like(varying[0]), *varying], axis=1)


def log_weights_at(
    blocks: Blocks, prior: Prior, position: Places, sigma_db: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Log evidence of every hypothesis at a position, with its prior odds, and sigma: (c,) each.

    The search for sigma begins at `sigma_db` (c,).
    """
    log_p, found_db, sites = [], [], None
    for noise, begun_db in zip(whiteners(blocks, prior), sigma_db.tolist(), strict=True):
        joint = Joint(blocks, prior, noise, begun_db, sites)
        log_p.append(joint.log_p(position))
        found_db.append(joint.sigma_db)
        sites = joint.sites  # of the hypothesis before: close, whatever its noise
    return prior.noise_table.log_odds + np.array(log_p), np.array(found_db)


def log_weights(
    blocks: Blocks,
    prior: Prior,
    found: list[Whitener],
    log_p: FloatArray,
    log_mass: FloatArray,
    positions: Places,
    samples: int,
) -> FloatArray:
    """Log evidence of each hypothesis, with its prior odds, over all positions, shape (c,).

    Positions (h,) have a log prior mass of `log_mass` (h,). `log_p` (c, h) is an approximation from
    which the positions are sampled: `samples` for each of the two likeliest hypotheses.
    """
    of_places = log_p + log_mass
    p = np.exp(of_places - log_sum(of_places)[:, None])
    joints = [Joint(blocks, prior, noise) for noise in found]
    odds = prior.noise_table.log_odds[[noise.number for noise in found]]
    best, at = np.argmax(of_places, axis=1), positions
    at_best = odds + [one.log_p(at[k]) for one, k in zip(joints, best.tolist(), strict=True)]
    likeliest = np.argsort(-at_best)[:_SAMPLED_FROM]
    indices = np.concatenate([_sample_positions(p[c], samples) for c in likeliest])
    log_share = np.log(np.mean(p[np.ix_(likeliest, indices)], axis=0))
    importance = (log_mass - log_sum(log_mass))[indices] - log_share - np.log(len(indices))
    found_log_p = np.full(len(found), -np.inf)
    for c in np.flatnonzero(at_best > np.max(at_best) - _HOPELESS_NATS):
        each = np.array([joints[c].log_p(at[k]) for k in indices.tolist()])
        found_log_p[c] = odds[c] + float(log_sum(each + importance))
    return found_log_p


def _sample_positions(p: FloatArray, samples: int) -> IntArray:
    order = np.argsort(-p, kind="stable")
    parts = (np.arange(samples) + 0.5) / samples * _SAMPLED_MASS
    return order[np.searchsorted(np.cumsum(p[order]), parts)]


def _side_m(places: Places) -> float:
    """Median distance of nearest neighbours, about the side of the square of a point."""
    if len(places) < 2:
        return 0.0
    apart_m = places.distances_m(places)
    apart_m[np.diag_indices_from(apart_m)] = np.inf
    return float(np.median(np.min(apart_m, axis=1)))
