"""Which noise explains the levels and the ends of the scale together.

Beside the floor only high levels are kept, which by themselves look like less and like correlated
noise. Levels z and censored readings are therefore judged by one Gaussian: the evidence of the
levels times the probability that the others, given these, are beyond the scale. With W as in
`evidence`, H = [1, -L], censored places marked c, B = W K_c':

    t | z ~ N(m, V),  V^-1 = (W H)'(W H) / s2 + Lambda0
    level at c | z ~ N(H_c m + B' W (z - H m), s2 (K_cc - B'B) + D V D'),  D = H_c - B' W H

That is too much work for every place; it is done at a few, and the evidence integrated over places
by importance sampling from what `censored` makes of them, with the balance heuristic (Veach &
Guibas, SIGGRAPH 1995).
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.evidence import distances_db
from logger.core.locator.mixture import log_sum
from logger.core.locator.orthant import Sites, log_all_above
from logger.core.locator.tobit import beyond_dbm, distances_to, shadowing, shadowing_in_blocks
from logger.core.model.blocks import READINGS_BELIEVED, Blocks
from logger.core.model.noise import Whitener, whiteners
from logger.core.model.prior import Prior

_STEP = 0.25
_MOST_STEPS = 8
_LEAST_CURVATURE = 1.0
_SAMPLED_FROM = 2
_HOPELESS_NATS = 12.0
_SAMPLED_MASS = 0.9999
_MEAN_APART = 1.0 / 3.0  # of two readings of a square, by its side: a way straight across


class Joint:
    """Levels and censored places under one hypothesis; asked for places one after another, nearby
    ones cost least.

    `sigma_db` is where to begin to look for sigma, and after a place what was found there.
    """

    def __init__(
        self, blocks: Blocks, prior: Prior, noise: Whitener, sigma_db: float | None = None
    ) -> None:
        gone, hypothesis = blocks.censored, prior.hypotheses[noise.number]
        a, d_c, _ = hypothesis
        reach_m = max(d_c, 1.0) / _MEAN_APART
        in_common = np.where(
            gone.readings > 1.0, np.exp(-_side_m(gone.x_m, gone.y_m) / reach_m), 1.0
        )
        common = np.sqrt(in_common)[:, None]
        self._blocks, self._prior, self._noise = blocks, prior, noise
        self._in_place = 1.0 - (1.0 - a) * in_common
        self._level = noise.matrix @ blocks.level_dbm
        self._known = noise.matrix @ (common * shadowing_in_blocks(blocks, hypothesis)).T
        shared = common * shadowing(gone, hypothesis, gone.x_m, gone.y_m) * common.T
        self._left = shared - self._known.T @ self._known
        self._readings = np.minimum(gone.readings, READINGS_BELIEVED)
        self._sites: Sites | None = None
        self.sigma_db = prior.sigma_db if sigma_db is None else sigma_db

    def log_p(self, x_m: float, y_m: float) -> float:
        """Log evidence at a place; log sigma is integrated out by Laplace's method."""
        place, height_m = (np.array([x_m]), np.array([y_m])), self._prior.height_m
        design = self._noise.matrix @ _design(distances_db(self._blocks, height_m, *place))
        of_gone = _design(distances_to(self._blocks.censored, height_m, *place))

        def at(log_sigma: float) -> float:
            return self._given_sigma(design, of_gone, log_sigma)

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
        return top + slope * step - 0.5 * curvature * step**2 - 0.5 * float(np.log(curvature))

    def _given_sigma(self, design: FloatArray, of_gone: FloatArray, log_sigma: float) -> float:
        prior, gone, s2 = self._prior, self._blocks.censored, float(np.exp(2.0 * log_sigma))
        precision = np.array([prior.p0_sigma_db**-2, prior.eta_sigma**-2])
        mean = np.array([prior.p0_dbm, prior.eta])
        a = design.T @ design / s2 + np.diag(precision)
        theta = np.linalg.solve(a, design.T @ self._level / s2 + precision * mean)
        left, moved = self._level - design @ theta, theta - mean
        off = (log_sigma - np.log(prior.sigma_db)) / prior.sigma_log_sd
        log_p = -0.5 * float(
            left @ left / s2 + moved @ (precision * moved) + off * off + self._noise.log_det
        )
        log_p += 0.5 * float(np.sum(np.log(precision)) - np.linalg.slogdet(a)[1]) - np.log(
            prior.sigma_log_sd
        )
        log_p -= len(left) * (log_sigma + 0.5 * np.log(2.0 * np.pi))
        unknown = of_gone - self._known.T @ design
        beyond, self._sites = log_all_above(
            gone.side * (of_gone @ theta + self._known.T @ left),
            gone.side[:, None]
            * (s2 * self._left + unknown @ np.linalg.solve(a, unknown.T))
            * gone.side,
            gone.side * beyond_dbm(gone),
            self._readings,
            s2 * self._in_place,
            self._sites,
        )
        return float(log_p) + beyond


def log_weights_at(
    blocks: Blocks, prior: Prior, x_m: float, y_m: float, sigma_db: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Log evidence of every hypothesis with its prior odds if the transmitter stood at a place, and
    sigma: (c,) each.

    `sigma_db` (c,) is where to begin to look for sigma.
    """
    begun = zip(whiteners(blocks, prior), sigma_db.tolist(), strict=True)
    joints = [Joint(blocks, prior, noise, begun_db) for noise, begun_db in begun]
    log_p = np.array([joint.log_p(x_m, y_m) for joint in joints])
    return prior.log_odds + log_p, np.array([joint.sigma_db for joint in joints])


def log_weights(
    blocks: Blocks,
    prior: Prior,
    found: list[Whitener],
    log_p: FloatArray,
    log_mass: FloatArray,
    x_m: FloatArray,
    y_m: FloatArray,
    samples: int,
) -> FloatArray:
    """Log evidence of each hypothesis with its prior odds, shape (c,), over places (h,) of log
    prior mass (h,).

    `log_p` (c, h) is what each makes of the places, about: it says where to look; `samples` places
    of each of the two likeliest hypotheses are looked at.
    """
    of_places = log_p + log_mass
    p = np.exp(of_places - log_sum(of_places)[:, None])
    joints = [Joint(blocks, prior, noise) for noise in found]
    odds = prior.log_odds[[noise.number for noise in found]]
    best = np.argmax(of_places, axis=1)
    at_best = odds + [one.log_p(x_m[k], y_m[k]) for one, k in zip(joints, best, strict=True)]
    likeliest = np.argsort(-at_best)[:_SAMPLED_FROM]
    places = np.concatenate([_sampled(p[c], samples) for c in likeliest])
    log_share = np.log(np.mean(p[np.ix_(likeliest, places)], axis=0))
    importance = (log_mass - log_sum(log_mass))[places] - log_share - np.log(len(places))
    found_log_p = np.full(len(found), -np.inf)
    for c in np.flatnonzero(at_best > np.max(at_best) - _HOPELESS_NATS):
        each = np.array([joints[c].log_p(x_m[k], y_m[k]) for k in places])
        found_log_p[c] = odds[c] + float(log_sum(each + importance))
    return found_log_p


def _sampled(p: FloatArray, samples: int) -> IntArray:
    """Indices of places that stand for equal parts of the mass, the likeliest first."""
    order = np.argsort(-p, kind="stable")
    parts = (np.arange(samples) + 0.5) / samples * _SAMPLED_MASS
    return order[np.searchsorted(np.cumsum(p[order]), parts)]


def _side_m(x_m: FloatArray, y_m: FloatArray) -> float:
    """How far apart neighbouring places are, about the side of the square that each stands for."""
    if len(x_m) < 2:
        return 0.0
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    apart_m[np.diag_indices_from(apart_m)] = np.inf
    return float(np.median(np.min(apart_m, axis=1)))


def _design(distance_db: FloatArray) -> FloatArray:
    """H of places at one distance each, shape (n, 2), from (n, 1)."""
    return np.concatenate([np.ones_like(distance_db), -distance_db], axis=1)
