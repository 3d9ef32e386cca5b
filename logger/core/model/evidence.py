"""What the levels say of positions under each hypothesis of the noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray

PAIRS = ((0, 0), (0, 1), (1, 1))
"""Entries of `Evidence.theta_cov`: var P0, cov, var eta."""


class Evidence(NamedTuple):
    """What the levels give for each hypothesis of the noise (c) at each position (h).

    `log_p` and `sigma_db` (mean) have shape (c, h); `theta` (q, c, h) is the mean of P0, eta and,
    of a single station, the antenna's harmonics; `theta_cov` (3, c, h) holds var P0, cov, var eta.
    `station` (s, c, h) is the probability of each station, given the other two.
    """

    log_p: FloatArray
    theta: FloatArray
    theta_cov: FloatArray
    sigma_db: FloatArray
    station: FloatArray

    def at_positions(self, chosen: IntArray | slice) -> "Evidence":
        """That of some of the positions."""
        return Evidence(*(values[..., chosen] for values in self))

    def replace(self, rows: IntArray, chosen: IntArray, new: "Evidence") -> "Evidence":
        """The evidence with that of `new` for the hypotheses `rows` at the `chosen` positions.

        Patterns have different numbers of harmonics: of the coefficients, P0 and eta remain.
        """
        joined = Evidence(*(values.copy() for values in self._replace(theta=self.theta[:2])))
        is_everywhere = len(chosen) == self.log_p.shape[-1]  # copies rows: four times as fast
        at = (..., rows, slice(None)) if is_everywhere else (..., rows[:, None], chosen)
        for values, others in zip(joined, new._replace(theta=new.theta[:2]), strict=True):
            values[at] = others
        return joined

    def of_hypotheses(self, chosen: IntArray | slice) -> "Evidence":
        """That of some of the hypotheses."""
        return Evidence(*(values[..., chosen, :] for values in self))


def mix_stations(parts: Sequence[Evidence], log_odds: FloatArray) -> Evidence:
    """Evidence of a station that is one of several, with log probabilities (s, c)."""
    joint = np.stack([one.log_p for one in parts]) + log_odds[..., None]
    best = np.max(joint, axis=0)
    station = np.exp(joint - best)
    total = np.sum(station, axis=0)
    station /= total
    each = np.stack([one.theta[:2] for one in parts])
    theta = np.einsum("sch,sqch->qch", station, each)
    off = each - theta
    spread = np.stack([one.theta_cov for one in parts])
    for k, (i, j) in enumerate(PAIRS):
        spread[:, k] += off[:, i] * off[:, j]
    return Evidence(
        best + np.log(total),
        theta,
        np.einsum("sch,skch->kch", station, spread),
        np.einsum("sch,sch->ch", station, np.stack([one.sigma_db for one in parts])),
        station,
    )


def join_positions(parts: Sequence[Evidence]) -> Evidence:
    """Evidence of the same hypotheses at the positions of all parts."""
    return parts[0] if len(parts) == 1 else _join(parts, -1)


def join_hypotheses(parts: Sequence[Evidence]) -> Evidence:
    """Evidence at the same positions of the hypotheses of all parts."""
    return parts[0] if len(parts) == 1 else _join(parts, -2)


def _join(parts: Sequence[Evidence], axis: int) -> Evidence:
    return Evidence(*(np.concatenate(values, axis) for values in zip(*parts, strict=True)))
