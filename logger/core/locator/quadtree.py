"""Square cells that tile the searched area, split where the mass is."""

from math import log
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.locator.evidence import NODES, Evidence, marginal, walk_sums
from logger.core.locator.joint_evidence import log_weights, log_weights_at
from logger.core.locator.mixture import Mixture, mixture
from logger.core.locator.timing_advance import STEP_M, Timing
from logger.core.locator.tobit import Given, given_levels, joined
from logger.core.model.blocks import Blocks
from logger.core.model.noise import Whitener, whiteners
from logger.core.model.prior import Prior

_SPLIT_SHARE = 0.002
_MIN_CELL_M = 0.5
_MAX_TURNS = 24
_FLATTENED = (0.03, 0.1, 0.3)
_FLAT_CELL_M = 8.0
_DENSEST_TURNS = 4
_LEAST_DENSEST_M = 2.0
_CHUNK = 512
_ROWS = 64
_SCOUTS = 15
_MOST_SCOUTS = 1500
_PLAUSIBLE = 1e-4
_HOPELESS_NATS = 15.0


class Effort(NamedTuple):
    """How finely to search.

    Cells with more than `split_share` of the mass are split, until there are `most_squares` more than
    at first; sigma is integrated over `nodes`; the first cells are no larger than `first_share` of
    their distance from the walk, which `posterior.locate` gathers into `most_blocks`. Where
    readings are censored hypotheses are compared at `samples` places of each of the two likeliest,
    with 0 at one place only. So many of the `densest` cells are split though they hold little:
    beside a broad peak a narrow one, as the twin within a round walk, hides between the centres of
    cells.
    """

    most_squares: int = 6000
    split_share: float = _SPLIT_SHARE
    nodes: int = NODES
    first_share: float = 0.5
    most_blocks: int = 300
    samples: int = 8
    densest: int = 100


class Tree(NamedTuple):
    """Leaves of the cell tree, shape (h,) each: centre, side, log prior density, and what the walk
    says there.

    `numbers` (c,) are the hypotheses that `evidence` is about: those the walk has not ruled out.
    `log_weight` (c,) is theirs where the evidence at each place cannot compare them. `log_timing`
    (h,) is what the timing advances say, None without any: no hypothesis of the levels' noise, nor
    its trust, concerns them.
    """

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray
    log_prior: FloatArray
    evidence: Evidence
    numbers: IntArray
    log_weight: FloatArray | None
    log_timing: FloatArray | None = None

    def mixture(self, prior: Prior, power: float = 1.0) -> Mixture:
        """Probability of hypotheses and leaves; `power` below 1 flattens the likelihood."""
        return mixture(
            power * self.evidence.log_p, self.log_mass(power), self.numbers, prior, self.log_weight
        )

    def log_mass(self, power: float = 1.0) -> FloatArray:
        """Log mass of the leaves, up to a constant, before the levels."""
        log_mass = self.log_prior + 2.0 * np.log(self.size_m)
        if self.log_timing is not None:
            log_mass += power * self.log_timing
        return np.asarray(log_mass, float)


class Walk(NamedTuple):
    """What the search evaluates places against."""

    blocks: Blocks
    prior: Prior
    effort: Effort
    found: list[Whitener]
    log_weight: FloatArray | None
    timing: Timing | None
    given: list[Given]

    @classmethod
    def of(
        cls,
        blocks: Blocks,
        prior: Prior,
        effort: Effort,
        numbers: list[int] | None,
        log_weight: FloatArray | None,
        timing: Timing | None,
    ) -> "Walk":
        """With the hypotheses of some `numbers`, or all."""
        found = whiteners(blocks, prior, numbers)
        censored = found if len(blocks.censored.x_m) else []
        given = [given_levels(blocks, noise, prior.hypotheses[noise.number]) for noise in censored]
        return cls(blocks, prior, effort, found, log_weight, timing, given)

    def at(self, square: FloatArray, near: Evidence | None = None) -> Tree:
        """Leaves at squares (3, h): x, y, side; `near` (c, h) is what was found near them
        before.
        """
        parts = [
            self._evidence(square[:2, i : i + _CHUNK], _part(near, i)) for i in self._starts(square)
        ]
        joined = Evidence(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))
        numbers = np.array([w.number for w in self.found])
        log_weight = None if self.log_weight is None else self.log_weight[numbers]
        density = log_prior(self.blocks, self.prior, square)
        return Tree(
            square[0],
            square[1],
            square[2],
            density,
            joined,
            numbers,
            log_weight,
            self._timing(square),
        )

    def _starts(self, square: FloatArray) -> range:
        return range(0, square.shape[1], _CHUNK)

    def _timing(self, square: FloatArray) -> FloatArray | None:
        if self.timing is None:
            return None
        found = [self.timing.log_p(*square[:2, i : i + _CHUNK]) for i in self._starts(square)]
        return np.concatenate(found)

    def _evidence(self, place: FloatArray, near: Evidence | None) -> Evidence:
        x_m, y_m = place
        total = walk_sums(self.blocks, self.found, self.prior, x_m, y_m)
        log_det = np.array([w.log_det for w in self.found])[:, None]
        if self.given:
            return joined(total, log_det, self.blocks, self.given, self.prior, x_m, y_m, near)
        return marginal(total, len(self.blocks), log_det, self.prior, self.effort.nodes)


def _part(near: Evidence | None, first: int) -> Evidence | None:
    return (
        None
        if near is None
        else Evidence(*(values[..., first : first + _CHUNK] for values in near))
    )


def grow(
    blocks: Blocks,
    prior: Prior,
    effort: Effort = Effort(),  # noqa: B008 (frozen)
    coarse: Blocks | None = None,
    timing: Timing | None = None,
    log_weight: FloatArray | None = None,
) -> Tree:
    """Split cells until none that holds much of the mass is large.

    `coarse` is the same walk in fewer blocks: the search begins with those, and they decide which
    noise is plausible enough to be searched with all blocks. Where readings are censored
    `log_weight` is what is known already of all hypotheses, None if that is to be found out.
    """
    rough = blocks if coarse is None else coarse
    if log_weight is None and len(blocks.censored.x_m):
        log_weight = _scouted(rough, blocks, prior, effort, timing)
    walk = Walk.of(rough, prior, effort, _within(log_weight, _HOPELESS_NATS), log_weight, timing)
    if rough is not blocks:
        walk = walk._replace(
            effort=effort._replace(most_squares=_MOST_SCOUTS, split_share=5.0 * effort.split_share)
        )
    begun = _grown(walk, walk.at(first_squares(rough, prior, effort.first_share, timing)))
    if log_weight is not None and effort.samples:
        log_weight = _weighed(begun, blocks, prior, effort.samples)
        begun = begun._replace(log_weight=log_weight[begun.numbers])
    if len(rough) == len(blocks):
        return begun
    square = np.stack([begun.x_m, begun.y_m, begun.size_m])
    fine = effort._replace(densest=0)  # these have been split
    walk = Walk.of(blocks, prior, fine, _within(log_weight, -log(_PLAUSIBLE)), log_weight, timing)
    if log_weight is None:
        told = 0.0 if begun.log_timing is None else begun.log_timing
        best = np.unique(
            np.argsort(-begun.evidence.log_p - begun.log_prior - told, axis=1)[:, :_SCOUTS]
        )
        walk = walk._replace(found=_plausible(walk.at(square[:, best]), prior, walk.found))
    return _grown(walk, walk.at(square))


def _scouted(
    rough: Blocks, blocks: Blocks, prior: Prior, effort: Effort, timing: Timing | None
) -> FloatArray:
    """Log weight of all hypotheses where readings are censored, at the place that white noise likes
    best.
    """
    quick = effort._replace(
        most_squares=effort.most_squares // 10, split_share=5.0 * effort.split_share
    )
    walk = Walk.of(rough, prior, quick, [0], None, timing)
    tree = _grown(walk, walk.at(first_squares(rough, prior, effort.first_share, timing)))
    best = int(np.argmax(tree.mixture(prior).probability / tree.size_m**2))
    begun_db = np.full(len(prior.hypotheses), prior.sigma_db)
    return log_weights_at(blocks, prior, float(tree.x_m[best]), float(tree.y_m[best]), begun_db)[0]


def _weighed(tree: Tree, blocks: Blocks, prior: Prior, samples: int) -> FloatArray:
    """Log weight of all hypotheses by their joint evidence over the places of a tree; none of those
    not in it.
    """
    log_weight = np.full(len(prior.hypotheses), -np.inf)
    found = whiteners(blocks, prior, tree.numbers.tolist())
    places = tree.log_mass(), tree.x_m, tree.y_m
    log_weight[tree.numbers] = log_weights(
        blocks, prior, found, tree.evidence.log_p, *places, samples
    )
    return log_weight


def _within(log_weight: FloatArray | None, nats: float) -> list[int] | None:
    """Numbers of the hypotheses that are no more than this less likely than the likeliest; None for
    all.
    """
    return (
        None
        if log_weight is None
        else np.flatnonzero(log_weight > np.max(log_weight) - nats).tolist()
    )


def _grown(walk: Walk, tree: Tree) -> Tree:
    """Split what holds much of the mass; at first of a flattened posterior, whose peaks a large
    cell cannot miss.
    """
    most = len(tree.x_m) + walk.effort.most_squares
    for power in _FLATTENED:
        p = tree.mixture(walk.prior, power).probability
        tree = _split(
            walk, tree, (p > 2.0 * walk.effort.split_share) & (tree.size_m > _FLAT_CELL_M)
        )
    for _ in range(_DENSEST_TURNS if walk.effort.densest else 0):
        density = tree.mixture(walk.prior, _FLATTENED[-1]).probability / tree.size_m**2
        least = np.sort(density)[-min(walk.effort.densest, len(density))]
        tree = _split(walk, tree, (density >= least) & (tree.size_m > _LEAST_DENSEST_M))
    for _ in range(_MAX_TURNS):
        wanted = _to_split(tree, tree.mixture(walk.prior).probability, walk.effort)
        if not np.any(wanted) or len(tree.x_m) > most:
            break
        tree = _split(walk, tree, wanted)
    return tree


def log_prior(blocks: Blocks, prior: Prior, square: FloatArray) -> FloatArray:
    """Log density, up to a constant, of the position's prior at squares (3, h)."""
    beyond = np.maximum(nearest_m(blocks, square[0], square[1]) / prior.near_m, 1.0)
    return np.asarray(-prior.far_power * np.log(beyond), float)


def nearest_m(blocks: Blocks, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Distance of places (h,) from the walk."""
    d2 = (x_m[:, None] - blocks.x_m) ** 2 + (y_m[:, None] - blocks.y_m) ** 2
    return np.asarray(np.sqrt(np.min(d2, axis=1)), float)


def first_squares(
    blocks: Blocks, prior: Prior, share: float, timing: Timing | None = None
) -> FloatArray:
    """Cells no larger than `share` of their distance from the walk, out to the reach; rows x, y,
    size.

    Those on a ring of the timing advance are no larger than it is wide.
    """
    low = np.array([np.min(blocks.x_m), np.min(blocks.y_m)])
    high = np.array([np.max(blocks.x_m), np.max(blocks.y_m)])
    finest_m = max(5.0, len(blocks) * blocks.size_m / 200.0) * share / 0.5
    square = np.array([*(0.5 * (low + high)), 2.0 * prior.reach_m + float(np.max(high - low))])[
        :, None
    ]
    done = []
    while square.size:
        large = square[2] > np.maximum(finest_m, share * nearest_m(blocks, square[0], square[1]))
        if timing is not None:
            large |= (square[2] > STEP_M) & timing.near(square)
        done.append(square[:, ~large])
        square = children(square[:, large])
    return np.concatenate(done, axis=1)


def children(square: FloatArray) -> FloatArray:
    """The four quarters of each square."""
    quarter = 0.25 * square[2]
    return np.concatenate(
        [
            np.stack([square[0] + i * quarter, square[1] + j * quarter, 2.0 * quarter])
            for i in (-1, 1)
            for j in (-1, 1)
        ],
        axis=1,
    )


def _to_split(tree: Tree, p: FloatArray, effort: Effort) -> BoolArray:
    """Leaves that hold much of the mass, and those twice as large as such a neighbour."""
    heavy = (p > effort.split_share) & (tree.size_m > 2.0 * _MIN_CELL_M)
    core = np.flatnonzero(p > 0.1 * effort.split_share)
    size = np.where(heavy, 0.5 * tree.size_m, tree.size_m)[core]
    large = np.flatnonzero(tree.size_m > 2.5 * np.min(size, initial=np.inf))
    x_m, y_m, side_m = tree.x_m[large], tree.y_m[large], tree.size_m[large]
    for i in range(0, len(core), _ROWS):  # few at a time: these matrices stay in the cache
        some = core[i : i + _ROWS, None]
        reach = 0.5 * (tree.size_m[some] + side_m) * (1.0 + 1e-9)
        near = (np.abs(tree.x_m[some] - x_m) <= reach) & (np.abs(tree.y_m[some] - y_m) <= reach)
        heavy[large] |= np.any(near & (side_m > 2.5 * size[i : i + _ROWS, None]), axis=0)
    return heavy


def _plausible(tree: Tree, prior: Prior, found: list[Whitener]) -> list[Whitener]:
    """Noise hypotheses that the walk has not ruled out."""
    share = tree.mixture(prior).by_hypothesis
    return [noise for noise, p in zip(found, share, strict=True) if p > _PLAUSIBLE * np.max(share)]


def _split(walk: Walk, tree: Tree, wanted: BoolArray) -> Tree:
    if not np.any(wanted):
        return tree
    square = np.stack([tree.x_m, tree.y_m, tree.size_m])[:, wanted]
    parents = None
    if walk.given:
        parents = Evidence(
            *(np.concatenate(4 * [values[..., wanted]], axis=-1) for values in tree.evidence)
        )
    new = walk.at(children(square), parents)
    joined = Evidence(
        *(_join(a, b, wanted) for a, b in zip(tree.evidence, new.evidence, strict=True))
    )
    x_m, y_m, size_m, log_density = (
        _join(a, b, wanted) for a, b in zip(tree[:4], new[:4], strict=True)
    )
    old, told = tree.log_timing, new.log_timing
    log_timing = None if old is None or told is None else _join(old, told, wanted)
    return Tree(x_m, y_m, size_m, log_density, joined, tree.numbers, tree.log_weight, log_timing)


def _join(old: FloatArray, new: FloatArray, replaced: BoolArray) -> FloatArray:
    return np.concatenate([old[..., ~replaced], new], axis=-1)
