"""The search over positions in three steps: coarse, weigh the noise, refine.

The desktop takes all three (`pipeline.locate`). The device, the test for two sources and the
offsets of modems use `search_once`, the same steps with one set of blocks.
"""

from math import log
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.joint_evidence import log_weights, log_weights_at
from logger.core.locator.mixture import log_sum
from logger.core.locator.position_evidence import BlocksEvidence, PositionEvidence
from logger.core.locator.quadtree import Effort, PositionPrior, Tree, first_squares
from logger.core.locator.timing_advance import Timing
from logger.core.locator.tree_growth import grow
from logger.core.model.blocks import Blocks
from logger.core.model.noise import Whitener, whiteners
from logger.core.model.prior import Prior
from logger.core.places import Places

_COARSE_SQUARES = 1500
"""Squares of a coarse search before a finer one, which splits what matters again."""
_COARSE_SHARE = 5.0
"""Such a search splits squares with this many times the usual share."""
_QUICK_PART = 10
"""The search under white noise alone uses this part of the squares."""
_LEAST_RATIO = 1e-4
"""Hypotheses this much less likely than the likeliest change no printed digit."""
_HOPELESS_NATS = 10.0
"""Hypotheses worse by this (22 000 to 1) at one position are not tried at others."""
_LIKELY_SHARE = 0.02
"""Of the likeliest hypothesis: the evidence of others is that of one grid."""
_LEAST_MASS = 1e-7
"""Of a square whose evidence is averaged over grids."""
_BEST_SQUARES = 15
"""Squares of each hypothesis at which all blocks decide whether it is plausible."""


class Walk(NamedTuple):
    """What is searched: the walk in `blocks`, and in few `coarse` ones, or the same once more.

    `shifted` are coarse blocks of other grids, `fine_shifted` all blocks.
    """

    blocks: Blocks
    coarse: Blocks
    prior: Prior
    effort: Effort
    timing: Timing | None = None
    shifted: tuple[Blocks, ...] = ()
    fine_shifted: tuple[Blocks, ...] = ()

    @property
    def is_searched_twice(self) -> bool:
        """Whether a finer search follows the coarse one."""
        return self.coarse is not self.blocks


class Noise(NamedTuple):
    """Hypotheses for the fine search, in parts with blocks of their own.

    `log_weight` (c,) has all hypotheses, as in `Tree`; None where no reading is censored.
    """

    parts: list[BlocksEvidence]
    log_weight: FloatArray | None


def search_once(
    blocks: Blocks,
    prior: Prior,
    effort: Effort = Effort(),  # noqa: B008 (frozen)
    timing: Timing | None = None,
    log_weight: FloatArray | None = None,
) -> Tree:
    """Search with one set of blocks; `log_weight` (c,) of all hypotheses if known."""
    walk = Walk(blocks, blocks, prior, effort, timing)
    tree = coarse_search(walk, log_weight)
    return refine(walk, tree, weigh_noise(walk, tree))


def coarse_search(walk: Walk, log_weight: FloatArray | None = None) -> Tree:
    """Step 1: the tree over the coarse blocks.

    Where readings are censored, `log_weight` (c,) of all hypotheses is needed first; by default it
    is found at the position that is best under white noise.
    """
    if log_weight is None and len(walk.blocks.censored.places):
        log_weight = _log_weight_at_first_position(walk)
    numbers = None if log_weight is None else _numbers_within(log_weight, _HOPELESS_NATS)
    effort = walk.effort
    if walk.is_searched_twice:
        share = _COARSE_SHARE * effort.split_share
        effort = effort._replace(most_squares=_COARSE_SQUARES, split_share=share)
    return _search_coarse_blocks(walk, effort, numbers, log_weight)


def weigh_noise(walk: Walk, tree: Tree) -> Noise:
    """Step 2: the hypotheses of the noise that all blocks leave plausible.

    The levels decide where no reading is censored, else the joint evidence of levels and censored
    readings: the levels that remain beside the floor are the high ones.
    """
    if tree.log_weight is None:
        return Noise(_plausible_parts(walk, tree) if walk.is_searched_twice else [], None)
    log_weight = np.full(len(walk.prior.hypotheses), -np.inf)
    log_weight[tree.numbers] = _joint_log_weight(walk, tree)
    if not walk.is_searched_twice:
        return Noise([], log_weight)
    plausible = _numbers_within(log_weight, -log(_LEAST_RATIO))
    shift = np.zeros(len(log_weight))
    return Noise(_parts(walk, whiteners(walk.blocks, walk.prior, plausible), shift), log_weight)


def refine(walk: Walk, tree: Tree, noise: Noise) -> Tree:
    """Step 3: the tree over all blocks under the plausible hypotheses."""
    if not walk.is_searched_twice:
        weights = noise.log_weight
        tree = tree._replace(log_weight=None if weights is None else weights[tree.numbers])
        return _over_grids(walk, tree)
    effort = walk.effort._replace(densest=0)  # the coarse search has split these
    evidence = _evidence(walk, walk.blocks, noise.parts, noise.log_weight, tree.squares)
    tree = grow(evidence.refine(tree, walk.coarse), evidence.split, walk.prior, effort)
    return _over_grids(walk, tree)


def _over_grids(walk: Walk, tree: Tree) -> Tree:
    """The log probability over positions is averaged over grids of the blocks.

    As in a composite likelihood (Varin, Reid & Firth, Statistica Sinica 21, 2011): averaged
    probabilities are as wide as the widest grid's, and 1 m changes which. Of each hypothesis only
    the shape changes, not the evidence.
    """
    if not (walk.shifted or walk.fine_shifted) or len(walk.blocks.censored.places):
        return tree
    mixed, log_p = tree.mixture(walk.prior), tree.evidence.log_p.copy()
    is_coarse = walk.prior.noise_table.is_coarse[tree.numbers] | (not walk.is_searched_twice)
    is_likely = mixed.by_hypothesis > _LIKELY_SHARE * np.max(mixed.by_hypothesis)
    chosen = np.flatnonzero(mixed.probability > _LEAST_MASS)
    position, mass = tree.squares[:2, chosen], tree.log_mass()[chosen]
    for rows, grids in (is_coarse, walk.shifted), (~is_coarse, walk.fine_shifted):
        averaged = np.ix_(np.flatnonzero(rows & is_likely), chosen)
        numbers = tree.numbers[rows & is_likely].tolist()
        if not numbers or not grids:
            continue
        of_grids = [log_p[averaged], *(_log_p(walk, grid, numbers, position) for grid in grids)]
        mean = np.mean(of_grids, axis=0)
        total = log_sum(of_grids[0] + mass) - log_sum(mean + mass)
        log_p[averaged] = mean + total[:, None]
    return tree._replace(evidence=tree.evidence._replace(log_p=log_p))


def _log_p(walk: Walk, grid: Blocks, numbers: list[int], position: FloatArray) -> FloatArray:
    """Log evidence (c, h) of hypotheses with another grid, uncensored."""
    evidence = BlocksEvidence.of(grid, walk.prior, whiteners(grid, walk.prior, numbers))
    return evidence.evaluate(walk.prior, walk.effort.nodes, position, None).log_p


def _evidence(
    walk: Walk,
    blocks: Blocks,
    parts: list[BlocksEvidence],
    log_weight: FloatArray | None,
    tiling: FloatArray,
) -> PositionEvidence:
    """The squares `tiling` (3, h) cover the searched area."""
    where = PositionPrior(blocks, walk.prior, tiling)
    return PositionEvidence(where, parts, walk.prior, walk.effort.nodes, log_weight, walk.timing)


def _parts(walk: Walk, noise: list[Whitener], shift: FloatArray) -> list[BlocksEvidence]:
    """Noise in all blocks or (`is_coarse`) in the coarse ones; `shift` (all hypotheses,) is added.

    Long shadowing says something of the position over hundreds of metres only, levels that a modem
    averages over more than its memory. Readings closer than a coarse block weigh it against short
    noise (in `shift`), but sharpen positions beyond what is true: with long noise in 300 blocks
    regions missed 6 % of 165 measured transmitters, in 80 3 %.
    """
    prior, is_coarse = walk.prior, walk.prior.noise_table.is_coarse
    fine = [one for one in noise if not is_coarse[one.number]]
    coarse = [one.number for one in noise if is_coarse[one.number]]
    parts = []
    if fine:
        of_fine = shift[[one.number for one in fine]]
        parts.append(BlocksEvidence.of(walk.blocks, prior, fine, of_fine))
    if coarse:
        in_coarse = whiteners(walk.coarse, prior, coarse)
        parts.append(BlocksEvidence.of(walk.coarse, prior, in_coarse, shift[coarse]))
    return parts


def _search_coarse_blocks(
    walk: Walk, effort: Effort, numbers: list[int] | None, log_weight: FloatArray | None
) -> Tree:
    noise = whiteners(walk.coarse, walk.prior, numbers)
    parts = [BlocksEvidence.of(walk.coarse, walk.prior, noise)]
    squares = first_squares(walk.coarse, walk.prior, effort.first_share, walk.timing)
    evidence = _evidence(walk, walk.coarse, parts, log_weight, squares)
    return grow(evidence.leaves(squares), evidence.split, walk.prior, effort)


def _log_weight_at_first_position(walk: Walk) -> FloatArray:
    """Shape (c,); the position is the best one under white noise."""
    most_squares = walk.effort.most_squares // _QUICK_PART
    share = _COARSE_SHARE * walk.effort.split_share
    effort = walk.effort._replace(most_squares=most_squares, split_share=share)
    tree = _search_coarse_blocks(walk, effort, [0], None)
    best = int(np.argmax(tree.mixture(walk.prior).probability / tree.size_m**2))
    position = Places.of(tree.x_m[best], tree.y_m[best])
    sigma_db = np.full(len(walk.prior.hypotheses), tree.evidence.sigma_db[0, best])
    return log_weights_at(walk.coarse, walk.prior, position, sigma_db)[0]


def _joint_log_weight(walk: Walk, tree: Tree) -> FloatArray:
    """Joint evidence over the tree's positions; shape (c,)."""
    if not walk.effort.samples and tree.log_weight is not None:
        return tree.log_weight
    noise = whiteners(walk.blocks, walk.prior, tree.numbers.tolist())
    log_p, log_mass, samples = tree.evidence.log_p, tree.log_mass(), walk.effort.samples
    positions = Places.of(tree.x_m, tree.y_m)
    return log_weights(walk.blocks, walk.prior, noise, log_p, log_mass, positions, samples)


def _plausible_parts(walk: Walk, tree: Tree) -> list[BlocksEvidence]:
    """Hypotheses that the levels of all blocks do not rule out at the best squares of the tree.

    Their evidence is the mean over grids: which readings share a block moves it by up to two nats.
    """
    noise = whiteners(walk.blocks, walk.prior)
    timing = 0.0 if tree.log_timing is None else tree.log_timing
    worst_first = -tree.evidence.log_p - tree.log_prior - timing
    best = np.unique(np.argsort(worst_first, axis=1)[:, :_BEST_SQUARES])
    parts = [BlocksEvidence.of(walk.blocks, walk.prior, noise)]
    evidence = _evidence(walk, walk.blocks, parts, None, tree.squares)
    leaves = evidence.leaves(tree.squares[:, best])
    share = leaves.mixture(walk.prior).by_hypothesis
    plausible = np.flatnonzero(share > _LEAST_RATIO * np.max(share))
    mass = leaves.log_mass()
    of_all, of_coarse = leaves.evidence.log_p, tree.evidence.log_p[:, best]
    total = log_sum(of_all + mass)
    shift = np.where(walk.prior.noise_table.is_coarse, total - log_sum(of_coarse + mass), 0.0)
    position, numbers = tree.squares[:2, best], plausible.tolist()
    others = [_log_p(walk, grid, numbers, position) for grid in walk.fine_shifted]
    of_grids = [total[plausible], *(log_sum(of_grid + mass) for of_grid in others)]
    shift[plausible] += np.mean(of_grids, axis=0) - total[plausible]
    return _parts(walk, [noise[k] for k in plausible], shift)


def _numbers_within(log_weight: FloatArray, nats: float) -> list[int]:
    plausible = log_weight > np.max(log_weight) - nats
    numbers: list[int] = np.flatnonzero(plausible).tolist()
    return numbers
