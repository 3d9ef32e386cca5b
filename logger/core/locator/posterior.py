"""Everything known about one transmitter after a walk."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.ellipse import Ellipse, ellipse95
from logger.core.errors import EstimationError
from logger.core.locator.evidence import Evidence
from logger.core.locator.offsets import Offsets, first_look, offsets
from logger.core.locator.quadtree import Effort, Tree, grow, nearest_m
from logger.core.locator.region import LEVEL, Squares, area_m2, mode_regions
from logger.core.locator.symmetry import snap_to_curve
from logger.core.locator.timing_advance import timing_of
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations

COARSE_BLOCKS = 80
LEAST_PEAK = 0.05
"""A place with this share of the highest density is named, however little mass it has."""
BIAS_SHARE = 1.0
"""Share of the variance of the receiver's position that lasts for the whole walk and moves the
answer along.
"""

_MODE_LEVEL = 0.999
_LEAST_MODE = 0.01
_LEAST_BIAS_M = 0.5
_END = 0.7
_LEAST_MOVED = 1e-6
_MEDIAN_TURNS = 30
_ROWS = 64
_PAIRS = ((0, 0), (0, 1), (1, 1))


@dataclass(frozen=True)
class Mode:
    """One place where the transmitter may stand.

    `state` is the mean [x, y, P0, eta], `covariance` (4, 4) that of the mode's own mass; `peak` its
    highest density by that of the highest peak of all.
    """

    probability: float
    peak: float
    state: FloatArray
    covariance: FloatArray

    @property
    def x_m(self) -> float:
        """East."""
        return float(self.state[0])

    @property
    def y_m(self) -> float:
        """North."""
        return float(self.state[1])

    @cached_property
    def ellipse(self) -> Ellipse:
        """95 % ellipse of the mode taken as a Gaussian."""
        return ellipse95(self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1])


@dataclass(frozen=True)
class Posterior:
    """Everything known about one transmitter after a walk.

    `x_m, y_m` is the median of the strongest mode: the place from which the transmitter is least
    far on average. `r95_m` is the radius around it that holds 95 % of all mass, `drms_m` the root
    mean squared distance from it; the other values are means and standard deviations over the whole
    posterior. `limit_share` is the mass at the end of the searched area; `log_evidence` the log
    probability density of the levels under the model, to compare models. Where timing advances were
    read the evidence is that of the levels given those, and `prior` reaches as far as they.
    `offsets` are those of several modems at the strongest mode; P0 then is on the scale of the
    first.
    """

    squares: Squares
    modes: tuple[Mode, ...]
    x_m: float
    y_m: float
    r95_m: float
    drms_m: float
    p0_dbm: float
    p0_sigma_db: float
    eta: float
    eta_sigma: float
    sigma_db: float
    decorrelation_m: float
    white_share: float
    limit_share: float
    log_evidence: float
    prior: Prior
    offsets: Offsets | None = None

    @property
    def at_limit(self) -> bool:
        """Whether the search ended before the mass did."""
        return self.limit_share > 0.01

    @property
    def region_area_m2(self) -> float:
        """Area of the 95 % highest-density region."""
        return area_m2(self.squares)


def locate(obs: CellObservations, prior: Prior = Prior(), effort: Effort = Effort()) -> Posterior:  # noqa: B008 (frozen)
    """Posterior of the transmitter's position given all readings of a cell, levels and timing
    advances.

    Raises `EstimationError` without a single reading that is a level and not the end of the modem's
    scale.
    """
    obs = obs.usable()
    limit = obs.limit
    if not np.any(limit == 0):
        raise EstimationError("there is no reading of this cell within the modem's scale")
    obs = snap_to_curve(obs)
    timing = timing_of(obs)
    if timing is not None:
        prior = replace(prior, reach_m=max(prior.reach_m, timing.reach_m))
    # sums of squares keep their digits when the levels are small numbers
    middle_dbm = float(np.mean(obs.level_dbm))
    obs = replace(obs, level_dbm=obs.level_dbm - middle_dbm, known_limit=limit)
    shifted = replace(prior, p0_dbm=prior.p0_dbm - middle_dbm)
    gathered = blocks(obs, effort.most_blocks)
    coarse = blocks(obs, COARSE_BLOCKS) if len(gathered) > COARSE_BLOCKS else gathered
    if obs.n_modems > 1:
        shifted, gone = first_look(obs, coarse, shifted)
        gathered, coarse = replace(gathered, censored=gone), replace(coarse, censored=gone)
    tree = grow(gathered, shifted, effort, coarse, timing)
    tree.evidence.theta[0] += middle_dbm
    return replace(_summary(shifted, gathered, tree, obs.n_modems), prior=prior)


def moments_over(
    square: FloatArray, evidence: Evidence, share: FloatArray, indices: IntArray, mass: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (4,) and covariance (4, 4) of [x, y, P0, eta] over some places: between them, within
    each, and given (x, y).

    `share` (c, h) is the joint probability of hypothesis and place, `mass` the probability of the
    places `indices`.
    """
    of_place, of_theta, spread = (
        np.take(v, indices, axis=-1) for v in (share, evidence.theta, evidence.theta_cov)
    )
    total = of_place.sum(axis=0)
    weight = mass / mass.sum()
    joint = of_place * (weight / np.where(total > 0.0, total, 1.0))
    mean = np.concatenate([square[:2, indices] @ weight, [np.vdot(joint, v) for v in of_theta]])
    off, d = square[:2, indices] - mean[:2, None], of_theta - mean[2:, None, None]
    moved = joint * d
    covariance = np.empty((4, 4))
    covariance[:2, :2] = (weight * off) @ off.T + np.eye(2) * float(
        weight @ square[2, indices] ** 2
    ) / 12.0
    covariance[:2, 2:] = off @ moved.sum(axis=1).T
    covariance[2:, :2] = covariance[:2, 2:].T
    v00, v01, v11 = (
        np.vdot(joint, v) + np.vdot(moved[i], d[k])
        for v, (i, k) in zip(spread, _PAIRS, strict=True)
    )
    covariance[2:, 2:] = [[v00, v01], [v01, v11]]
    return mean, covariance


def _summary(prior: Prior, gathered: Blocks, tree: Tree, modems: int) -> Posterior:
    mixed = tree.mixture(prior)
    bias_m = float(np.sqrt(BIAS_SHARE) * np.median(gathered.position_sigma_m))
    p = _moved(tree, mixed.probability, bias_m)
    cells = Squares(tree.x_m, tree.y_m, tree.size_m, p)
    square = np.stack(tree[:3])
    modes = _modes(
        cells, lambda among: moments_over(square, tree.evidence, mixed.share, among, p[among])
    )
    groups = {id(mode): indices for mode, indices in modes}
    found = sorted((mode for mode, _ in modes), key=lambda mode: -mode.probability)
    x_m, y_m = _median(cells, groups[id(found[0])])
    mean, covariance = moments_over(square, tree.evidence, mixed.share, np.arange(len(p)), p)
    distance = np.hypot(tree.x_m - x_m, tree.y_m - y_m)
    order = np.argsort(distance)
    holds = int(np.searchsorted(np.cumsum(p[order]), LEVEL))
    of_modems = (
        offsets(gathered, prior, tree, mixed, groups[id(found[0])], modems) if modems > 1 else None
    )
    hypotheses = np.array(prior.hypotheses)[tree.numbers]
    a, d_c = mixed.by_hypothesis @ hypotheses[:, :2]
    return Posterior(
        squares=cells,
        modes=tuple(found),
        x_m=x_m,
        y_m=y_m,
        r95_m=float(np.hypot(distance, 0.5 * tree.size_m)[order][min(holds, len(p) - 1)]),
        drms_m=float(np.sqrt(np.sum(p * (distance**2 + tree.size_m**2 / 6.0)))),
        p0_dbm=float(mean[2]),
        p0_sigma_db=float(np.sqrt(covariance[2, 2])),
        eta=float(mean[3]),
        eta_sigma=float(np.sqrt(covariance[3, 3])),
        sigma_db=float(np.sum(mixed.share * tree.evidence.sigma_db)),
        decorrelation_m=float(d_c),
        white_share=min(float(a), 1.0),
        limit_share=float(
            np.sum(p[nearest_m(gathered, tree.x_m, tree.y_m) > _END * prior.reach_m])
        ),
        log_evidence=mixed.log_evidence,
        prior=prior,
        offsets=of_modems,
    )


def _modes(
    cells: Squares, moments: Callable[[IntArray], tuple[FloatArray, FloatArray]]
) -> list[tuple[Mode, IntArray]]:
    found = []
    highest = float(np.max(cells.density))
    for indices in mode_regions(cells, _MODE_LEVEL):
        mass = float(np.sum(cells.probability[indices]))
        peak = float(np.max(cells.density[indices])) / highest
        if mass >= _LEAST_MODE or peak >= LEAST_PEAK:
            found.append((Mode(mass, peak, *moments(indices)), indices))
    return found


def _moved(tree: Tree, p: FloatArray, bias_m: float) -> FloatArray:
    """Probability after an error of the receiver's position that is common to the walk has moved
    it: a blur.
    """
    if bias_m < _LEAST_BIAS_M:
        return p
    small = tree.size_m < 4.0 * bias_m
    to, of = np.flatnonzero(small), np.flatnonzero(small & (p > _LEAST_MOVED))
    moved = p.copy()
    moved[of] = 0.0
    for i in range(0, len(of), _ROWS):  # few at a time: these matrices stay in the cache
        some = of[i : i + _ROWS, None]
        d2 = (tree.x_m[some] - tree.x_m[to]) ** 2 + (tree.y_m[some] - tree.y_m[to]) ** 2
        variance = bias_m**2 + tree.size_m[some] ** 2 / 12.0
        reaches = tree.size_m[to] ** 2 * np.exp(
            -0.5 * d2 / variance
        )  # from each row to each column
        moved[to] += (p[some[:, 0]] / np.sum(reaches, axis=1)) @ reaches
    return moved


def _median(cells: Squares, indices: IntArray) -> tuple[float, float]:
    """Geometric median of the mass of some cells, by Weiszfeld's iteration."""
    x_m, y_m, mass = cells.x_m[indices], cells.y_m[indices], cells.probability[indices]
    inner = cells.size_m[indices] / 3.0
    x, y = float(mass @ x_m / np.sum(mass)), float(mass @ y_m / np.sum(mass))
    for _ in range(_MEDIAN_TURNS):
        weight = mass / np.hypot(np.hypot(x_m - x, y_m - y), inner)
        total = float(np.sum(weight))
        x, y = float(weight @ x_m) / total, float(weight @ y_m) / total
    return x, y
