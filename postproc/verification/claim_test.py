"""One claim against one walk: the direct test and the indirect one, both calibrated."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.blocks import Blocks
from logger.core.model.noise import covariances, whiteners_of
from logger.core.model.prior import Prior
from logger.core.places import Places
from postproc.verification.bootstrap import Nuisances, calibrate, nuisances, nuisances_off
from postproc.verification.direct_test import DirectTest, direct_test
from postproc.verification.indirect_test import IndirectTest, indirect_test
from postproc.verification.likelihood_grid import (
    LikelihoodGrid,
    coarse_squares,
    likelihood_grid,
    refine,
)

DRAWS = 240

_COARSE = 550
_FINE = 1600
_APART_M = 6.0
_FEWEST_PLACES = 32
_MOST_PLACES = 256
_GOLDEN_RAD = np.pi * (3.0 - 5.0**0.5)


@dataclass(frozen=True)
class PreparedWalk:
    """A walk ready for tests of claims: blocks with levels about zero, and estimated noise.

    `covariances` (c, n, n) are those of every hypothesis of the prior. `field` has few places, to
    be refined for a claim, `fine` those at which the noise is estimated.
    """

    blocks: Blocks
    prior: Prior
    level_dbm: FloatArray
    covariances: FloatArray
    field: LikelihoodGrid
    fine: LikelihoodGrid
    noise: Nuisances


@dataclass(frozen=True)
class ClaimTest:
    """Both tests of one claim; `calm_direct` are sorted statistics of walks simulated from it."""

    walk: PreparedWalk
    claim: FloatArray
    direct: DirectTest
    indirect: IndirectTest
    calm_direct: FloatArray

    def p_direct(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values (b,) of levels (n, b).

        `trusting`: the noise is as stationary as in a simulation.
        """
        return calibrate(self.calm_direct, self.direct.p_values(level_dbm, trusting=trusting))

    def p_indirect(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values of levels (n, b), shape (b,); `trusting` as above."""
        return self.indirect.p_values(level_dbm, trusting=trusting)


def prepare_walk(blocks: Blocks, prior: Prior) -> PreparedWalk:
    """Learn from a walk what does not depend on the claim."""
    level_dbm = blocks.level_dbm - float(np.mean(blocks.level_dbm))
    k, coarse = covariances(blocks, prior), coarse_squares(blocks, prior)
    every = whiteners_of(k)
    # each hypothesis has its own peak: places too coarse for the sharpest would rule that one out
    searched = refine(likelihood_grid(blocks, prior, coarse, every[::6]), level_dbm[:, None], _FINE)
    fine = likelihood_grid(blocks, prior, searched.squares, every).plausible(level_dbm)
    field = refine(
        likelihood_grid(blocks, prior, coarse, fine.whiteners), level_dbm[:, None], _COARSE
    )
    return PreparedWalk(blocks, prior, level_dbm, k, field, fine, nuisances(fine, level_dbm, k))


def claim_test(walk: PreparedWalk, claim: FloatArray, rng: np.random.Generator) -> ClaimTest | None:
    """Prepare both tests of a claim of equally likely positions (2, k).

    None for a walk of too few blocks.
    """
    direct = direct_test(walk.blocks, walk.prior, walk.covariances, claim, walk.noise.mean_sigma_db)
    if direct is None:
        return None
    at = Places.of(*claim[:, rng.integers(claim.shape[1], size=DRAWS)])
    sample_walks = walk.noise.walks(at, rng)
    indirect = indirect_test(walk.field, claim, sample_walks, walk.noise.mean_sigma_db, rng)
    without_bent = nuisances_off(direct.bent, walk.fine, walk.level_dbm, walk.covariances)
    calm = direct.p_values(without_bent.walks(at, rng), trusting=True)
    return ClaimTest(walk, claim, direct, indirect, np.sort(calm))


def around(place: Places, sigma_m: float) -> FloatArray:
    """Equally likely places (2, k) of a normal claim, or the place alone.

    They lie on the spiral of a sunflower, which leaves no hole (Vogel, Math. Biosci. 44, 1979), the
    closer together the less a walk may know a place by.
    """
    if sigma_m <= 0.0:
        return place.xy_m
    k = int(np.clip((sigma_m / _APART_M) ** 2, _FEWEST_PLACES, _MOST_PLACES))
    radius = sigma_m * np.sqrt(-2.0 * np.log(1.0 - (np.arange(k) + 0.5) / k))
    angle = _GOLDEN_RAD * np.arange(k)
    away = radius * np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(place.xy_m + away - np.mean(away, axis=1, keepdims=True), float)
