"""Which leaves of the tree are split: three rules, one after the other.

1. Leaves with much of a flattened posterior, whose broad peaks a large square cannot miss.
2. The densest leaves, since a narrow peak may lie between the centres of squares.
3. Leaves with much of the posterior itself, and leaves much larger than such a neighbour.
"""

from collections.abc import Callable

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.packing import around, compact_groups
from logger.core.locator.quadtree import Effort, Tree
from logger.core.model.prior import Prior

Split = Callable[[Tree, BoolArray], Tree]
"""Gives the tree with the chosen leaves, a mask of shape (h,), split in four."""

_POWERS = (0.03, 0.1, 0.3)
"""Of the likelihood in rule 1, from nearly flat to less flat."""
_LARGEST_FLAT_M = 8.0
"""Rule 1 only finds peaks: it splits no square of this side or smaller."""
_DENSEST_TURNS = 4
"""Rule 2 makes squares smaller by a factor of up to 16."""
_LARGEST_DENSEST_M = 2.0
"""Rule 2 splits no square of this side or smaller: position errors blur narrower peaks."""
_MOST_TURNS = 24
"""From 60 km to 0.5 m are 17 halvings; the other turns balance neighbours."""
_SMALLEST_M = 0.5
"""No square gets smaller: receivers are not that accurate."""
_CORE_SHARE = 0.1
"""Neighbours of leaves with this part of `split_share` are balanced as well."""
_MOST_RATIO = 2.5
"""Neighbours differ by one split at most; sides are powers of two, so 2.5 lies between."""
_TOUCH = 1.0 + 1e-9
"""Squares that share an edge touch in spite of rounding."""


def grow(tree: Tree, split: Split, prior: Prior, effort: Effort) -> Tree:
    """Split leaves until none that holds much of the probability is large."""
    most = len(tree.x_m) + effort.most_squares
    tree = _split_flattened(tree, split, prior, effort)
    if effort.densest:
        tree = _split_densest(tree, split, prior, effort.densest)
    for _ in range(_MOST_TURNS):
        chosen = _heavy_or_unbalanced(tree, tree.mixture(prior).probability, effort.split_share)
        if not np.any(chosen) or len(tree.x_m) > most:
            break
        tree = split(tree, chosen)
    return tree


def _split_flattened(tree: Tree, split: Split, prior: Prior, effort: Effort) -> Tree:
    for power in _POWERS:
        p = tree.mixture(prior, power).probability
        is_heavy = p > 2.0 * effort.split_share
        tree = split(tree, is_heavy & (tree.size_m > _LARGEST_FLAT_M))
    return tree


def _split_densest(tree: Tree, split: Split, prior: Prior, densest: int) -> Tree:
    for _ in range(_DENSEST_TURNS):
        density = tree.mixture(prior, _POWERS[-1]).probability / tree.size_m**2
        least = np.sort(density)[-min(densest, len(density))]
        tree = split(tree, (density >= least) & (tree.size_m > _LARGEST_DENSEST_M))
    return tree


def _heavy_or_unbalanced(tree: Tree, p: FloatArray, split_share: float) -> BoolArray:
    """Leaves with more than `split_share`, and those much larger than a neighbour that matters."""
    chosen = (p > split_share) & (tree.size_m > 2.0 * _SMALLEST_M)
    core = np.flatnonzero(p > _CORE_SHARE * split_share)
    next_side_m = np.where(chosen, 0.5 * tree.size_m, tree.size_m)[core]
    large = np.flatnonzero(tree.size_m > _MOST_RATIO * np.min(next_side_m, initial=np.inf))
    of_large, of_core = tree.squares[:, large], tree.squares[:, core]
    of_large[2] *= _TOUCH
    for group in compact_groups(of_core[:2]):
        near = around(of_large, of_core[:, group])
        x_m, y_m, side_m = of_core[:, group, None]
        reach_m = 0.5 * (side_m * _TOUCH + of_large[2, near])
        is_near = np.abs(x_m - of_large[0, near]) <= reach_m
        is_near &= np.abs(y_m - of_large[1, near]) <= reach_m
        is_near &= tree.size_m[large[near]] > _MOST_RATIO * next_side_m[group, None]
        chosen[large[near]] |= np.any(is_near, axis=0)
    return chosen
