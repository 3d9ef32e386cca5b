"""The limit: the posterior of an observer who knows the noise, on a fine grid.

Two passes over (x, y): square leaves are split until none holds much of the mass; those that hold
99.9 % are then cut into cells no larger than a quarter of the posterior's local sigma, taken from
the Fisher information there. The estimate is the geometric median of the most probable place: no
other is nearer to the truth on average.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray

from . import ours
from .answer import Answer, Mode, Squares
from .likelihood import Likelihood, nearest_m
from .world import Noise, Place, Walk

_FIRST_CELL_M = 10.0
_HEAVY = 0.004
_BEST = 100
_SEARCH_TURNS, _MOST_TURNS = 4, 40
_CELLS_PER_SIGMA = 4.0
_MOST_CELLS = 80_000
_LEVEL = 0.95
_RESOLVED = 0.999
_MEDIAN_TURNS = 50


class Square(NamedTuple):
    """Square cells, shape (h,): centre, side, log density."""

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray
    log_p: FloatArray

    def mass(self) -> FloatArray:
        """Probability of each, sum 1."""
        log_mass = self.log_p + 2.0 * np.log(self.size_m)
        mass = np.exp(log_mass - np.max(log_mass))
        return np.asarray(mass / np.sum(mass), float)


def answer(walk: Walk, noise: Noise) -> Answer:
    """Posterior of an observer who knows `noise`."""
    return posterior(Likelihood(walk, noise))


def posterior(likelihood: Likelihood) -> Answer:
    """Posterior over places of a likelihood."""
    leaves = _search(likelihood)
    cells, leaf = _resolve(likelihood, leaves)
    mass = cells.mass()
    by_leaf = np.bincount(leaf, mass, minlength=len(leaves.x_m)).astype(float)
    found = ours.split_into_places(leaves.x_m, leaves.y_m, leaves.size_m, by_leaf)
    groups = sorted(
        (np.isin(leaf, group) for group in found), key=lambda mine: -float(np.sum(mass[mine]))
    )
    chosen = _highest_density(cells, mass, _LEVEL)
    region = Squares(cells.x_m[chosen], cells.y_m[chosen], cells.size_m[chosen])
    x_m, y_m = _median(cells, mass, groups[0])
    return Answer(x_m, y_m, tuple(_mode(cells, mass, mine) for mine in groups), region)


def _search(likelihood: Likelihood) -> Square:
    """First pass: leaves small where the mass is."""
    leaves = _evaluate(likelihood, *_first_cells(likelihood.walk))
    for turn in range(_MOST_TURNS):
        wanted = leaves.mass() > _HEAVY
        if turn < _SEARCH_TURNS:  # a peak may still hide between the centres
            wanted |= (leaves.log_p >= np.partition(leaves.log_p, -_BEST)[-_BEST]) & (
                leaves.size_m > 1.0
            )
        if not np.any(wanted):
            break
        leaves = _split(likelihood, leaves, wanted)
    return leaves


def _first_cells(walk: Walk) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Squares out to the reach, none larger than 10 m or a third of its distance from the walk."""
    low, high = np.array([[f(walk.x_m), f(walk.y_m)] for f in (np.min, np.max)])
    x_m, y_m = (0.5 * (low + high))[:, None]
    size_m = np.array([2.0 * ours.REACH_M + float(np.max(high - low))])
    kept = []
    while len(x_m):
        large = size_m > np.maximum(_FIRST_CELL_M, nearest_m(walk, x_m, y_m) / 3.0)
        kept.append((x_m[~large], y_m[~large], size_m[~large]))
        x_m, y_m, size_m, _ = _cut(
            x_m[large], y_m[large], size_m[large], np.full(np.count_nonzero(large), 2)
        )
    x_m, y_m, size_m = (np.concatenate(column) for column in zip(*kept, strict=True))
    return x_m, y_m, size_m


def _evaluate(
    likelihood: Likelihood, x_m: FloatArray, y_m: FloatArray, size_m: FloatArray
) -> Square:
    return Square(x_m, y_m, size_m, likelihood.log_p(x_m, y_m))


def _split(likelihood: Likelihood, leaves: Square, wanted: BoolArray) -> Square:
    """Leaves with the wanted ones cut into four."""
    x_m, y_m, size_m, _ = (column[wanted] for column in leaves)
    new = _evaluate(likelihood, *_cut(x_m, y_m, size_m, np.full(len(x_m), 2))[:3])
    return Square(
        *(np.concatenate([old[~wanted], added]) for old, added in zip(leaves, new, strict=True))
    )


def _cut(
    x_m: FloatArray, y_m: FloatArray, size_m: FloatArray, parts: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Each square in parts^2: centre, side, and the number of the square each came from."""
    parent = np.repeat(np.arange(len(parts)), parts**2)
    number = np.arange(len(parent)) - np.repeat(np.cumsum(parts**2) - parts**2, parts**2)
    side, count = size_m[parent] / parts[parent], parts[parent]
    column, row = number % count, number // count
    middle = 0.5 * (count - 1)
    return x_m[parent] + (column - middle) * side, y_m[parent] + (row - middle) * side, side, parent


def _resolve(likelihood: Likelihood, leaves: Square) -> tuple[Square, IntArray]:
    """Second pass: squares of at most a quarter sigma where the mass is, and the leaf of each."""
    core = _highest_density(leaves, leaves.mass(), _RESOLVED)
    sigma_m = likelihood.local_sigma_m(leaves.x_m[core], leaves.y_m[core])
    parts = np.ceil(_CELLS_PER_SIGMA * leaves.size_m[core] / sigma_m)
    parts = np.ceil(parts * min(1.0, np.sqrt(_MOST_CELLS / np.sum(parts**2)))).astype(np.int64)
    x_m, y_m, size_m, parent = _cut(leaves.x_m[core], leaves.y_m[core], leaves.size_m[core], parts)
    fine = _evaluate(likelihood, x_m, y_m, size_m)
    rest = np.setdiff1d(np.arange(len(leaves.x_m)), core)
    cells = Square(
        *(np.concatenate([new, old[rest]]) for new, old in zip(fine, leaves, strict=True))
    )
    return cells, np.concatenate([core[parent], rest])


def _highest_density(cells: Square, mass: FloatArray, level: float) -> IntArray:
    """Indices of the densest cells that hold `level` of the mass."""
    order = np.argsort(-cells.log_p, kind="stable")
    return order[: int(np.searchsorted(np.cumsum(mass[order]), level)) + 1]


def _mode(cells: Square, mass: FloatArray, mine: BoolArray) -> Mode:
    """Mean and covariance of the mass of some cells."""
    share = mass[mine] / np.sum(mass[mine])
    points = np.vstack([cells.x_m[mine], cells.y_m[mine]])
    mean = points @ share
    off = points - mean[:, None]
    covariance = (share * off) @ off.T + np.eye(2) * float(share @ cells.size_m[mine] ** 2) / 12.0
    return Mode(float(mean[0]), float(mean[1]), covariance, float(np.sum(mass[mine])))


def _median(cells: Square, mass: FloatArray, mine: BoolArray) -> Place:
    """Place from which the mass of some cells is least far on average (Weiszfeld, Tohoku Math.

    J. 43, 1937).
    """
    points = np.stack([cells.x_m[mine], cells.y_m[mine]])
    share, least_m = mass[mine], 0.5 * cells.size_m[mine]
    at = points @ share / np.sum(share)
    for _ in range(_MEDIAN_TURNS):
        pull = share / np.maximum(np.hypot(*(points - at[:, None])), least_m)
        at = points @ pull / np.sum(pull)
    return float(at[0]), float(at[1])
