"""Where a transmitter stands: posterior over (x, y) with everything else integrated out.

The likelihood of a place is in `evidence`, the search over places in `tree`; here is what they add up to.
"""

from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.ellipse import Ellipse, ellipse95
from logger.core.errors import EstimationError
from logger.core.observations import CellObservations
from postproc.estimators.evidence import Prior, blocks
from postproc.estimators.region import LEVEL, Cells, area_m2, places
from postproc.estimators.tree import Tree, grow

LEAST_PEAK = 0.05
"""A place with this share of the highest density is named, however little mass it has."""
_MODE_LEVEL = 0.999
_LEAST_MODE = 0.01


@dataclass(frozen=True)
class Mode:
    """One place where the transmitter may stand.

    `state` is the mean [x, y, P0, eta], `covariance` (4, 4) that of the mode's own mass; `peak` its highest density by
    that of the highest peak of all.
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

    `x_m, y_m` is the strongest mode; `r95_m` the radius around it that holds 95 % of all mass, `drms_m` the root mean
    squared distance from it; the other values are means and standard deviations over the whole posterior.
    `limit_share` is the mass at the end of the searched area, `at_limit` whether that is too much.
    """

    cells: Cells
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
    prior: Prior

    @property
    def at_limit(self) -> bool:
        """Whether the search ended before the mass did."""
        return self.limit_share > 0.01

    @property
    def region_area_m2(self) -> float:
        """Area of the 95 % highest-density region."""
        return area_m2(self.cells)


def locate(obs: CellObservations, prior: Prior = Prior()) -> Posterior:  # noqa: B008 (frozen)
    """Posterior of the transmitter's position given all readings of a cell; raises `EstimationError` without any."""
    if not len(obs):
        raise EstimationError("there is no reading of this cell")
    return _summary(prior, grow(blocks(obs), prior))


def _summary(prior: Prior, tree: Tree) -> Posterior:
    p = tree.probability(prior.trust)
    cells = Cells(tree.x_m, tree.y_m, tree.size_m, p)
    groups = places(cells, _MODE_LEVEL)
    modes = [_mode(tree, cells, indices) for indices in groups]
    modes = [mode for mode in modes if mode.probability >= _LEAST_MODE or mode.peak >= LEAST_PEAK]
    modes.sort(key=lambda mode: -mode.probability)
    whole = _mode(tree, cells, np.arange(len(p)))
    best = modes[0]
    distance = np.hypot(tree.x_m - best.x_m, tree.y_m - best.y_m)
    order = np.argsort(distance)
    holds = int(np.searchsorted(np.cumsum(p[order]), LEVEL))
    shares = tree.evidence.by_noise @ p
    pairs = np.array(prior.noise_pairs)
    return Posterior(
        cells=cells,
        modes=tuple(modes),
        x_m=best.x_m,
        y_m=best.y_m,
        r95_m=float(distance[order][min(holds, len(p) - 1)]),
        drms_m=float(np.sqrt(np.sum(p * (distance**2 + tree.size_m**2 / 6.0)))),
        p0_dbm=float(whole.state[2]),
        p0_sigma_db=float(np.sqrt(whole.covariance[2, 2])),
        eta=float(whole.state[3]),
        eta_sigma=float(np.sqrt(whole.covariance[3, 3])),
        sigma_db=float(tree.evidence.sigma_db @ p),
        decorrelation_m=float(shares @ pairs[:, 1]),
        white_share=float(shares @ pairs[:, 0]),
        limit_share=float(np.sum(p[tree.log_prior < -prior.far_power * log(0.7 * prior.reach_m / prior.near_m)])),
        prior=prior,
    )


def _mode(tree: Tree, cells: Cells, indices: IntArray) -> Mode:
    """Mean and covariance of [x, y, P0, eta] over some leaves: between the leaves, within each, and given (x, y)."""
    mass = cells.probability[indices]
    share = mass / np.sum(mass)
    points = np.vstack([tree.x_m, tree.y_m, tree.evidence.theta])[:, indices]
    mean = points @ share
    off = points - mean[:, None]
    covariance = (share * off) @ off.T
    within = float(share @ tree.size_m[indices] ** 2) / 12.0
    covariance[[0, 1], [0, 1]] += within
    v00, v01, v11 = tree.evidence.theta_cov[:, indices] @ share
    covariance[2:, 2:] += np.array([[v00, v01], [v01, v11]])
    peak = float(np.max(cells.density[indices]) / np.max(cells.density))
    return Mode(float(np.sum(mass)), peak, mean, covariance)
