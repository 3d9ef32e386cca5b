"""A quadtree over the searched area: squares, their prior and the evidence at their centres.

The leaves tile the area without overlap. `tree_growth` decides which of them are split.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.locator.mixture import Mixture, log_sum, mixture
from logger.core.locator.timing_advance import STEP_M, Timing
from logger.core.model.blocks import Blocks
from logger.core.model.evidence import Evidence
from logger.core.model.prior import Prior
from logger.core.places import Places

_FINEST_FIRST_M = 10.0
"""First squares on the walk itself are no smaller: growth splits them where that pays.

Twice as large ones save a fifth of the time, but device and desktop differ twice as often.
"""
_BLOCKS_PER_FIRST_SQUARE = 100.0
"""A walk of so many blocks begins with squares of a block's size; a longer one with larger."""


class Effort(NamedTuple):
    """How finely to search.

    Squares with more than `split_share` of the probability are split, until there are
    `most_squares` more than at first. Sigma is integrated over `nodes`. The first squares are no
    larger than `first_share` of their distance from the walk, which has `most_blocks`. Where
    readings are censored, hypotheses are compared at `samples` positions of each of the two
    likeliest, and at one position only with 0. The `densest` squares are split even if they hold
    little: a narrow peak beside a broad one, such as the mirror image inside a round walk, hides
    between the centres of squares. Coarse blocks are of `more_grids` besides the usual one, all
    blocks of one at most.
    """

    most_squares: int = 6000
    split_share: float = 0.004
    nodes: int = 1
    first_share: float = 0.7
    most_blocks: int = 300
    samples: int = 4
    densest: int = 50
    more_grids: int = 3


class Tree(NamedTuple):
    """Leaves of the quadtree: centre, side, log prior density and evidence; arrays of shape (h,).

    `numbers` (c,) are the hypotheses that `evidence` is about. `log_weight` (c,) are their weights
    where the evidence at single positions cannot compare them, which is where readings are
    censored. `log_timing` (h,) is the log probability of the timing advances, None without any: it
    depends neither on the hypotheses of the noise nor on their trust.
    """

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray
    log_prior: FloatArray
    evidence: Evidence
    numbers: IntArray
    log_weight: FloatArray | None
    log_timing: FloatArray | None = None

    @property
    def squares(self) -> FloatArray:
        """Rows x, y, side; shape (3, h)."""
        return np.stack([self.x_m, self.y_m, self.size_m])

    def mixture(self, prior: Prior, power: float = 1.0) -> Mixture:
        """Probability of hypotheses and leaves; a `power` below 1 flattens the likelihood."""
        log_p = power * self.evidence.log_p
        return mixture(log_p, self.log_mass(power), self.numbers, prior, self.log_weight)

    def log_mass(self, power: float = 1.0) -> FloatArray:
        """Log probability of the leaves before the levels, up to a constant; shape (h,)."""
        log_mass = self.log_prior + 2.0 * np.log(self.size_m)
        if self.log_timing is not None:
            log_mass += power * self.log_timing
        return np.asarray(log_mass, float)

    def replace_leaves(self, old: BoolArray, new: "Tree") -> "Tree":
        """The tree with the leaves of `new` instead of the `old` ones, a mask of shape (h,)."""

        def join(before: FloatArray, after: FloatArray) -> FloatArray:
            return np.concatenate([before[..., ~old], after], axis=-1)

        log_timing = self.log_timing
        if log_timing is not None and new.log_timing is not None:
            log_timing = join(log_timing, new.log_timing)
        return self._replace(
            x_m=join(self.x_m, new.x_m),
            y_m=join(self.y_m, new.y_m),
            size_m=join(self.size_m, new.size_m),
            log_prior=join(self.log_prior, new.log_prior),
            evidence=Evidence(*map(join, self.evidence, new.evidence)),
            log_timing=log_timing,
        )


def children(square: FloatArray) -> FloatArray:
    """The four quarters of each square: rows x, y, side; (3, h) -> (3, 4 h)."""
    x_m, y_m, side_m = square
    offset_m = 0.25 * side_m
    quarters = [
        np.stack([x_m + east * offset_m, y_m + north * offset_m, 2.0 * offset_m])
        for east in (-1, 1)
        for north in (-1, 1)
    ]
    return np.concatenate(quarters, axis=1)


def nearest_m(blocks: Blocks, positions: Places) -> FloatArray:
    """Distance of each position from the walk, shape (h,)."""
    walk = blocks.places
    squared_m2 = (positions.x_m[:, None] - walk.x_m) ** 2
    squared_m2 += (positions.y_m[:, None] - walk.y_m) ** 2
    return np.asarray(np.sqrt(np.min(squared_m2, axis=1)), float)


class PositionPrior:
    """Prior of the position: a mixture over the reaches, each normalised over the searched area."""

    def __init__(self, blocks: Blocks, prior: Prior, tiling: FloatArray) -> None:
        """`tiling` are squares (3, h) that cover the searched area."""
        self._blocks, self._prior = blocks, prior
        self._log_odds = np.zeros(len(prior.reaches))
        mass = self.log_by_reach(tiling) + 2.0 * np.log(tiling[2])
        self._log_odds = np.log([one.probability for one in prior.reaches]) - log_sum(mass)

    def log_by_reach(self, square: FloatArray) -> FloatArray:
        """Log density of each reach at squares (3, h), with its probability; shape (r, h)."""
        away_m = nearest_m(self._blocks, Places.of(square[0], square[1]))
        each = [
            -one.power * np.log(np.maximum(away_m / one.flat_m, 1.0)) for one in self._prior.reaches
        ]
        return np.asarray(np.stack(each) + self._log_odds[:, None], float)

    def log_density(self, square: FloatArray) -> FloatArray:
        """Log density at squares (3, h), up to a constant, -inf outside of the area; shape (h,)."""
        log_density = log_sum(self.log_by_reach(square).T)
        if self._prior.area is None:
            return log_density
        with np.errstate(divide="ignore"):
            return log_density + np.log(self._prior.area.share(square))


def first_squares(
    blocks: Blocks, prior: Prior, share: float, timing: Timing | None = None
) -> FloatArray:
    """Squares no larger than `share` of their distance from the walk: rows x, y, side; (3, h).

    They reach as far as the prior, and are no larger than one step of the timing advance on its
    ring.
    """
    finest_m = max(_FINEST_FIRST_M, len(blocks) * blocks.size_m / _BLOCKS_PER_FIRST_SQUARE)
    square = _area(blocks, prior)
    leaves = []
    while square.size:
        side_m = square[2]
        is_large = side_m > np.maximum(finest_m, share * nearest_m(blocks, Places.of(*square[:2])))
        if timing is not None:
            is_large |= (side_m > STEP_M) & timing.near(square)
        if prior.area is not None:
            is_large |= prior.area.is_coarse(square)
        leaves.append(square[:, ~is_large])
        square = children(square[:, is_large])
    return np.concatenate(leaves, axis=1)


def _area(blocks: Blocks, prior: Prior) -> FloatArray:
    """The square holds the walk and everything within the prior's reach; shape (3, 1)."""
    low, high = np.min(blocks.places.xy_m, axis=1), np.max(blocks.places.xy_m, axis=1)
    middle = 0.5 * (low + high)
    side_m = 2.0 * prior.reach_m + float(np.max(high - low))
    return np.array([*middle, side_m])[:, None]
