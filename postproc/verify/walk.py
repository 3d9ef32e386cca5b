"""One claim against one walk: the direct test and the calibrated indirect one."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.blocks import Blocks
from logger.core.locator.evidence import whiteners
from logger.core.locator.prior import Prior
from postproc.verify.direct import DirectTest, direct_test
from postproc.verify.drawn import Nuisances, calibrated, nuisances
from postproc.verify.field import Field, coarse_squares, field_at, refined
from postproc.verify.indirect import IndirectTest, indirect_test

DRAWS = 240

_COARSE = 550
_RINGS = 4
_BEARINGS = 8


@dataclass(frozen=True)
class Listened:
    """A walk ready to have claims tested: blocks with levels about zero, a coarse field, and what the noise is like."""

    blocks: Blocks
    prior: Prior
    level_dbm: FloatArray
    field: Field
    noise: Nuisances


@dataclass(frozen=True)
class ClaimTest:
    """Both tests of one claim; `calm_indirect` are the sorted statistics of walks drawn from it."""

    walk: Listened
    claim: FloatArray
    direct: DirectTest
    indirect: IndirectTest
    calm_indirect: FloatArray

    def p_direct(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values of levels (n, b), shape (b,); `trusting` the noise to be as stationary as a simulated one."""
        return self.direct.p_values(level_dbm, trusting=trusting)

    def p_indirect(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values of levels (n, b), shape (b,); `trusting` as above."""
        return calibrated(self.calm_indirect, self.indirect.tails(level_dbm, trusting=trusting))


def listened(blocks: Blocks, prior: Prior) -> Listened:
    """Learn from a walk what does not depend on the claim."""
    level_dbm = blocks.level_dbm - float(np.mean(blocks.level_dbm))
    every = whiteners(blocks, prior)
    # no hypothesis may be ruled out at places too coarse to fit, so a few search and then all are judged
    searched = refined(field_at(blocks, prior, coarse_squares(blocks, prior), every[::6]), level_dbm[:, None], _COARSE)
    field = field_at(blocks, prior, searched.squares, every).plausible(level_dbm)
    return Listened(blocks, prior, level_dbm, field, nuisances(field, level_dbm))


def claim_test(walk: Listened, claim: FloatArray, rng: np.random.Generator) -> ClaimTest | None:
    """Prepare both tests of a claim of equally likely places (2, k); None for a walk of too few blocks."""
    direct = direct_test(walk.blocks, walk.prior, claim, walk.noise.mean_sigma_db)
    if direct is None:
        return None
    at = claim[:, rng.integers(claim.shape[1], size=DRAWS)]
    drawn = walk.noise.walks(at[0], at[1], rng)
    indirect = indirect_test(walk.field, claim, drawn)
    calm = indirect.tails(drawn, trusting=True)
    return ClaimTest(walk, claim, direct, indirect, np.sort(calm))


def around(x_m: float, y_m: float, sigma_m: float) -> FloatArray:
    """Equally likely places (2, k) of a normal claim: rings that halve the mass between them, or the place alone."""
    if sigma_m <= 0.0:
        return np.array([[x_m], [y_m]])
    radius = sigma_m * np.sqrt(-2.0 * np.log(1.0 - (np.arange(_RINGS) + 0.5) / _RINGS))
    angle = 2.0 * np.pi * (np.arange(_BEARINGS) / _BEARINGS + 0.5 * np.arange(_RINGS)[:, None] / _BEARINGS)
    return np.stack([x_m + (radius[:, None] * np.cos(angle)).ravel(), y_m + (radius[:, None] * np.sin(angle)).ravel()])
