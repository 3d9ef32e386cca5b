"""Every claimed cell of a run: verdict, power and recommendation, with false discoveries
controlled.

The report's finding decides which test is followed: the indirect one, at least as good, where the
position can be observed, else the direct one. A posterior says what is observed even where it names
no single place, so only one whose search had to end before its mass did is not enough. Of 161
measured walks the indirect test rejects fewer true places than the direct one and, displaced by
five times the distance, four times as many false ones.

Over m claims the p-values of the tests followed are adjusted by Benjamini and Hochberg (J. R.
Statist. Soc. B 57(1), 1995): of the claims rejected at most the share `p_fa` is rejected wrongly,
on average. Not to be rejected says little of a walk that could reject nothing: "consistent" is said
only where in half of the directions some displacement would have been noticed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from logger.core.identities import FEWEST_SCANS
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations, Track
from logger.core.runfile import Run
from postproc.cell_estimation import too_few
from postproc.scan_counts import scans_of, too_rarely
from postproc.smoothing import observed_cells
from postproc.verification.claim_test import ClaimTest, around, claim_test, listened
from postproc.verification.claims import Claim, away_m, swapped
from postproc.verification.clone_test import Sites, between_two, within_one
from postproc.verification.normality import Normality, normality
from postproc.verification.power import Detectable, detectable, distance_m
from postproc.walk import observe_run

Verdict = Literal["consistent", "rejected", "cannot tell"]
Followed = Literal["direct", "indirect"]

FEWEST_BLOCKS = 16
"""Fewer places leave too little to judge the noise by, once the claim and its displacements are
fitted.
"""

_MAP_M = 100_000.0
"""A UTM zone is true for a few of these."""
_MOST_BLOCKS = 80
_CUT_SIGMAS = 3.0
_SEED = 20_143_774


@dataclass(frozen=True, slots=True)
class CellVerdict:
    """One claim about one cell.

    `p` is that of the test followed, `q` the same adjusted for the number of claims. `p_direct` and
    `p_indirect` are what the verdict goes by; `p_direct_model` and `p_indirect_model` trust the
    noise to be stationary, which that of a simulated run is: then they are the same. `level` is
    that of the smallest highest-density region of the posterior that holds the claim, `distance_m`
    the claim's from the walk, `normality` that of the whitened residuals at the claim, of all and
    of those within 3 sigma. Values are None where they cannot be had, and `reasons` say why.
    """

    cell: str
    n: int
    claim: Claim
    verdict: Verdict
    reasons: tuple[str, ...]
    followed: Followed | None = None
    p: float | None = None
    q: float | None = None
    p_direct: float | None = None
    p_indirect: float | None = None
    p_direct_model: float | None = None
    p_indirect_model: float | None = None
    level: float | None = None
    distance_m: float | None = None
    best_deg: tuple[float, float] | None = None
    power: tuple[Detectable, ...] = ()
    normality: tuple[Normality, ...] = ()

    @property
    def detectable_m(self) -> list[float | None]:
        """Smallest displacement that the test followed would have rejected with 95 %, by
        direction.
        """
        return [
            one.indirect_m if self.followed == "indirect" else one.direct_m for one in self.power
        ]


@dataclass(frozen=True, slots=True)
class Verified:
    """What a run says of claims; `without_claim` are cells heard that nobody claims anything about:
    no alarm.

    `heard_once` are cells named by one scan only, or never surely: nothing is said of them.
    """

    p_fa: float
    cells: tuple[CellVerdict, ...]
    without_claim: tuple[str, ...]
    warnings: tuple[str, ...]
    heard_once: tuple[str, ...] = ()


class Verification:
    """All claims of a run about its cells, or about those named in `only`.

    Raises `ConfigError` for a cell that was not heard or a rate that is none.
    """

    def __init__(
        self,
        run: Run,
        claims: Sequence[Claim],
        p_fa: float,
        prior: Prior,
        only: Sequence[str] | None = None,
    ) -> None:
        if not 0.0 < p_fa <= 0.5:
            raise ConfigError(f"a false-alarm rate lies between 0 and 0.5, not at {p_fa:g}")
        heard = observed_cells([run], [claim.cell for claim in claims if claim.cell] or None)
        every = observed_cells([run], only)
        observed = observe_run(run)
        observations, self.warnings = observed.observations, list(observed.warnings)
        self.known = {obs.cell: obs for obs in observations.cells} if observations else {}
        self.walk_deg = _middle_deg(observations.track) if observations else None
        self.pairs = [
            (cell, claim)
            for claim in claims
            for cell in ([claim.cell] if claim.cell else list(heard))
            if cell is not None
        ]
        self.p_fa, self.prior, self.stationary = p_fa, prior, bool(run.meta.truth)
        self._rarely = {cell: why for cell, n in scans_of([run]).items() if (why := too_rarely(n))}
        self.heard_once = tuple(cell for cell in every if cell in self._rarely)
        claimed = {cell for cell, _ in self.pairs}
        self.without_claim = tuple(
            cell for cell in every if cell not in claimed and cell not in self._rarely
        )

    def each(self) -> Iterator[CellVerdict]:
        """Tests before their p-values are adjusted."""
        for i, (cell, claim) in enumerate(self.pairs):
            rng = np.random.default_rng([_SEED, i])
            obs = self.known.get(cell)
            if why := self._rarely.get(cell):
                found = CellVerdict(
                    cell, 0 if obs is None else len(obs), claim, "cannot tell", (why,)
                )
            else:
                found = verify_cell(
                    cell, obs, claim, self.p_fa, self.prior, rng, stationary=self.stationary
                )
            yield _on_the_earth(found, self.walk_deg) if self.walk_deg else found

    def adjusted(self, found: Sequence[CellVerdict]) -> Verified:
        """The verdicts, false discoveries controlled."""
        tested = [i for i, one in enumerate(found) if one.p is not None]
        q = benjamini_hochberg(np.array([found[i].p for i in tested], float))
        after = list(found)
        for i, value in zip(tested, q.tolist(), strict=True):
            after[i] = _judged(found[i], value, self.p_fa)
        return Verified(
            self.p_fa, tuple(after), self.without_claim, tuple(self.warnings), self.heard_once
        )


def _on_the_earth(found: CellVerdict, walk_deg: tuple[float, float]) -> CellVerdict:
    """The verdict with a distance that is true far off the map too, and the question that a far
    claim deserves.
    """
    claim = found.claim
    if found.distance_m is not None and found.distance_m > _MAP_M:
        found = replace(found, distance_m=away_m((claim.lat_deg, claim.lon_deg), walk_deg))
    doubt = swapped(claim, walk_deg)
    return replace(found, reasons=(doubt, *found.reasons)) if doubt else found


def _middle_deg(track: Track) -> tuple[float, float]:
    return track.utm.to_latlon(float(np.median(track.x_m)), float(np.median(track.y_m)))


def benjamini_hochberg(p: FloatArray) -> FloatArray:
    """Adjusted p-values, shape (m,)."""
    order = np.argsort(p)[::-1]
    rank = np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum.accumulate(p[order] * len(p) / rank)
    return np.minimum(adjusted, 1.0)


def verify_cell(
    cell: str,
    obs: CellObservations | None,
    claim: Claim,
    p_fa: float,
    prior: Prior,
    rng: np.random.Generator,
    *,
    stationary: bool = False,
) -> CellVerdict:
    """Both tests of a claim, not yet adjusted; `stationary` where the noise is known to be, as in a
    simulation.
    """
    if obs is None:
        return CellVerdict(
            cell, 0, claim, "cannot tell", ("none of its readings has both a level and a position",)
        )
    if why := too_few(obs):
        return CellVerdict(cell, len(obs), claim, "cannot tell", (why,))
    test = _prepared(obs, claim, prior, rng)
    if test is None:
        return CellVerdict(
            cell,
            len(obs),
            claim,
            "cannot tell",
            (f"fewer than {FEWEST_BLOCKS} places with a level",),
        )
    posterior = locate(obs, prior)
    level_dbm = test.walk.level_dbm[:, None]
    p = {
        trusting: (
            float(test.p_direct(level_dbm, trusting=trusting)[0]),
            float(test.p_indirect(level_dbm, trusting=trusting)[0]),
        )
        for trusting in {stationary, True}
    }
    residuals = test.direct.residuals(test.walk.level_dbm)
    followed: Followed = "indirect" if observable(posterior) else "direct"
    return CellVerdict(
        cell,
        len(obs),
        claim,
        "cannot tell",
        (_recommendation(followed), *_censoring(obs)),
        followed,
        p[stationary][followed == "indirect"],
        None,
        *p[stationary],
        *p[True],
        1.0 - float(test.indirect.tails(level_dbm, trusting=stationary)[0]),
        distance_m(test),
        obs.utm.to_latlon(posterior.x_m, posterior.y_m),
        tuple(detectable(test, p_fa, rng, trusting=stationary)),
        tuple(
            found for limit in (None, _CUT_SIGMAS) if (found := normality(residuals, limit, rng))
        ),
    )


def sites_of(
    run: Run, cell: str, other: Run | None, prior: Prior
) -> tuple[Sites | None, str | None]:
    """One place or two for a cell of a run, or of two runs; None and why where that cannot be
    told.
    """
    for one in (run, other):
        if one is not None and (why := too_rarely(scans_of([one]).get(cell, FEWEST_SCANS))):
            return None, why
    rng = np.random.default_rng(_SEED)
    walks = [_heard(one, cell) for one in (run, other) if one is not None]
    if any(obs is None for obs in walks):
        return None, "the cell was not heard where the walker knew the place"
    found = [obs for obs in walks if obs is not None]
    if other is None:
        if why := too_few(found[0]):
            return None, why
        sites = within_one(found[0], locate(found[0], prior), rng)
        return sites, None if sites else "one place leaves no more unexplained than shadowing does"
    second = _in_zone_of(found[0], found[1])
    first, last = blocks_of(found[0]), blocks_of(second)
    if min(len(first), len(last)) < FEWEST_BLOCKS:
        return None, f"fewer than {FEWEST_BLOCKS} places with a level"
    return between_two(listened(first, prior), listened(last, prior), found[0].utm, rng), None


def _heard(run: Run, cell: str) -> CellObservations | None:
    observed_cells([run], [cell])
    observations = observe_run(run).observations
    return (
        next((obs for obs in observations.cells if obs.cell == cell), None)
        if observations
        else None
    )


def _in_zone_of(one: CellObservations, other: CellObservations) -> CellObservations:
    if one.utm == other.utm:
        return other
    x_m, y_m = one.utm.to_xy_arrays(*other.utm.to_latlon_arrays(other.x_m, other.y_m))
    return replace(other, utm=one.utm, x_m=x_m, y_m=y_m)


def blocks_of(obs: CellObservations) -> Blocks:
    """Without what lies at the end of the modem's scale or near it: there only the high levels are
    kept.
    """
    gathered = blocks(obs.usable(), _MOST_BLOCKS)
    return gathered.clear_of_censored() if len(gathered.censored.x_m) else gathered


def _prepared(
    obs: CellObservations, claim: Claim, prior: Prior, rng: np.random.Generator
) -> ClaimTest | None:
    gathered = blocks_of(obs)
    if len(gathered) < FEWEST_BLOCKS:
        return None
    x_m, y_m = obs.utm.to_xy(claim.lat_deg, claim.lon_deg)
    # what lasts of the receiver's error moves a true claim as well
    lasting_m = float(np.median(gathered.position_sigma_m))
    return claim_test(
        listened(gathered, prior), around(x_m, y_m, float(np.hypot(claim.sigma_m, lasting_m))), rng
    )


def observable(posterior: Posterior) -> bool:
    """Whether the walk bounds the position: else the posterior depends on where its search
    ended.
    """
    return not posterior.at_limit


def _recommendation(followed: Followed) -> str:
    if followed == "direct":
        return "the walk does not bound the position: the direct test is followed"
    return "the walk bounds the position: the indirect test is followed, which is then at least as good"


def _censoring(obs: CellObservations) -> list[str]:
    n = int(np.count_nonzero(obs.limit))
    return (
        [f"{n} readings at the end of the modem's scale, and those near them, were left out"]
        if n
        else []
    )


def _judged(found: CellVerdict, q: float, p_fa: float) -> CellVerdict:
    noticed = [m for m in found.detectable_m if m is not None]
    if q <= p_fa:
        verdict: Verdict = "rejected"
        why = f"levels like these are heard past the claimed place with probability {found.p:.2g}"
    elif 2 * len(noticed) < len(found.power):
        verdict, limit_m = "cannot tell", found.power[0].limit_m
        why = (
            f"in most directions this walk would have noticed no displacement up to {limit_m:.0f} m"
        )
    else:
        verdict = "consistent"
        why = f"a displacement of {min(noticed):.0f} to {max(noticed):.0f} m, by direction, would have been noticed"
        if len(noticed) < len(found.power):
            why += f"; in {len(found.power) - len(noticed)} of {len(found.power)} directions none would"
    return replace(found, verdict=verdict, q=q, reasons=(why, *found.reasons))
