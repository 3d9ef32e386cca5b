"""What the levels say of positions under each hypothesis of the noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray

PAIRS = ((0, 0), (0, 1), (1, 1))
"""Entries of `Evidence.theta_cov`: var P0, cov, var eta."""


class Evidence(NamedTuple):
    """What the levels give for each hypothesis of the noise (c) at each position (h).

    `log_p` and `sigma_db` (mean) have shape (c, h); `theta` (q, c, h) is the mean of P0, eta and
    the antenna's harmonics; `theta_cov` (3, c, h) holds var P0, cov, var eta.
    """

    log_p: FloatArray
    theta: FloatArray
    theta_cov: FloatArray
    sigma_db: FloatArray

    def at_positions(self, chosen: IntArray | slice) -> "Evidence":
        """That of some of the positions."""
        return Evidence(*(values[..., chosen] for values in self))

    def of_hypotheses(self, chosen: IntArray | slice) -> "Evidence":
        """That of some of the hypotheses."""
        return Evidence(*(values[..., chosen, :] for values in self))


def join_positions(parts: Sequence[Evidence]) -> Evidence:
    """Evidence of the same hypotheses at the positions of all parts."""
    return parts[0] if len(parts) == 1 else _join(parts, -1)


def join_hypotheses(parts: Sequence[Evidence]) -> Evidence:
    """Evidence at the same positions of the hypotheses of all parts."""
    return parts[0] if len(parts) == 1 else _join(parts, -2)


def _join(parts: Sequence[Evidence], axis: int) -> Evidence:
    return Evidence(*(np.concatenate(values, axis) for values in zip(*parts, strict=True)))
