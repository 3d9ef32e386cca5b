"""One transmitter or two for a cell of a run, or of two runs: the signature of a cloned cell.

The tests are the locator's own (`logger.core.locator.two_source_test`). A run is divided in two by
the ground, and each part located alone; of two runs each is located alone, and both as one walk.

Both are calibrated: walks past one transmitter are simulated from the estimate with the noise of
the walk, and p is the share of them whose factor is as large. The simulation ends early when
several are (Besag & Clifford, Biometrika 78(2), 1991).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from msgspec import UNSET

from logger.core.cell_names import FEWEST_SCANS
from logger.core.errors import ConfigError
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.two_source_test import (
    FEWEST_READINGS,
    Division,
    divide,
    divide_in_time,
)
from logger.core.model.noise import independent_variance, shadowing
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import CELL_REACH_M, Readings
from logger.core.runfile import Run
from postproc.cell_work import Failure, attempt
from postproc.ground import apart_m
from postproc.multi_run import merge, modems_of
from postproc.scan_counts import observed_cells, scans_of, too_rarely
from postproc.smoothing import too_few
from postproc.verification.claims import SiteVerdict
from postproc.walk import observe_run

DRAWS = 39
"""Walks simulated past one transmitter: p can then be as small as 0.025."""
_SEED = 20_143_774
"""Of the random numbers: the same run and claims give the same verdicts."""
_ENOUGH = 4
"""So many walks with a factor as large decide that it is not significant."""
_MOST_READINGS = 800
"""Of a simulated walk: its covariance grows with their square."""
_FEWEST_OF_TWO = FEWEST_READINGS // 2
"""Levels of each of two runs, as of the parts of one."""
_Divide = Callable[[Readings, Posterior], Division | None]


@dataclass(frozen=True, slots=True)
class Sites:
    """Log Bayes factor of two positions against one, and the chance of one as large by noise.

    `draws` walks past one transmitter were simulated for `p`.
    """

    log_factor: float
    p: float
    draws: int
    one: Places
    other: Places


def within_one(
    obs: Readings, posterior: Posterior, rng: np.random.Generator, draws: int = DRAWS
) -> Sites | None:
    """Test of one run.

    None if one position leaves nothing to explain, or the walk has no two strong points.
    """
    return _sites_by(divide, obs, posterior, rng, draws)


def between_two(
    obs: Readings, posterior: Posterior, rng: np.random.Generator, draws: int = DRAWS
) -> Sites | None:
    """Test of two runs on one scale, numbered; None where one of them has too few places."""
    return _sites_by(divide_in_time, obs, posterior, rng, draws)


def _sites_by(
    divided: _Divide, obs: Readings, posterior: Posterior, rng: np.random.Generator, draws: int
) -> Sites | None:
    division = divided(obs, posterior)
    if division is None:
        return None
    p, done = 1.0, 0
    if division.log_factor > 0.0:
        usable = obs.usable()
        simulate = _past_one_source(_thin(usable.part(usable.limit == 0)), posterior)
        p, done = _chance(divided, simulate, posterior, division.log_factor, rng, draws)
    return Sites(division.log_factor, p, done, division.one, division.other)


def _past_one_source(
    obs: Readings, posterior: Posterior
) -> Callable[[np.random.Generator], Readings]:
    """Draws levels past the one transmitter of a posterior."""
    x_m, y_m, p0_dbm, eta = posterior.modes[0].state.tolist()
    dx_m, dy_m, height_m = obs.x_m - x_m, obs.y_m - y_m, posterior.prior.height_m
    distance_db = log_distance_db(dx_m, dy_m, height_m, obs.position_sigma_m)
    expected_dbm = level_dbm(p0_dbm, eta, distance_db)
    apart_m = np.hypot(obs.x_m[:, None] - obs.x_m, obs.y_m[:, None] - obs.y_m)
    sigma_db = posterior.sigma_db
    weighed = zip(posterior.noise_probability, posterior.prior.hypotheses, strict=True)
    k = sum(p * shadowing(apart_m, one) for p, one in weighed if p > 0.0)
    k += np.eye(len(k)) * independent_variance(1.0, posterior.white_share, sigma_db)
    root = np.asarray(sigma_db * np.linalg.cholesky(k), float)
    no_limit = np.zeros(len(obs), np.int64)

    def simulate(rng: np.random.Generator) -> Readings:
        noise_db = root @ rng.normal(size=len(obs))
        return replace(obs, level_dbm=expected_dbm + noise_db, known_limit=no_limit)

    return simulate


def _chance(
    divided: _Divide,
    simulate: Callable[[np.random.Generator], Readings],
    posterior: Posterior,
    log_factor: float,
    rng: np.random.Generator,
    draws: int,
) -> tuple[float, int]:
    """Share of simulated walks with a factor as large, and their number."""
    n_as_large = done = 0
    while done < draws and n_as_large < _ENOUGH:
        division = divided(simulate(rng), posterior)
        n_as_large += division is not None and division.log_factor >= log_factor
        done += 1
    if n_as_large >= _ENOUGH:
        return n_as_large / done, done
    return (n_as_large + 1.0) / (done + 1.0), done


def _thin(obs: Readings) -> Readings:
    """Every second or third reading of a long walk: a covariance of thousands takes minutes."""
    step = -(-len(obs) // _MOST_READINGS)
    return obs.part(slice(None, None, step)) if step > 1 else obs


def site_verdict(run: Run, cell: str, other: Run | None, prior: Prior, p_fa: float) -> SiteVerdict:
    """The two-site test of a cell.

    Raises `ConfigError` for a cell that a run did not observe, and for runs too far apart.
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
        places=[(at.lat, at.lon) for at in (sites.one.on_map, sites.other.on_map)],
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
    far_m = apart_m([obs.places.on_map for obs in walks])
    if far_m > 2.0 * CELL_REACH_M:
        raise ConfigError(
            f"{cell} is heard {far_m / 1000.0:.0f} km apart, farther than any cell reaches: "
            "these are two transmitters, and no test is needed"
        )
    obs = _as_one(walks, modems_of(runs))
    usable = obs.usable()
    if why := too_few(obs, usable):
        return None, why
    posterior = locate(usable, prior)
    if posterior.offsets is not None:
        usable = replace(usable.on_one_scale(posterior.offsets.mean_db), modem=None)
    rng = np.random.default_rng(_SEED)
    if other is None:
        sites = within_one(usable, posterior, rng)
        return sites, None if sites else "one place leaves no more unexplained than shadowing does"
    counts = [np.count_nonzero(usable.run == k) for k in range(len(runs))]
    if min(counts) < _FEWEST_OF_TWO:
        return None, f"one of the runs has fewer than {_FEWEST_OF_TWO} levels"
    sites = between_two(usable, posterior, rng)
    return sites, None if sites else "one of the runs has too few places"


def _readings(runs: list[Run], cell: str) -> list[Readings]:
    observed = [observe_run(run).observations for run in runs]
    return [obs for each in observed if each for obs in each.cells if obs.cell == cell]


def _as_one(walks: list[Readings], modems: list[int]) -> Readings:
    """The readings of the runs, numbered, in the zone of the first."""
    placed = {
        k: replace(obs, places=obs.places.in_zone(walks[0].utm), run=np.full(len(obs), k, np.int64))
        for k, obs in enumerate(walks)
    }
    return merge(placed, modems)
