"""The indirect test on a walk: the claim in the posterior of the walk.

The statistic S is the probability of all positions that are less likely than the claim: 1 - the
level of the smallest highest-density region that contains it. The density of an uncertain claim is
its mean over the claim's positions. S is a sum over the complete posterior, so several modes make
no difference. As a p-value S is right on average over the prior; walks simulated from the claim
(`bootstrap`) make it right for the claim.

This holds for noise that is known to be stationary. In a measured walk all parts may agree on a
wrong position: a directional antenna or a hill changes levels as a displacement does. Therefore the
test tempers the likelihood and adds a first harmonic of the azimuth as one more unknown, in the
simulated walks too. Since a measured walk is not like those, they may only raise its p-value.
"""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.prior import Station
from logger.core.places import Places
from postproc.verification.bootstrap import antenna_patterns, calibrate
from postproc.verification.likelihood_grid import LikelihoodGrid, refine

ANTENNA_DB = 6.0
"""Sigma of cosine and sine of a measured transmitter's pattern, 15 dB front to back on average.

Chosen on the measured walks; 3 or 10 dB give similar results.
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
        return _tails(self.directional, self.k, level_dbm, tempered=True)

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
        directional = plain.with_prior(
            field.prior.of_station(Station(1.0, field.prior.height_m, (ANTENNA_DB,)))
        )
        middle_m = np.repeat(np.mean(claim, axis=1, keepdims=True), drawn_dbm.shape[1], axis=1)
        middle = Places.of(*middle_m)
        size = np.full(drawn_dbm.shape[1], sigma_db / field.prior.sigma_db)
        of_antenna = antenna_patterns(directional.blocks, directional.prior, middle, size, rng)
    calm = _tails(plain, k, drawn_dbm), _tails(directional, k, drawn_dbm + of_antenna)
    return IndirectTest(plain, directional, k, *(np.sort(one) for one in calm))


def _tails(
    field: LikelihoodGrid, k: int, level_dbm: FloatArray, *, tempered: bool = False
) -> FloatArray:
    log_p, _ = field.evaluate(level_dbm)
    density = field.densities(log_p, tempered=tempered)
    mass = density[:-k] * field.squares[2, :-k, None] ** 2
    claim = np.mean(density[-k:], axis=0)
    less = np.sum(np.where(density[:-k] <= claim, mass, 0.0), axis=0)
    # the second term orders claims that are less likely than every square
    return np.asarray(less / np.sum(mass, axis=0) + _BELOW * claim / np.max(density, axis=0), float)
