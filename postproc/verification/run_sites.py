"""One transmitter or two for a cell of a run, or of two runs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from msgspec import UNSET

from logger.core.errors import ConfigError
from logger.core.identities import FEWEST_SCANS
from logger.core.locator.pipeline import locate
from logger.core.model.prior import Prior
from logger.core.readings import Readings
from logger.core.runfile import Run
from postproc.cell_estimation import too_few
from postproc.cell_work import Failure, attempt
from postproc.multi_run import FARTHEST_KM, in_zone, merge, modems_of, starts_apart_m
from postproc.scan_counts import observed_cells, scans_of, too_rarely
from postproc.verification.cell_claim import FEWEST_BLOCKS, blocks_of
from postproc.verification.claim_test import prepare_walk
from postproc.verification.clone_test import Sites, between_two, within_one
from postproc.verification.run_claims import SEED
from postproc.verification.verdicts import SiteVerdict
from postproc.walk import observe_run

_FAR_M = 10_000.0
"""Between two runs: farther away the places that the test of two runs considers, which are those
around the first, need not hold those of the second. Then both are one walk, which is divided."""


def site_verdict(run: Run, cell: str, other: Run | None, prior: Prior, p_fa: float) -> SiteVerdict:
    """The two-site test of a cell.

    Raises `ConfigError` for a cell that a run did not observe, and for runs so far apart that there
    is nothing to test.
    """
    tested = attempt(cell, "the test for two places", lambda: _sites_of(run, cell, other, prior))
    if isinstance(tested, Failure):
        return SiteVerdict(
            cell=cell,
            verdict="no sign of two places",
            why_not=tested.reason,
            error=tested.error or UNSET,
        )
    sites, why_not = tested
    if sites is None:
        return SiteVerdict(cell=cell, verdict="no sign of two places", why_not=why_not)
    is_double = sites.p <= p_fa and sites.log_factor > 0.0
    return SiteVerdict(
        cell=cell,
        verdict="two places" if is_double else "no sign of two places",
        log_factor=sites.log_factor,
        p=sites.p,
        draws=sites.draws,
        places=sites.places_deg,
    )


def _sites_of(
    run: Run, cell: str, other: Run | None, prior: Prior
) -> tuple[Sites | None, str | None]:
    """None and the reason where the test cannot be made."""
    runs = [run] if other is None else [run, other]
    observed_cells(runs[:1], [cell])
    observed_cells(runs[-1:], [cell])
    for each in runs:
        if why := too_rarely(scans_of([each]).get(cell, FEWEST_SCANS)):
            return None, why
    walks = _readings(runs, cell)
    if len(walks) < len(runs):
        return None, "the cell was not received where the position of the walker is known"
    rng = np.random.default_rng(SEED)
    if other is None:
        return _within_one_walk(walks[0], prior, rng)
    apart_m = starts_apart_m(*(obs.places for obs in walks))
    if apart_m > FARTHEST_KM * 1000.0:
        raise ConfigError(
            f"{cell} is heard {apart_m / 1000.0:.0f} km apart, farther than any cell reaches: "
            "these are two transmitters, and no test is needed"
        )
    walks = [in_zone(obs, walks[0].utm) for obs in walks]
    if apart_m > _FAR_M:
        return _within_one_walk(_as_one(walks, modems_of(runs), prior), prior, rng)
    first, second = (blocks_of(obs) for obs in walks)
    if min(len(first), len(second)) < FEWEST_BLOCKS:
        return None, f"fewer than {FEWEST_BLOCKS} locations with a level"
    return between_two(
        prepare_walk(first, prior), prepare_walk(second, prior), walks[0].utm, rng
    ), None


def _readings(runs: list[Run], cell: str) -> list[Readings]:
    """Readings of the cell in each run that has any with a position."""
    observed = [observe_run(run).observations for run in runs]
    return [obs for each in observed if each for obs in each.cells if obs.cell == cell]


def _as_one(walks: Sequence[Readings], modems: Sequence[int], prior: Prior) -> Readings:
    """Readings of two runs as those of one, with their modems on one scale."""
    usable = merge(dict(enumerate(walks)), modems).usable()
    offsets = locate(usable, prior).offsets
    if offsets is None:
        return usable
    return replace(usable.on_one_scale(offsets.mean_db), modem=None)


def _within_one_walk(
    obs: Readings, prior: Prior, rng: np.random.Generator
) -> tuple[Sites | None, str | None]:
    if why := too_few(obs, obs.usable()):
        return None, why
    sites = within_one(obs, locate(obs, prior), rng)
    return sites, None if sites else "one place leaves no more unexplained than shadowing does"
