"""Whether one position explains a walk, or two transmitters share the identity.

The walk is divided in two by which of two places is heard better there, and each part located
alone. Two transmitters are believed when the walk passes both and two posteriors, under the same
noise, explain the levels far better than one: their evidence counts every unknown of both (Bayes
factor; Kass & Raftery, J. Am. Stat. Assoc. 90(430), 1995).
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.posterior import Posterior
from logger.core.locator.quadtree import Effort, Tree
from logger.core.locator.search import search_once
from logger.core.model.blocks import NOTHING_CENSORED, blocks, single
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations

LEAST_LOG_FACTOR = 5.0
"""150 to 1: very strong evidence (Kass & Raftery, sec. 3.2).

Of 200 simulated walks past one source none exceeds it, of 165 measured ones 6.
"""

_EFFORT = Effort(most_squares=800, split_share=0.01, nodes=3, densest=0)
_BLOCKS = 80
_FEWEST = 8
_FEWEST_READINGS = 40
_RIVALS = 3
_APART = 0.12
_SMOOTHING = 0.03
_TURNS = 3
_IMPOSSIBLE = -1e9


class Division(NamedTuple):
    """Two places that together explain the levels: log Bayes factor against one, and x, y of each
    in metres.
    """

    log_factor: float
    one_m: tuple[float, float]
    other_m: tuple[float, float]


class _Part(NamedTuple):
    log_evidence: FloatArray
    x_m: float
    y_m: float
    p0_dbm: float
    eta: float


def divide(obs: CellObservations, posterior: Posterior) -> Division | None:
    """The division that explains the levels best, None where the walk has no two loud places to
    divide it by.

    Not asked where `posterior`, of one transmitter, leaves no more than shadowing unexplained; nor
    of several modems, whose offsets would divide a walk as well.
    """
    prior = posterior.prior
    plain = posterior.decorrelation_m <= prior.stationary_m
    obs = obs.usable()
    if plain or obs.n_modems > 1 or np.count_nonzero(obs.limit == 0) < _FEWEST_READINGS:
        return None
    walk = blocks(obs, _BLOCKS)
    column = np.stack([walk.x_m, walk.y_m, walk.level_dbm, walk.position_sigma_m**2, walk.readings])
    first, *others = _loud_places(column)
    if not others:
        return None
    whole = float(log_sum(_part(column, walk.size_m, prior).log_evidence))
    found = [_best(column, walk.size_m, prior, first, other, whole) for other in others]
    return max((one for one in found if one is not None), default=None)


def _best(
    column: FloatArray, size_m: float, prior: Prior, first: int, other: int, whole: float
) -> Division | None:
    """Divide by distance, then again and again by which of the two transmitters found is the
    louder.
    """
    x_m, y_m = column[:2]
    mine = np.hypot(x_m - x_m[first], y_m - y_m[first]) < np.hypot(
        x_m - x_m[other], y_m - y_m[other]
    )
    best = None
    for _ in range(_TURNS):
        if min(np.count_nonzero(mine), np.count_nonzero(~mine)) < _FEWEST:
            break
        one, two = (_part(column[:, side], size_m, prior) for side in (mine, ~mine))
        factor = float(log_sum(one.log_evidence + two.log_evidence - prior.log_odds)) - whole
        passed = max(_nearest_m(part, column) for part in (one, two)) <= prior.near_m
        if passed and (best is None or factor > best.log_factor):
            best = Division(factor, (one.x_m, one.y_m), (two.x_m, two.y_m))
        louder = _level_dbm(one, column, prior) > _level_dbm(two, column, prior)
        if np.array_equal(louder, mine):
            break
        mine = louder
    return best


def _part(column: FloatArray, size_m: float, prior: Prior) -> _Part:
    """Log evidence of each hypothesis of the noise, with its prior odds, and the likeliest
    transmitter.
    """
    tree = search_once(single(column, size_m, NOTHING_CENSORED), prior, _EFFORT)
    log_mass = tree.log_prior + 2.0 * np.log(tree.size_m)
    evidence = np.full(len(prior.hypotheses), _IMPOSSIBLE)
    evidence[tree.numbers] = (
        log_sum(tree.evidence.log_p + log_mass - log_sum(log_mass)) + prior.log_odds[tree.numbers]
    )
    return _Part(evidence, *_likeliest(tree))


def _likeliest(tree: Tree) -> tuple[float, float, float, float]:
    hypothesis, place = np.unravel_index(np.argmax(tree.evidence.log_p), tree.evidence.log_p.shape)
    p0_dbm, eta = tree.evidence.theta[:2, hypothesis, place].tolist()
    return float(tree.x_m[place]), float(tree.y_m[place]), p0_dbm, eta


def _nearest_m(part: _Part, column: FloatArray) -> float:
    return float(np.min(np.hypot(column[0] - part.x_m, column[1] - part.y_m)))


def _level_dbm(part: _Part, column: FloatArray, prior: Prior) -> FloatArray:
    d2 = (column[0] - part.x_m) ** 2 + (column[1] - part.y_m) ** 2 + prior.height_m**2
    return np.asarray(part.p0_dbm - part.eta * 5.0 * np.log10(np.maximum(d2, 1.0)), float)


def _loud_places(column: FloatArray) -> list[int]:
    """Blocks where the smoothed level is highest, and where else it has a peak, loudest first."""
    x_m, y_m, level_dbm, _, readings = column
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    extent_m = float(np.max(apart_m))
    if extent_m <= 0.0:
        return [0]
    near = np.exp(-0.5 * (apart_m / (_SMOOTHING * extent_m)) ** 2) * np.minimum(readings, 16.0)
    smooth_dbm = near @ level_dbm / np.sum(near, axis=1)
    chosen: list[int] = []
    for k in np.argsort(-smooth_dbm).tolist():
        far = all(apart_m[k, c] > _APART * extent_m for c in chosen)
        if far and _is_peak(smooth_dbm, apart_m[k] < 0.7 * _APART * extent_m, k):
            chosen.append(k)
        if len(chosen) > _RIVALS:
            break
    return chosen


def _is_peak(smooth_dbm: FloatArray, beside: BoolArray, k: int) -> bool:
    return bool(smooth_dbm[k] >= np.max(smooth_dbm[beside]))
