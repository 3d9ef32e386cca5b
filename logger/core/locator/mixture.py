"""From the evidence of every hypothesis to the probability of positions.

Each hypothesis has its own posterior over the positions, with its likelihood raised to the power of
its trust; their weights are their evidence over the complete walk.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model.prior import Prior


class Mixture(NamedTuple):
    """Joint probability (c, h) of hypothesis and position, and the log evidence of the walk."""

    share: FloatArray
    log_evidence: float

    @property
    def probability(self) -> FloatArray:
        """Of the positions, shape (h,)."""
        return np.asarray(np.sum(self.share, axis=0), float)

    @property
    def by_hypothesis(self) -> FloatArray:
        """Of the hypotheses, shape (c,)."""
        return np.asarray(np.sum(self.share, axis=1), float)


def mixture(
    log_p: FloatArray,
    log_mass: FloatArray,
    numbers: IntArray,
    prior: Prior,
    log_weight: FloatArray | None = None,
) -> Mixture:
    """Mix hypotheses `numbers` (c,) with log evidence (c, h); positions have log prior mass (h,).

    `log_weight` (c,) of the hypotheses, up to a constant, is their evidence unless something else
    is given.
    """
    normal = log_mass - log_sum(log_mass)
    trust, log_odds = _of_hypotheses(prior)
    if log_weight is None:
        log_weight = log_sum(log_p + normal) + log_odds[numbers]
    log_evidence = float(log_sum(log_weight))
    share = trust[numbers, None] * log_p + normal
    share -= share.max(axis=1, keepdims=True)
    np.exp(share, out=share)
    share *= (np.exp(log_weight - log_evidence) / share.sum(axis=1))[:, None]
    return Mixture(share, log_evidence)


@lru_cache(maxsize=8)  # needed after each live reading
def _of_hypotheses(prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Trust and log odds of all hypotheses, shape (c,) each."""
    return np.array([h.trust for h in prior.hypotheses]), prior.log_odds


def log_sum(values: FloatArray) -> FloatArray:
    """Log of the sum of exponentials along the last axis."""
    top = values.max(axis=-1)  # methods: this is needed several times after each live reading
    return np.asarray(top + np.log(np.exp(values - top[..., None]).sum(axis=-1)), float)
