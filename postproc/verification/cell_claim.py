"""Both tests of one claim about one cell.

The recommendation of Verma et al. chooses the test that decides: the indirect one, at least as
good, where the position can be observed, else the direct one. A posterior shows what is observed
even where it names no single position, so only one whose search ended before its mass did is not
enough. Of 161 measured walks the indirect test rejects fewer true positions than the direct one
and, displaced by five times the distance, four times as many false ones.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings
from postproc.cell_estimation import too_few
from postproc.verification.claim_test import ClaimTest, around, claim_test, prepare_walk
from postproc.verification.claims import Claim
from postproc.verification.normality import normality
from postproc.verification.power import detectable, distance_m
from postproc.verification.verdicts import CellVerdict, Followed

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


class PValues(NamedTuple):
    """Of the direct and the indirect test."""

    direct: float
    indirect: float


def verify_cell(
    obs: Readings,
    claim: Claim,
    options: ClaimOptions,
    rng: np.random.Generator,
    posterior: Posterior | None = None,
) -> CellVerdict:
    """Both tests of a claim; the verdict is open until the p-values of all claims are adjusted.

    `posterior` is that of these readings and the prior, where it is known.
    """
    if why := too_few(obs, obs.usable()):
        return undecided_verdict(obs.cell, len(obs), claim, why)
    test = _claim_test(obs, claim, options.prior, rng)
    if test is None:
        why = f"fewer than {FEWEST_BLOCKS} locations with a level"
        return undecided_verdict(obs.cell, len(obs), claim, why)
    posterior = posterior or locate(obs, options.prior)
    followed: Followed = "indirect" if observable(posterior) else "direct"
    model = _p_values(test, trusting=True)
    p_values = model if options.stationary else _p_values(test, trusting=False)
    tails = test.indirect.tails(test.walk.level_dbm[:, None], trusting=options.stationary)
    residuals = test.direct.residuals(test.walk.level_dbm)
    power = tuple(detectable(test, options.p_fa, rng, trusting=options.stationary))
    tests = (normality(residuals, limit, rng) for limit in (None, _CUT_SIGMAS))
    return CellVerdict(
        obs.cell,
        len(obs),
        claim,
        "cannot tell",
        (_recommendation(followed), *_censoring(obs)),
        followed=followed,
        p=p_values.indirect if followed == "indirect" else p_values.direct,
        p_direct=p_values.direct,
        p_indirect=p_values.indirect,
        p_direct_model=model.direct,
        p_indirect_model=model.indirect,
        level=1.0 - float(tails[0]),
        distance_m=distance_m(test),
        best_deg=posterior.place.first_deg,
        power=power,
        normality=tuple(result for result in tests if result),
    )


def undecided_verdict(
    cell: str, n: int, claim: Claim, why: str, error: str | None = None
) -> CellVerdict:
    """A claim that cannot be tested, or whose test was ended by an error of the program."""
    return CellVerdict(cell, n, claim, "cannot tell", (why,), error=error)


def blocks_of(obs: Readings) -> Blocks:
    """Blocks of readings, without those censored or near a censored one.

    There only the high levels are left, which bias the tests.
    """
    gathered = blocks(obs.usable(), _MOST_BLOCKS)
    return gathered.clear_of_censored() if len(gathered.censored.places) else gathered


def observable(posterior: Posterior) -> bool:
    """Whether the walk bounds the position; else the posterior depends on the search limit."""
    return not posterior.at_limit


def _claim_test(
    obs: Readings, claim: Claim, prior: Prior, rng: np.random.Generator
) -> ClaimTest | None:
    gathered = blocks_of(obs)
    if len(gathered) < FEWEST_BLOCKS:
        return None
    place = Places.of_degrees(claim.lat_deg, claim.lon_deg, utm=obs.utm)
    # the lasting part of the receiver's error displaces a true claim as well
    lasting_m = float(np.median(gathered.places.sigma_m))
    claimed = around(place, float(np.hypot(claim.sigma_m, lasting_m)))
    return claim_test(prepare_walk(gathered, prior), claimed, rng)


def _p_values(test: ClaimTest, *, trusting: bool) -> PValues:
    level_dbm = test.walk.level_dbm[:, None]
    return PValues(
        float(test.p_direct(level_dbm, trusting=trusting)[0]),
        float(test.p_indirect(level_dbm, trusting=trusting)[0]),
    )


def _recommendation(followed: Followed) -> str:
    if followed == "direct":
        return "the walk does not bound the position: the direct test is followed"
    return (
        "the walk bounds the position: the indirect test is followed, which is then at least as "
        "good"
    )


def _censoring(obs: Readings) -> list[str]:
    n = int(np.count_nonzero(obs.limit))
    if not n:
        return []
    return [f"{n} readings at the end of the modem's scale, and those near them, were left out"]
