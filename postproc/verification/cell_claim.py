"""The test of one claim about one cell."""

from dataclasses import dataclass

import numpy as np

from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations
from postproc.cell_estimation import too_few
from postproc.verification.claim_test import ClaimTest, around, claim_test, prepare_walk
from postproc.verification.claims import Claim
from postproc.verification.normality import normality
from postproc.verification.verdicts import CellVerdict

FEWEST_BLOCKS = 16
"""Fewer blocks leave too few residuals to estimate the noise beside the claim's displacement."""

_MOST_BLOCKS = 80
"""The tests draw thousands of walks over the blocks: more cost time and gain no power."""
_CUT_SIGMAS = 3.0
"""Normality is tested again without the tails, which a few disturbed readings make."""


@dataclass(frozen=True, slots=True)
class ClaimOptions:
    """False-alarm rate and prior; `stationary` noise is that of a simulation."""

    p_fa: float
    prior: Prior
    stationary: bool = False


def verify_cell(
    obs: CellObservations,
    claim: Claim,
    options: ClaimOptions,
    rng: np.random.Generator,
    posterior: Posterior | None = None,
) -> CellVerdict:
    """Test of a claim; the verdict is open until the p-values of all claims are adjusted.

    `posterior` is that of these readings and the prior, where it is known.
    """
    if why := too_few(obs, obs.usable()):
        return undecided_verdict(obs.cell, len(obs), claim, why)
    test = _claim_test(obs, claim, options.prior, rng)
    if test is None:
        why = f"fewer than {FEWEST_BLOCKS} locations with a level"
        return undecided_verdict(obs.cell, len(obs), claim, why)
    posterior = posterior or locate(obs, options.prior)
    level_dbm = test.walk.level_dbm[:, None]
    p, p_model = (
        float(test.p_values(level_dbm, trusting=trusting)[0])
        for trusting in (options.stationary, True)
    )
    tails = test.tails(level_dbm, trusting=options.stationary)
    residuals = test.residuals()
    power = tuple(test.detectable(options.p_fa, rng, trusting=options.stationary))
    tests = (normality(residuals, limit, rng) for limit in (None, _CUT_SIGMAS))
    return CellVerdict(
        obs.cell,
        len(obs),
        claim,
        "cannot tell",
        tuple(_censoring(obs)),
        followed="indirect",
        p=p,
        p_indirect=p,
        p_indirect_model=p_model,
        level=1.0 - float(tails[0]),
        distance_m=test.distance_m,
        best_deg=obs.utm.to_latlon(posterior.x_m, posterior.y_m),
        power=power,
        normality=tuple(result for result in tests if result),
    )


def undecided_verdict(
    cell: str, n: int, claim: Claim, why: str, error: str | None = None
) -> CellVerdict:
    """A claim that cannot be tested, or whose test was ended by an error of the program."""
    return CellVerdict(cell, n, claim, "cannot tell", (why,), error=error)


def blocks_of(obs: CellObservations) -> Blocks:
    """Blocks of readings, without those censored or near a censored one.

    There only the high levels are left, which bias the tests.
    """
    gathered = blocks(obs.usable(), _MOST_BLOCKS)
    return gathered.clear_of_censored() if len(gathered.censored.x_m) else gathered


def _claim_test(
    obs: CellObservations, claim: Claim, prior: Prior, rng: np.random.Generator
) -> ClaimTest | None:
    gathered = blocks_of(obs)
    if len(gathered) < FEWEST_BLOCKS:
        return None
    x_m, y_m = obs.utm.to_xy(claim.lat_deg, claim.lon_deg)
    # the lasting part of the receiver's error displaces a true claim as well
    lasting_m = float(np.median(gathered.position_sigma_m))
    claimed = around(x_m, y_m, float(np.hypot(claim.sigma_m, lasting_m)))
    return claim_test(prepare_walk(gathered, prior), claimed, rng)


def _censoring(obs: CellObservations) -> list[str]:
    n = int(np.count_nonzero(obs.limit))
    if not n:
        return []
    return [f"{n} readings at the end of the modem's scale, and those near them, were left out"]
