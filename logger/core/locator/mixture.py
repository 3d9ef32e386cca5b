"""From the evidence of every hypothesis to the probability of positions.

Within a group of noise hypotheses the likelihoods are mixed first, position by position. Then each
group has one posterior over the positions, with its likelihood raised to the power of its trust;
the weights of the groups are their evidence over the complete walk, raised to a power as well:

    l_g(x) = log sum_c P(c | g) p(z | x, c)
    p(x) = sum_g W_g p_0(x) exp(T_g l_g(x)) / Z_g,    W_g ~ [P(g) integral p_0(x) exp(l_g(x)) dx]^k

If each hypothesis were tempered before the mixing, the wide posterior of one that explains the walk
badly near the transmitter would have as much weight far away as it has altogether.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model.prior import Prior

GROUP_POWER = 0.5
"""k. A few readings more or less change the evidence of a group by a few nats: with 1 the answer
swings, with .25 regions under white noise are up to eight times as large. On 506 measured walks
both hold transmitters as often.
"""

_IMPOSSIBLE = -1e6
"""Log weight of a hypothesis that is ruled out: finite, as a whole group may be."""


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

    The numbers ascend. `log_weight` (c,) of the hypotheses, up to a constant, is by default their
    evidence.
    """
    normal = log_mass - log_sum(log_mass)
    joint = log_p + prior.noise_table.log_odds[numbers][:, None]
    if log_weight is not None:
        known = np.maximum(log_weight, _IMPOSSIBLE)
        joint += (known - log_sum(joint + normal))[:, None]
    of_groups = [
        _mix_group(joint[rows], normal, trust) for rows, trust in rows_of_groups(numbers, prior)
    ]
    each = np.array([one.log_evidence for one in of_groups])
    weight = np.exp(GROUP_POWER * each - log_sum(GROUP_POWER * each))
    share = [of_group * one.share for of_group, one in zip(weight, of_groups, strict=True)]
    return Mixture(np.concatenate(share), float(log_sum(each)))


def rows_of_groups(numbers: IntArray, prior: Prior) -> list[tuple[slice, float]]:
    """Rows of each group among the hypotheses `numbers` (c,), and its trust."""
    table = prior.noise_table
    ends = np.append(np.searchsorted(numbers, table.first), len(numbers)).tolist()
    return [
        (slice(first, end), float(table.trust[numbers[first]]))
        for first, end in pairwise(ends)
        if end > first
    ]


def _mix_group(joint: FloatArray, normal: FloatArray, trust: float) -> Mixture:
    """Posterior of one group: its likelihood (c, h) is mixed, then raised to the power `trust`."""
    best = joint.max(axis=0)
    share = np.exp(joint - best)
    total = share.sum(axis=0)
    log_group = best + np.log(total)
    log_evidence = float(log_sum(log_group + normal))
    tempered = trust * log_group + normal
    share *= np.exp(tempered - log_sum(tempered)) / total
    return Mixture(share, log_evidence)


def log_sum(values: FloatArray) -> FloatArray:
    """Log of the sum of exponentials along the last axis."""
    top = values.max(axis=-1)  # methods: this is needed several times after each live reading
    return np.asarray(top + np.log(np.exp(values - top[..., None]).sum(axis=-1)), float)
