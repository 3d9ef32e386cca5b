"""Whether a cell changed in another way here than there, as it does when its transmitter moves.

Under the null hypothesis differences can be exchanged between blocks. The test permutes them; its
statistic is large where neighbouring blocks changed alike.
"""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.blocks import squares
from logger.core.places import Places
from postproc.comparison.differences import Differences
from postproc.comparison.ground import BLOCK_M, Grid

FEWEST_BLOCKS = 8
"""Fewer show a change of the mean, but no pattern."""
LEAST_CONTRAST_DB = 10.0
"""A smaller contrast is not worth the word `moved`: halving a distance changes 6 to 12 dB."""
_REACH_M = 150.0
"""Blocks this far apart still change alike when a transmitter moves, and by chance do not."""
_FIRST, _MORE = 499, 49_999
"""Permutations: the second number only where the first leaves open a word that contrast allows."""
_OPEN = 0.02
_ENOUGH = 50  # permutations that are as smooth: they give the share within a seventh
_MOST_SQUARES = 400
"""The time grows with their square; of more blocks, those of one larger square count together."""
_DRAWN_AT_ONCE = 2_000_000
"""Differences: 50 MB with their products."""


def pattern_of(differences: Differences, change_db: float, grid: Grid) -> tuple[float, float]:
    """Largest contrast between two parts of the ground in dB, and the probability of the pattern.

    `change_db` is the change of the mean: a censored difference that allows it counts as that, any
    other as its bound. Too few blocks give (0, 1).
    """
    if len(differences) < FEWEST_BLOCKS:
        return 0.0, 1.0
    allowed = differences.bound * (change_db - differences.difference_db) > 0.0
    values_db = np.where(allowed, change_db, differences.difference_db)
    places = np.stack([*grid.centres_m(differences.block), values_db])
    (x_m, y_m, values_db), weight = _in_squares(places, 1.0 / differences.variance_db2)
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    kernel = np.exp(-0.5 * (apart_m / _REACH_M) ** 2)
    away_db = values_db - np.sum(weight * values_db) / np.sum(weight)
    smooth_db = (kernel * weight) @ away_db / np.sum(kernel * weight, axis=1)
    contrast_db = float(np.max(smooth_db) - np.min(smooth_db))
    residual = away_db * np.sqrt(weight)
    p = _share_as_smooth(kernel, residual, _FIRST)
    if p < _OPEN and contrast_db >= LEAST_CONTRAST_DB:
        p = _share_as_smooth(kernel, residual, _MORE)
    return contrast_db, p


def _in_squares(places: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted means of columns [x, y, ...] (k, n) in at most `_MOST_SQUARES` squares; weights."""
    if len(weight) <= _MOST_SQUARES:
        return places, weight
    square, _ = squares(Places.of(places[0], places[1]), _MOST_SQUARES, finest_m=BLOCK_M)
    total = np.bincount(square, weight)
    means = np.array([np.bincount(square, weight * column) / total for column in places])
    return means, np.asarray(total, float)


def _share_as_smooth(kernel: FloatArray, residual: FloatArray, count: int) -> float:
    """Share of permutations that are at least as smooth as the order of the walk.

    As many are drawn as are needed to know it well (Besag & Clifford, Biometrika 78(2), 1991).
    """
    random = np.random.default_rng(0)  # equal runs give equal answers
    own = residual @ kernel @ residual * (1.0 - 1e-12)
    n_as_smooth = 0
    at_once = max(_DRAWN_AT_ONCE // len(residual), 1)
    for first in range(0, count, at_once):
        n = min(at_once, count - first)
        drawn = random.permuted(np.broadcast_to(residual, (n, len(residual))).copy(), axis=1)
        n_as_smooth += int(np.count_nonzero(np.einsum("ij,ij->i", drawn @ kernel, drawn) >= own))
        if n_as_smooth >= _ENOUGH:
            return (1 + n_as_smooth) / (1 + first + n)
    return (1 + n_as_smooth) / (1 + count)
