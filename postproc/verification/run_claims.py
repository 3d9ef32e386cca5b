"""Every claim about the cells of a run, with the false discovery rate controlled.

Over m claims the p-values are adjusted by Benjamini and Hochberg (J. R. Statist. Soc. B 57(1),
1995): of the claims rejected at most the share `p_fa` is rejected wrongly, on average. A claim that
is not rejected is "consistent" only where the walk would have noticed some displacement in at least
half of the directions; else the walk could not have rejected anything.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.prior import Prior
from logger.core.places import Places, Track
from logger.core.readings import Readings
from logger.core.runfile import Run
from postproc.cell_estimation import too_few
from postproc.cell_work import Failure, attempt
from postproc.progress import Progress
from postproc.result import Result
from postproc.scan_counts import observed_cells, scans_of, too_rarely
from postproc.verification.claim_test import ClaimTest, around, claim_test, prepare_walk
from postproc.verification.claims import Claim, away_m, swap_hint
from postproc.verification.normality import normality
from postproc.verification.verdicts import CellVerdict, Verdict, Verified
from postproc.walk import observe_run

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
    obs: Readings,
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


def blocks_of(obs: Readings) -> Blocks:
    """Blocks of readings, without those censored or near a censored one.

    There only the high levels are left, which bias the tests.
    """
    gathered = blocks(obs.usable(), _MOST_BLOCKS)
    return gathered.clear_of_censored() if len(gathered.censored.places) else gathered


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


def _censoring(obs: Readings) -> list[str]:
    n = int(np.count_nonzero(obs.limit))
    if not n:
        return []
    return [f"{n} readings at the end of the modem's scale, and those near them, were left out"]


SEED = 20_143_774
"""Of the random numbers: the same run and claims give the same verdicts."""

_MAP_M = 100_000.0
"""Within a few of these a UTM zone is true to a thousandth; beyond, distances are geodesic."""


def verify_claims(
    run: Run,
    claims: Sequence[Claim],
    p_fa: float,
    prior: Prior,
    only: Sequence[str] | None = None,
    *,
    is_simulated: bool = False,
    result: Result | None = None,
    progress: Progress | None = None,
) -> Verified:
    """Verdicts on all claims about the cells of a run, or about the cells in `only`.

    `is_simulated`: the noise is known to be stationary, as that of a simulation is. `result` is
    that of `smooth` for this run and prior: its posteriors are not computed again.
    Raises `ConfigError` for a cell that was not observed and for a rate outside 0 to 0.5.
    """
    if not 0.0 < p_fa <= 0.5:
        raise ConfigError(f"a false-alarm rate lies between 0 and 0.5, not at {p_fa:g}")
    observed = result.runs[0] if result else observe_run(run)
    posteriors = {cell.cell: cell.posterior for cell in result.cells} if result else {}
    cells = observed.observations.cells if observed.observations else ()
    by_name = {obs.cell: obs for obs in cells}
    rarely = {cell: why for cell, n in scans_of([run]).items() if (why := too_rarely(n))}
    options = ClaimOptions(p_fa, prior, stationary=is_simulated)
    pairs = _pairs(run, claims)
    walk_deg = _middle_deg(observed.observations.track) if observed.observations else None

    def test(i: int, cell: str, claim: Claim) -> CellVerdict:
        obs = by_name.get(cell)
        if cell in rarely:
            return undecided_verdict(cell, 0 if obs is None else len(obs), claim, rarely[cell])
        if obs is None:
            why = "none of its readings has both a level and a position"
            return undecided_verdict(cell, 0, claim, why)
        rng = np.random.default_rng([SEED, i])
        return verify_cell(obs, claim, options, rng, posteriors.get(cell))

    def on_earth(verdict: CellVerdict) -> CellVerdict:
        return verdict if walk_deg is None else _geodesic(verdict, walk_deg)

    def test_or_why_not(i: int, cell: str, claim: Claim) -> CellVerdict:
        verdict = attempt(cell, "the test of its claim", lambda: on_earth(test(i, cell, claim)))
        if not isinstance(verdict, Failure):
            return verdict
        n = len(by_name[cell]) if cell in by_name else 0
        return undecided_verdict(cell, n, claim, verdict.reason, verdict.error)

    every = observed_cells([run], only)
    names = [cell for cell, _ in pairs]
    tests = (test_or_why_not(i, *pair) for i, pair in enumerate(pairs))
    verdicts = list(progress(tests, "verifying", len(names), names) if progress else tests)
    return Verified(
        p_fa,
        _adjust(verdicts, p_fa),
        tuple(cell for cell in every if cell not in {*names, *rarely}),
        observed.warnings,
        tuple(cell for cell in every if cell in rarely),
    )


def benjamini_hochberg(p: FloatArray) -> FloatArray:
    """Adjusted p-values, shape (m,) as `p`."""
    order = np.argsort(p)[::-1]
    rank = np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum.accumulate(p[order] * len(p) / rank)
    return np.minimum(adjusted, 1.0)


def _pairs(run: Run, claims: Sequence[Claim]) -> list[tuple[str, Claim]]:
    """Each claim with its cell; a claim without one is about every cell."""
    observed = observed_cells([run], [claim.cell for claim in claims if claim.cell] or None)
    return [
        (cell, claim) for claim in claims for cell in ([claim.cell] if claim.cell else observed)
    ]


def _middle_deg(track: Track) -> tuple[float, float]:
    """Latitude and longitude of the middle of the walk."""
    return track.utm.to_latlon(float(np.median(track.x_m)), float(np.median(track.y_m)))


def _geodesic(verdict: CellVerdict, walk_deg: tuple[float, float]) -> CellVerdict:
    """The verdict with a distance that is true off the map, and a hint for a claim far away."""
    claim = verdict.claim
    if verdict.distance_m is not None and verdict.distance_m > _MAP_M:
        verdict = replace(verdict, distance_m=away_m((claim.lat_deg, claim.lon_deg), walk_deg))
    hint = swap_hint(claim, walk_deg)
    return replace(verdict, reasons=(hint, *verdict.reasons)) if hint else verdict


def _adjust(verdicts: Sequence[CellVerdict], p_fa: float) -> tuple[CellVerdict, ...]:
    """The verdicts by their adjusted p-values; a test that failed counts, and rejects nothing."""
    tested = [i for i, verdict in enumerate(verdicts) if verdict.p is not None]
    n_failed = sum(verdict.error is not None for verdict in verdicts)
    q = benjamini_hochberg(np.array([*(verdicts[i].p for i in tested), *[1.0] * n_failed], float))
    q_of = dict(zip(tested, q.tolist(), strict=False))
    return tuple(
        _decide(verdict, q_of[i], p_fa) if i in q_of else verdict
        for i, verdict in enumerate(verdicts)
    )


def _decide(undecided_yet: CellVerdict, q: float, p_fa: float) -> CellVerdict:
    """The verdict by the adjusted p-value and the power of the test."""
    power, p = undecided_yet.power, undecided_yet.p
    noticed = [m for m in undecided_yet.detectable_m if m is not None]
    verdict: Verdict = "consistent"
    if q <= p_fa:
        verdict = "rejected"
        why = f"levels like these are received from the claimed position with probability {p:.2g}"
    elif 2 * len(noticed) < len(power):
        verdict = "cannot tell"
        reach = f"no displacement up to {power[0].limit_m:.0f} m"
        why = f"in most directions this walk would have noticed {reach}"
    else:
        span = f"{min(noticed):.0f} to {max(noticed):.0f} m"
        why = f"a displacement of {span}, by direction, would have been noticed"
        if blind := len(power) - len(noticed):
            why += f"; in {blind} of {len(power)} directions none would"
    return replace(undecided_yet, verdict=verdict, q=q, reasons=(why, *undecided_yet.reasons))
