"""One claim against one walk: the direct test and the indirect one, both calibrated."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.blocks import Blocks
from logger.core.locator.evidence import whiteners_of
from logger.core.locator.prior import Prior
from postproc.verify.direct import DirectTest, direct_test
from postproc.verify.drawn import Nuisances, calibrated, nuisances
from postproc.verify.field import Field, coarse_squares, field_at, refined
from postproc.verify.indirect import IndirectTest, indirect_test
from postproc.verify.noise import covariances

DRAWS = 240

_COARSE = 550
_FINE = 1600
_RINGS = 4
_BEARINGS = 8


@dataclass(frozen=True)
class Listened:
    """A walk ready to have claims tested: blocks with levels about zero, a coarse field, and what the noise is like.

    `covariances` (c, n, n) are those of every hypothesis of the prior.
    """

    blocks: Blocks
    prior: Prior
    level_dbm: FloatArray
    covariances: FloatArray
    field: Field
    noise: Nuisances


@dataclass(frozen=True)
class ClaimTest:
    """Both tests of one claim; `calm_direct` and `calm_indirect` are the sorted statistics of walks drawn from it."""

    walk: Listened
    claim: FloatArray
    direct: DirectTest
    indirect: IndirectTest
    calm_direct: FloatArray
    calm_indirect: FloatArray

    def p_direct(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values of levels (n, b), shape (b,); `trusting` the noise to be as stationary as a simulated one."""
        return calibrated(self.calm_direct, self.direct.p_values(level_dbm, trusting=trusting))

    def p_indirect(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values of levels (n, b), shape (b,); `trusting` as above."""
        return calibrated(self.calm_indirect, self.indirect.tails(level_dbm, trusting=trusting))


def listened(blocks: Blocks, prior: Prior) -> Listened:
    """Learn from a walk what does not depend on the claim."""
    level_dbm = blocks.level_dbm - float(np.mean(blocks.level_dbm))
    k, coarse = covariances(blocks, prior), coarse_squares(blocks, prior)
    every = whiteners_of(k)
    # each hypothesis has its own peak: places too coarse for the sharpest would rule that one out
    searched = refined(field_at(blocks, prior, coarse, every[::6]), level_dbm[:, None], _FINE)
    fine = field_at(blocks, prior, searched.squares, every).plausible(level_dbm)
    field = refined(field_at(blocks, prior, coarse, fine.found), level_dbm[:, None], _COARSE)
    return Listened(blocks, prior, level_dbm, k, field, nuisances(fine, level_dbm, k))


def claim_test(walk: Listened, claim: FloatArray, rng: np.random.Generator) -> ClaimTest | None:
    """Prepare both tests of a claim of equally likely places (2, k); None for a walk of too few blocks."""
    direct = direct_test(walk.blocks, walk.prior, walk.covariances, claim, walk.noise.mean_sigma_db)
    if direct is None:
        return None
    at = claim[:, rng.integers(claim.shape[1], size=DRAWS)]
    drawn = walk.noise.walks(at[0], at[1], rng)
    indirect = indirect_test(walk.field, claim, drawn)
    calm = direct.p_values(drawn, trusting=True), indirect.tails(drawn, trusting=True)
    return ClaimTest(walk, claim, direct, indirect, *(np.sort(one) for one in calm))


def around(x_m: float, y_m: float, sigma_m: float) -> FloatArray:
    """Equally likely places (2, k) of a normal claim: rings that halve the mass between them, or the place alone."""
    if sigma_m <= 0.0:
        return np.array([[x_m], [y_m]])
    radius = sigma_m * np.sqrt(-2.0 * np.log(1.0 - (np.arange(_RINGS) + 0.5) / _RINGS))
    angle = 2.0 * np.pi * (np.arange(_BEARINGS) / _BEARINGS + 0.5 * np.arange(_RINGS)[:, None] / _BEARINGS)
    return np.stack([x_m + (radius[:, None] * np.cos(angle)).ravel(), y_m + (radius[:, None] * np.sin(angle)).ravel()])
