"""The indirect test on a walk: the claim in the posterior of the walk.

The statistic is the mass of all places that are less likely than the claim, S = 1 - (level of the smallest
highest-density region that holds it); the density of an uncertain claim is its mean over where it may be. It is a sum
over the whole posterior, so it does not matter how many places that has. Taken as a p-value S is right on average
over the prior; walks drawn from the claim (`drawn`) make it right for the claim.
"""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from postproc.verify.field import Field, refined

_SCOUTS = 12
_BELOW = 1e-9
_MOST_SQUARES = 800


@dataclass(frozen=True)
class IndirectTest:
    """`field` ends with the `k` equally likely places of the claim."""

    field: Field
    k: int

    def tails(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """S for levels (n, b), shape (b,); each hypothesis counts with its own trust, or (`trusting`) in full."""
        log_p, _ = self.field.judged(level_dbm)
        trust = self.field.trust
        density = self.field.densities(log_p, np.ones_like(trust) if trusting else trust)
        mass = density[: -self.k] * self.field.squares[2, : -self.k, None] ** 2
        claim = np.mean(density[-self.k :], axis=0)
        less = np.sum(np.where(density[: -self.k] <= claim, mass, 0.0), axis=0)
        # the second term orders claims that are less likely than every square
        return np.asarray(less / np.sum(mass, axis=0) + _BELOW * claim / np.max(density, axis=0), float)


def indirect_test(field: Field, claim: FloatArray, drawn_dbm: FloatArray) -> IndirectTest:
    """Prepare the test of a claim of equally likely places (2, k), with a field fine enough for walks drawn from it."""
    fine = refined(field, drawn_dbm[:, :_SCOUTS], _MOST_SQUARES)
    squares = np.concatenate([fine.squares, np.vstack([claim, np.zeros(claim.shape[1])])], axis=1)
    return IndirectTest(field.with_squares(squares), claim.shape[1])
