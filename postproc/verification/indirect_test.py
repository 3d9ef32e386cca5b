"""The indirect test on a walk: the claim in the posterior of the walk.

The statistic is the mass of all places that are less likely than the claim, S = 1 - (level of the
smallest highest-density region that holds it); the density of an uncertain claim is its mean over
where it may be. It is a sum over the whole posterior, so it does not matter how many places that
has. Taken as a p-value S is right on average over the prior; walks drawn from the claim (`drawn`)
make it right for the claim.

So much for noise that is known to be stationary. A measured walk may be wrong about the place with
all its parts agreeing: an antenna that does not send all round, or a hill, bends levels as a
displacement does. It is therefore judged with tempered trust and a first harmonic of the bearing as
one more unknown, which the walks drawn have too. And since it is not like those, they may make its
p-value larger than S but no smaller.
"""

from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray
from postproc.verification.bootstrap import antenna_patterns, calibrate
from postproc.verification.likelihood_grid import LikelihoodGrid, refine

ANTENNA_DB = 6.0
"""Sigma of the cosine and of the sine of a measured transmitter's pattern: 15 dB from front to back
on average.

Chosen with measured walks seen; 3 or 10 dB do much the same.
"""

_SCOUTS = 12
_BELOW = 1e-9
_MOST_SQUARES = 800


@dataclass(frozen=True)
class IndirectTest:
    """The prepared test: `field` ends with the `k` equally likely positions of the claim.

    `directional` is the same with an antenna pattern, for a measured walk.

    `calm` and `calm_directional` are the sorted statistics of walks drawn from the claim.
    """

    field: LikelihoodGrid
    directional: LikelihoodGrid
    k: int
    calm: FloatArray
    calm_directional: FloatArray

    def tails(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """S (b,) for levels (n, b), with an antenna pattern and tempered hypotheses.

        `trusting`: without either.
        """
        if trusting:
            return _tails(self.field, self.k, level_dbm)
        return _tails(self.directional, self.k, level_dbm, self.directional.trust)

    def p_values(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values (b,) of levels (n, b).

        `trusting`: the noise is as stationary as in a simulation.
        """
        found = self.tails(level_dbm, trusting=trusting)
        if trusting:
            return calibrate(self.calm, found)
        return np.maximum(found, calibrate(self.calm_directional, found))


def indirect_test(
    field: LikelihoodGrid,
    claim: FloatArray,
    drawn_dbm: FloatArray,
    sigma_db: float,
    rng: np.random.Generator,
) -> IndirectTest:
    """Prepare the test of a claim of equally likely positions (2, k).

    The grid is refined for walks simulated from the claim.

    `drawn_dbm` (n, b) are those walks, whose noise is `sigma_db`.
    """
    fine, k = refine(field, drawn_dbm[:, :_SCOUTS], _MOST_SQUARES), claim.shape[1]
    squares = np.concatenate([fine.squares, np.vstack([claim, np.zeros(k)])], axis=1)
    plain = field.with_squares(squares)
    directional, of_antenna = plain, np.zeros(1)
    if not field.prior.antenna_db:
        directional = plain.with_prior(replace(field.prior, antenna_db=(ANTENNA_DB,)))
        middle = np.repeat(np.mean(claim, axis=1, keepdims=True), drawn_dbm.shape[1], axis=1)
        size = np.full(drawn_dbm.shape[1], sigma_db / field.prior.sigma_db)
        of_antenna = antenna_patterns(directional.blocks, directional.prior, middle, size, rng)
    calm = _tails(plain, k, drawn_dbm), _tails(directional, k, drawn_dbm + of_antenna)
    return IndirectTest(plain, directional, k, *(np.sort(one) for one in calm))


def _tails(
    field: LikelihoodGrid, k: int, level_dbm: FloatArray, trust: FloatArray | None = None
) -> FloatArray:
    log_p, _ = field.evaluate(level_dbm)
    density = field.densities(log_p, np.ones(len(log_p)) if trust is None else trust)
    mass = density[:-k] * field.squares[2, :-k, None] ** 2
    claim = np.mean(density[-k:], axis=0)
    less = np.sum(np.where(density[:-k] <= claim, mass, 0.0), axis=0)
    # the second term orders claims that are less likely than every square
    return np.asarray(less / np.sum(mass, axis=0) + _BELOW * claim / np.max(density, axis=0), float)
