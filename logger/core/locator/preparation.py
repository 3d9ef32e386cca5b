"""From the readings of a cell to what is searched: checks, symmetry, blocks, reach."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.errors import EstimationError
from logger.core.locator.observables import Observables, observables
from logger.core.locator.offsets import first_look
from logger.core.locator.quadtree import Effort
from logger.core.locator.search import Walk
from logger.core.locator.symmetry import snap_to_curve
from logger.core.locator.timing_advance import timing_of
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.prior import Prior
from logger.core.readings import CELL_REACH_M, Readings

COARSE_BLOCKS = 80
"""Blocks of the coarse search: its time grows with their square."""

ORIGINS = ((0.5, 0.5), (0.25, 0.75), (0.75, 0.25))
"""Grids of coarse blocks besides the usual one: which readings share a block decides as much as the
errors of the levels. All blocks have the first of them as well."""

MOST_MODEMS = 20
"""A block has readings of one modem: with more, each has less than four blocks."""


class LocatorInput(NamedTuple):
    """The walk to search, the prior to report, and what has been subtracted from all levels.

    `prior` reaches as far as the timing advances; that of `walk` is `mean_dbm` lower, as the
    levels are, and has offsets of modems in its own units (`offsets.first_look`). `seen` is what
    the levels show without a model, `outside_share` as in `Posterior`.
    """

    walk: Walk
    prior: Prior
    mean_dbm: float
    n_modems: int
    strongest: Readings
    seen: Observables
    outside_share: float | None = None

    def everywhere(self) -> "LocatorInput":
        """The same without the area in which the transmitter is said to stand."""
        prior = replace(self.prior, area=None)
        walk_prior = replace(self.walk.prior, area=None)
        return self._replace(prior=prior, walk=self.walk._replace(prior=walk_prior))


def prepare(obs: Readings, prior: Prior, effort: Effort) -> LocatorInput:
    """Gather the usable readings of a cell into blocks.

    Raises `EstimationError` without a level inside the modem's scale.
    """
    n_modems = obs.n_modems
    if prior.area is not None:
        prior = replace(prior, area=prior.area.at([obs.places]))
    obs = of_most_heard_modems(_near_the_middle(obs.usable()))
    limit = obs.limit
    if not np.any(limit == 0):
        raise EstimationError("there is no reading of this cell within the modem's scale")
    strongest = obs.strongest
    obs = snap_to_curve(obs)
    seen = observables(obs)  # a mirror image is as far away
    timing = timing_of(obs, prior.height_m)
    if timing is not None:
        prior = replace(prior, reach_m=max(prior.reach_m, timing.reach_m))
    # sums of squares of small numbers keep their digits
    mean_dbm = float(np.mean(obs.level_dbm))
    centred = replace(obs, level_dbm=obs.level_dbm - mean_dbm, known_limit=limit)
    walk_prior = replace(prior, p0_dbm=prior.p0_dbm - mean_dbm)
    walk = _on_one_scale(_in_blocks(centred, walk_prior, effort), centred)
    return LocatorInput(walk._replace(timing=timing), prior, mean_dbm, n_modems, strongest, seen)


def _near_the_middle(obs: Readings) -> Readings:
    # a fix that has no cell in common with the middle one is an error
    if not len(obs):
        return obs
    away_m = np.hypot(obs.x_m - np.median(obs.x_m), obs.y_m - np.median(obs.y_m))
    is_near = away_m < 2.0 * CELL_REACH_M
    return obs if np.all(is_near) else obs.part(is_near)


def of_most_heard_modems(obs: Readings) -> Readings:
    """The readings of the `MOST_MODEMS` that have most levels within their scale."""
    if obs.modem is None or np.count_nonzero(np.bincount(obs.modem)) <= MOST_MODEMS:
        return obs
    n_levels = np.bincount(obs.modem[obs.limit == 0], minlength=obs.n_modems)
    most_heard = np.argsort(-n_levels, kind="stable")[:MOST_MODEMS]
    return obs.part(np.isin(obs.modem, most_heard))


def _in_blocks(obs: Readings, prior: Prior, effort: Effort) -> Walk:
    fine = blocks(obs, effort.most_blocks)
    coarse = blocks(obs, COARSE_BLOCKS) if len(fine) > COARSE_BLOCKS else fine
    shifted = tuple(blocks(obs, COARSE_BLOCKS, origin) for origin in ORIGINS[: effort.more_grids])
    fine_shifted: tuple[Blocks, ...] = ()
    if coarse is not fine and len(fine) < np.count_nonzero(obs.limit == 0):
        origins = ORIGINS[: min(effort.more_grids, 1)]
        fine_shifted = tuple(blocks(obs, effort.most_blocks, one) for one in origins)
    return Walk(fine, coarse, prior, effort, shifted=shifted, fine_shifted=fine_shifted)


def _on_one_scale(walk: Walk, obs: Readings) -> Walk:
    """Censored readings of all modems are put on the scale of the first."""
    if obs.n_modems == 1:
        return walk
    prior, censored = first_look(obs, walk.coarse, walk.prior)
    fine = replace(walk.blocks, censored=censored)
    coarse = replace(walk.coarse, censored=censored) if walk.is_searched_twice else fine
    shifted = tuple(replace(grid, censored=censored) for grid in walk.shifted)
    of_fine = tuple(replace(grid, censored=censored) for grid in walk.fine_shifted)
    return Walk(fine, coarse, prior, walk.effort, shifted=shifted, fine_shifted=of_fine)
