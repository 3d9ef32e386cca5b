"""What stands for a posterior: positions drawn from it, and places where it is gathered."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.mixture import Mixture
from logger.core.locator.preparation import LocatorInput
from logger.core.locator.quadtree import Tree
from logger.core.model.prior import Hypothesis
from logger.core.places import Places

POSITIONS = 48
"""As many as tell routes apart; 64 gave the same routes at twice the cost."""
_GOLDEN = 0.6180339887498949
"""Multiples of it modulo 1 fill the unit interval evenly, without a random number."""
MOST = 4
"""Places that routes lead to: more are hardly ever plausible at the same time."""
_REACH_M = 1500.0
"""Farther than this from the walker nobody walks for one route."""
_BLUR_M, _BLUR_SHARE = 60.0, 0.25
"""Probability within this distance, or share of the way there, belongs to one place."""
_LEAST = 0.03
"""Less probability than this is no place to walk to."""
_CENTRES = 60
"""Squares tried as a place's centre, the likeliest first: 150 gave the same places."""
_NEGLIGIBLE = 1e-5
"""Squares with less probability change no place."""


class PositionSample(NamedTuple):
    """Positions (i,) drawn from a posterior, and the likeliest noise.

    `weight` (i,) sums to 1. Given its position a transmitter has `p0_dbm` and `eta` (i,) with
    variances and covariance `theta_cov` (3, i): var P0, cov, var eta. `sigma_db` is the standard
    deviation of a level under the hypothesis `noise`, the `number`-th of the prior.
    """

    places: Places
    weight: FloatArray
    p0_dbm: FloatArray
    eta: FloatArray
    theta_cov: FloatArray
    number: int
    noise: Hypothesis
    sigma_db: float


def draw(
    task: LocatorInput, tree: Tree, mixed: Mixture, turn: int, within: BoolArray | None = None
) -> PositionSample:
    """Systematic sample of the squares of a tree; `turn` numbers the draws of one walk.

    `within` (h,) are the squares to draw from, all of them by default.
    """
    p = mixed.probability if within is None else np.where(within, mixed.probability, 0.0)
    at = (np.arange(POSITIONS) + (turn * _GOLDEN) % 1.0) / POSITIONS
    drawn = np.searchsorted(np.cumsum(p), at * np.sum(p))
    square, count = np.unique(np.minimum(drawn, len(p) - 1), return_counts=True)
    row = int(np.argmax(mixed.by_hypothesis))
    number = int(tree.numbers[row])
    share = mixed.share[row] / np.sum(mixed.share[row])
    return PositionSample(
        places=Places.of(tree.x_m[square], tree.y_m[square], utm=task.strongest.utm),
        weight=count / POSITIONS,
        p0_dbm=tree.evidence.theta[0, row, square],
        eta=tree.evidence.theta[1, row, square],
        theta_cov=tree.evidence.theta_cov[:, row, square],
        number=number,
        noise=task.walk.prior.hypotheses[number],
        sigma_db=float(share @ tree.evidence.sigma_db[row]),
    )


class Cluster(NamedTuple):
    """Probability of a place, and its centre."""

    probability: float
    place: Places


def clusters(square: FloatArray, probability: FloatArray, here: Places) -> list[Cluster]:
    """Up to `MOST` places within reach of the walker, the likeliest first.

    `square` (3, h) has rows x, y, side. Each place has the most probability around it of what is
    left.
    """
    x_m, y_m, _ = square[:, probability > _NEGLIGIBLE]
    left = probability[probability > _NEGLIGIBLE]
    away_m = np.hypot(x_m - here.x_m, y_m - here.y_m)
    left = np.where(away_m <= _REACH_M, left, 0.0)
    places: list[Cluster] = []
    while len(places) < MOST and np.sum(left) >= _LEAST:
        top = np.argsort(-left, kind="stable")[:_CENTRES]
        apart_m = np.hypot(x_m[top, None] - x_m, y_m[top, None] - y_m)
        around = apart_m < np.maximum(_BLUR_M, _BLUR_SHARE * away_m[top])[:, None]
        mass = around @ left
        best = int(np.argmax(mass))
        if mass[best] < _LEAST:
            break
        share = np.where(around[best], left, 0.0) / mass[best]
        centre = Places.of(share @ x_m, share @ y_m, utm=here.utm)
        places.append(Cluster(float(mass[best]), centre))
        left = np.where(around[best], 0.0, left)
    return places
