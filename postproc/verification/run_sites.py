"""One transmitter or two for a cell of a run, or of two runs: the signature of a cloned cell.

For one run the locator's own test is used (`logger.core.locator.two_source_test`): the walk is
divided in two and each part located alone. Of two runs each is located alone, and both together;
with p the evidence of a run over positions h of prior mass m,

    log factor = log sum_h m p1(h) + log sum_h m p2(h) - log sum_h m p1(h) p2(h)

Both have the same calibration: walks past one transmitter are simulated from the estimate with the
noise of the walk, and p is the share of them whose factor is as large. The simulation ends early
when several are (Besag & Clifford, Biometrika 78(2), 1991).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from msgspec import UNSET

from logger.core.answer import OnMap
from logger.core.arrays import FloatArray
from logger.core.cell_names import FEWEST_SCANS
from logger.core.errors import ConfigError
from logger.core.locator.mixture import log_sum
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.two_source_test import divide
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.noise import independent_variance, shadowing
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.model.prior import Prior
from logger.core.places import Places, Utm
from logger.core.readings import Readings
from logger.core.runfile import Run
from postproc.cell_work import Failure, attempt
from postproc.ground import REACH_M, apart_m
from postproc.multi_run import merge, modems_of
from postproc.scan_counts import observed_cells, scans_of, too_rarely
from postproc.smoothing import too_few
from postproc.verification.likelihood_grid import (
    PreparedWalk,
    calibrate,
    prepare_walk,
    refine,
)
from postproc.verification.verdicts import SiteVerdict
from postproc.walk import observe_run

DRAWS = 39
"""Walks simulated past one transmitter for one run: p can then be as small as 0.025."""

_FEWEST_BLOCKS = 16
"""Fewer blocks leave too few residuals to estimate the noise beside the claim's displacement."""

_MOST_BLOCKS = 80
"""The tests draw thousands of walks over the blocks: more cost time and gain no power."""
_SEED = 20_143_774
"""Of the random numbers: the same run and claims give the same verdicts."""
_ENOUGH = 4
"""So many walks with a factor as large decide that it is not significant."""
_PAIRS = 240
"""Pairs of walks simulated for two runs; each takes far less time than a division."""
_MOST_READINGS = 800
"""Of a simulated walk: its covariance grows with their square."""
_MOST_SQUARES = 1400
"""Of the common grid of two runs."""


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
    division = divide(obs, posterior)
    if division is None:
        return None
    p, done = 1.0, 0
    if division.log_factor > 0.0:
        usable = obs.usable()
        one_source = _OneSource.of(_thin(usable.part(usable.limit == 0)), posterior)
        p, done = _chance(one_source, posterior, division.log_factor, rng, draws)
    return Sites(division.log_factor, p, done, division.one, division.other)


class _OneSource(NamedTuple):
    """Expected levels past the one transmitter of a posterior, and a root of their covariance."""

    obs: Readings
    level_dbm: FloatArray
    root: FloatArray

    @classmethod
    def of(cls, obs: Readings, posterior: Posterior) -> "_OneSource":
        x_m, y_m, p0_dbm, eta = posterior.modes[0].state.tolist()
        dx_m, dy_m, height_m = obs.x_m - x_m, obs.y_m - y_m, posterior.prior.height_m
        distance_db = log_distance_db(dx_m, dy_m, height_m, obs.position_sigma_m)
        apart_m = np.hypot(obs.x_m[:, None] - obs.x_m, obs.y_m[:, None] - obs.y_m)
        sigma_db = posterior.sigma_db
        weighed = zip(posterior.noise_probability, posterior.prior.hypotheses, strict=True)
        k = sum(p * shadowing(apart_m, one) for p, one in weighed if p > 0.0)
        k += np.eye(len(k)) * independent_variance(1.0, posterior.white_share, sigma_db)
        root = np.asarray(sigma_db * np.linalg.cholesky(k), float)
        return cls(obs, level_dbm(p0_dbm, eta, distance_db), root)

    def simulate(self, rng: np.random.Generator) -> Readings:
        noise_db = self.root @ rng.normal(size=len(self.obs))
        no_limit = np.zeros(len(self.obs), np.int64)
        return replace(self.obs, level_dbm=self.level_dbm + noise_db, known_limit=no_limit)


def _chance(
    source: _OneSource,
    posterior: Posterior,
    log_factor: float,
    rng: np.random.Generator,
    draws: int,
) -> tuple[float, int]:
    """Share of simulated walks with a factor as large, and their number."""
    n_as_large = done = 0
    while done < draws and n_as_large < _ENOUGH:
        division = divide(source.simulate(rng), posterior)
        n_as_large += division is not None and division.log_factor >= log_factor
        done += 1
    if n_as_large >= _ENOUGH:
        return n_as_large / done, done
    return (n_as_large + 1.0) / (done + 1.0), done


def _thin(obs: Readings) -> Readings:
    """Every second or third reading of a long walk: a covariance of thousands takes minutes."""
    step = -(-len(obs) // _MOST_READINGS)
    return obs.part(slice(None, None, step)) if step > 1 else obs


def between_two(
    one: PreparedWalk, other: PreparedWalk, utm: Utm, rng: np.random.Generator
) -> Sites:
    """Test of two runs in the same zone."""
    walks = one, other
    field = one.field.with_walk(other.blocks, other.field.whiteners)
    fine = refine(field, other.level_dbm[:, None], _MOST_SQUARES)
    fields = one.field.with_squares(fine.squares), fine
    log_mass = fine.log_mass - log_sum(fine.log_mass)
    log_p = [
        field.posterior_ratio(field.evaluate(walk.level_dbm[:, None])[0], tempered=True)
        for field, walk in zip(fields, walks, strict=True)
    ]
    joint = log_mass + log_p[0][:, 0] + log_p[1][:, 0]
    p = np.exp(joint - log_sum(joint))
    at = Places.of(*fine.squares[:2, rng.choice(len(p), _PAIRS, p=p / np.sum(p))])
    simulated = [
        field.posterior_ratio(field.evaluate(walk.noise.walks(at, rng))[0], tempered=False)
        for field, walk in zip(fields, walks, strict=True)
    ]
    log_factor = float(_log_factor(log_p[0], log_p[1], log_mass)[0])
    by_noise = np.sort(np.exp(-_log_factor(simulated[0], simulated[1], log_mass)))
    chance = float(calibrate(by_noise, np.exp(-np.array([log_factor])))[0])
    best = [int(np.argmax(log[:, 0] + log_mass)) for log in log_p]
    first, second = (Places.of(*fine.squares[:2, k], utm=utm) for k in best)
    return Sites(log_factor, chance, _PAIRS, first, second)


def _log_factor(one: FloatArray, other: FloatArray, log_mass: FloatArray) -> FloatArray:
    """Log factor for walks (h, b), shape (b,)."""
    mass = log_mass[:, None]
    apart = log_sum((mass + one).T) + log_sum((mass + other).T)
    return np.asarray(apart - log_sum((mass + one + other).T), float)


_FAR_M = 10_000.0
"""Between two runs: beyond it places around the first, which the test of two runs considers, need
not hold those of the second. Then both are one walk, which is divided."""


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
        places=[sites.one.first_deg, sites.other.first_deg],
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
    rng = np.random.default_rng(_SEED)
    if other is None:
        return _within_one_walk(walks[0], prior, rng)
    first_deg = [obs.places.first_deg for obs in walks]
    far_m = apart_m([OnMap(lat=lat, lon=lon) for lat, lon in first_deg])
    if far_m > 2.0 * REACH_M:
        raise ConfigError(
            f"{cell} is heard {far_m / 1000.0:.0f} km apart, farther than any cell reaches: "
            "these are two transmitters, and no test is needed"
        )
    utm = walks[0].utm
    walks = [replace(obs, places=obs.places.in_zone(utm)) for obs in walks]
    if far_m > _FAR_M:
        return _within_one_walk(_as_one(walks, modems_of(runs), prior), prior, rng)
    first, second = (_blocks_of(obs) for obs in walks)
    if min(len(first), len(second)) < _FEWEST_BLOCKS:
        return None, f"fewer than {_FEWEST_BLOCKS} locations with a level"
    return between_two(prepare_walk(first, prior), prepare_walk(second, prior), utm, rng), None


def _readings(runs: list[Run], cell: str) -> list[Readings]:
    observed = [observe_run(run).observations for run in runs]
    return [obs for each in observed if each for obs in each.cells if obs.cell == cell]


def _as_one(walks: Sequence[Readings], modems: Sequence[int], prior: Prior) -> Readings:
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


def _blocks_of(obs: Readings) -> Blocks:
    """Blocks of readings, without those censored or near a censored one.

    There only the high levels are left, which bias the tests.
    """
    gathered = blocks(obs.usable(), _MOST_BLOCKS)
    return gathered.clear_of_censored() if len(gathered.censored.places) else gathered
