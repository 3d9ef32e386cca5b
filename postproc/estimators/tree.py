"""Square cells that tile the searched area, split where the mass is."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from postproc.estimators.evidence import Evidence, Noise, Prior, Track, evidence, noises

_SPLIT_SHARE = 0.002
_MIN_CELL_M = 0.5
_MAX_CELLS = 6000
_MAX_TURNS = 24


class Tree(NamedTuple):
    """Leaves of the cell tree, shape (h,) each: centre, side, and what the walk says about the centre."""

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray
    log_prior: FloatArray
    evidence: Evidence

    def probability(self, trust: float) -> FloatArray:
        """Mass of each leaf; `trust` weighs the likelihood as far as the noise is not white."""
        white = float(self.evidence.by_noise[0] @ self._mass(1.0))
        return self._mass(white + (1.0 - white) * trust)

    def _mass(self, weight: float) -> FloatArray:
        log_mass = weight * self.evidence.log_p + self.log_prior + 2.0 * np.log(self.size_m)
        mass = np.exp(log_mass - np.max(log_mass))
        return np.asarray(mass / np.sum(mass), float)


def grow(track: Track, prior: Prior) -> Tree:
    """Split cells until none that holds much of the mass is large."""
    found = noises(track, prior)
    tree = _evaluated(track, found, prior, _first_cells(track, prior))
    for turn in range(_MAX_TURNS):
        wanted = _to_split(tree, tree.probability(prior.trust), turn)
        if not np.any(wanted):
            break
        if turn == 4:
            found = _plausible(tree, found)
        tree = _split(track, found, prior, tree, wanted)
    return tree


def _nearest_m(track: Track, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    d2 = (x_m[:, None] - track.block_x_m) ** 2 + (y_m[:, None] - track.block_y_m) ** 2
    return np.asarray(np.sqrt(np.min(d2, axis=1)), float)


def _first_cells(track: Track, prior: Prior) -> FloatArray:
    """Cells no larger than half their distance from the walk, out to the reach; rows x, y, size."""
    low = np.array([np.min(track.block_x_m), np.min(track.block_y_m)])
    high = np.array([np.max(track.block_x_m), np.max(track.block_y_m)])
    finest_m = max(5.0, len(track.readings) * track.size_m / 200.0)
    square = np.array([*(0.5 * (low + high)), 2.0 * prior.reach_m + float(np.max(high - low))])[:, None]
    done = []
    while square.size:
        large = square[2] > np.maximum(finest_m, 0.5 * _nearest_m(track, square[0], square[1]))
        done.append(square[:, ~large])
        square = _children(square[:, large])
    return np.concatenate(done, axis=1)


def _children(square: FloatArray) -> FloatArray:
    quarter = 0.25 * square[2]
    return np.concatenate(
        [np.stack([square[0] + i * quarter, square[1] + j * quarter, 2.0 * quarter]) for i in (-1, 1) for j in (-1, 1)],
        axis=1,
    )


def _evaluated(track: Track, found: list[Noise], prior: Prior, square: FloatArray) -> Tree:
    x_m, y_m, size_m = square
    beyond = np.maximum(_nearest_m(track, x_m, y_m) / prior.near_m, 1.0)
    return Tree(x_m, y_m, size_m, -prior.far_power * np.log(beyond), evidence(track, found, prior, x_m, y_m))


def _to_split(tree: Tree, p: FloatArray, turn: int) -> BoolArray:
    """Leaves that hold much of the mass, and those twice as large as such a neighbour.

    In the first turns a cell's centre may miss the peak inside it: the best cells are split whatever they hold.
    """
    heavy = (p > _SPLIT_SHARE) & (tree.size_m > 2.0 * _MIN_CELL_M)
    if turn < 3:
        score = tree.evidence.log_p + tree.log_prior
        floor = max(np.max(score) - 6.0, np.partition(score, -min(200, len(score)))[-min(200, len(score))])
        heavy |= (score >= floor) & (tree.size_m > 8.0)
    if len(p) > _MAX_CELLS:
        return np.zeros(len(p), bool)
    core = np.flatnonzero(p > 0.1 * _SPLIT_SHARE)
    size = np.where(heavy, 0.5 * tree.size_m, tree.size_m)[core]
    reach = 0.5 * (tree.size_m[core][:, None] + tree.size_m) * (1.0 + 1e-9)
    near = (np.abs(tree.x_m[core][:, None] - tree.x_m) <= reach) & (np.abs(tree.y_m[core][:, None] - tree.y_m) <= reach)
    return np.asarray(heavy | np.any(near & (tree.size_m > 2.5 * size[:, None]), axis=0), np.bool_)


def _plausible(tree: Tree, found: list[Noise]) -> list[Noise]:
    """Noise hypotheses that are not yet ruled out by the walk."""
    share = tree.evidence.by_noise @ tree.probability(1.0)
    return [noise for noise in found if share[noise.number] > 1e-4 * np.max(share)]


def _split(track: Track, found: list[Noise], prior: Prior, tree: Tree, wanted: BoolArray) -> Tree:
    square = np.stack([tree.x_m, tree.y_m, tree.size_m])[:, wanted]
    new = _evaluated(track, found, prior, _children(square))
    joined = Evidence(*(_join(a, b, wanted) for a, b in zip(tree.evidence, new.evidence, strict=True)))
    x_m, y_m, size_m, log_prior = (_join(a, b, wanted) for a, b in zip(tree[:4], new[:4], strict=True))
    return Tree(x_m, y_m, size_m, log_prior, joined)


def _join(old: FloatArray, new: FloatArray, replaced: BoolArray) -> FloatArray:
    return np.concatenate([old[..., ~replaced], new], axis=-1)
