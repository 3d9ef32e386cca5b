"""Whether the levels of one identity come from one place, from two, or from a moving one.

A coarse test, cheap enough for each cell on the walk; `locator.two_source_test` decides the same at
the desk with the full model. Spots of 50 m are split in two parts, by place or by time; each part
gets its best position on a grid, with the power free and priors on the path loss exponent and on
one lobe of the antenna: without it, the field before and behind a sector antenna looks like two
stations.
"""

from collections.abc import Sequence
from math import hypot, log
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import distance_m, log_distance_db
from logger.core.suspicion.spots import Spot

_SIGMA_DB = 7.0
"""Shadowing of streets, 6 to 8 dB."""
LEAST_EVIDENCE = 1.5
"""Log evidence for two places from which a rule holds; less need not be known."""
_TRUST = 0.5
"""Spots of 50 m are not independent where houses shadow over 50 to 100 m."""
_ETA = 3.2
_PRIOR_SIGMA = np.array([0.7, 3.5, 3.5])
"""Of the path loss exponent, and in dB of the lobe to the east and to the north: less than the 9.3
dB of a sector antenna.
"""
_RIDGE = np.diag((_SIGMA_DB / _PRIOR_SIGMA) ** 2)[:, :, None]
_UNIT_GRID = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 13)] * 2), axis=-1).reshape(-1, 2)
_AROUND = np.array([(0.0, 0.0), (35.0, 0.0), (-35.0, 0.0), (0.0, 35.0), (0.0, -35.0)])
_BESIDE = 4
"""Strongest spots with candidates beside them, closer than the grid."""
_CLOSEST_M = 25.0
_FEWEST = 3
_LEAST_APART_M = 300.0


class Sources(NamedTuple):
    """Log evidence for two places against one, and that against any one place.

    `apart_m` is the distance of the two places.
    """

    two_places: float
    no_place: float
    apart_m: float


class _Fit(NamedTuple):
    cost: float
    x_m: float
    y_m: float


def compare_sources(spots: Sequence[Spot]) -> Sources | None:
    """Compare the three explanations; None if the walk is too short to tell places apart.

    Where `two_places` cannot reach `LEAST_EVIDENCE` it is 0, and `no_place` a lower bound.
    """
    xylt = np.array([(s.x_m, s.y_m, s.level_dbm, s.t_s) for s in spots])
    extent_m = float(np.max(np.ptp(xylt[:, :2], axis=0)))
    if extent_m < _LEAST_APART_M:
        return None
    n = len(spots)
    # four parameters more cost 2 log n (BIC) if spots are independent, with the trust half of it
    needed = 2.0 * log(n) + LEAST_EVIDENCE / _TRUST
    one = _fit(xylt, _beside(xylt))
    if one.cost >= needed:  # else one place is good enough beside the strongest spots already
        one = min(_fit(xylt, _grid(xylt)), one, key=lambda fit: fit.cost)
    two, apart_m = _best_split(xylt, one.cost - needed)
    no_place = _TRUST * (one.cost - 0.5 * n)  # with the right sigma a spot costs half a unit
    two_places = _TRUST * (one.cost - 2.0 * log(n) - two) if apart_m else 0.0
    return Sources(two_places, no_place, apart_m)


def _best_split(xylt: FloatArray, limit: float) -> tuple[float, float]:
    """Least cost of two places, and their distance: the two strongest spots that are far apart.

    The distance is 0 if no two places cost less than the limit.
    """
    best, apart_m = limit, 0.0
    if limit <= 0.0:  # no cost is negative
        return best, apart_m
    order = np.argsort(-xylt[:, 2])
    first = xylt[order[0]]
    far = [i for i in order[1:] if hypot(*(xylt[i, :2] - first[:2])) >= _LEAST_APART_M][:3]
    for i in far:
        second = xylt[i]
        to_first = np.hypot(*(xylt[:, :2] - first[:2]).T)
        to_second = np.hypot(*(xylt[:, :2] - second[:2]).T)
        parts = xylt[to_first <= to_second], xylt[to_first > to_second]
        fewer, more = sorted(parts, key=len)
        if len(fewer) < _FEWEST:
            continue
        a = _fit(more, _candidates(more))
        if a.cost >= best:
            continue
        b = _fit(fewer, _candidates(fewer))
        if a.cost + b.cost < best and hypot(a.x_m - b.x_m, a.y_m - b.y_m) >= _LEAST_APART_M:
            best, apart_m = a.cost + b.cost, hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    return best, apart_m


def _fit(xylt: FloatArray, at_m: FloatArray) -> _Fit:
    """The cost is half the squared residual by sigma."""
    level_dbm = xylt[:, 2]
    # level = p0 - eta loss + lobe; p0 is free, eta and the lobe have priors
    columns = _columns(xylt, at_m)
    residual_db = level_dbm - level_dbm.mean() - _ETA * columns[:, 0]
    gain = _gain(columns, residual_db)
    cost = 0.5 * ((residual_db**2).sum(axis=1) - gain) / _SIGMA_DB**2
    best = int(np.argmin(cost))
    return _Fit(float(cost[best]), float(at_m[best, 0]), float(at_m[best, 1]))


def _gain(columns: FloatArray, residual_db: FloatArray) -> FloatArray:
    """By how much the columns lower the sum of squares, with what their priors take; shape (h,).

    Cholesky's method for all candidates together: numpy's solver takes them one by one.
    """
    (aa, ba, ca), (_, bb, cb), (_, _, cc) = _RIDGE + np.moveaxis(
        columns @ columns.transpose(0, 2, 1), 0, 2
    )
    a, b, c = (columns @ residual_db[:, :, None])[:, :, 0].T
    bb, cb, b = bb - ba * ba / aa, cb - ba * ca / aa, b - ba * a / aa
    cc, c = cc - ca * ca / aa - cb * cb / bb, c - ca * a / aa - cb * b / bb
    return np.asarray(a * a / aa + b * b / bb + c * c / cc, float)


def _columns(xylt: FloatArray, at_m: FloatArray) -> FloatArray:
    """What multiplies eta and the lobe for each candidate, without its mean; shape (h, 3, n)."""
    dx_m, dy_m = xylt[:, 0] - at_m[:, :1], xylt[:, 1] - at_m[:, 1:]
    loss_db = log_distance_db(dx_m, dy_m, _CLOSEST_M)
    far_m = distance_m(loss_db)
    columns = np.stack([-loss_db, dx_m / far_m, dy_m / far_m], axis=1)
    columns -= columns.mean(axis=2, keepdims=True)
    return np.asarray(columns, float)


def _candidates(xylt: FloatArray) -> FloatArray:
    return np.concatenate([_grid(xylt), _beside(xylt)])


def _grid(xylt: FloatArray) -> FloatArray:
    """Shape (n, 2)."""
    middle = xylt[:, :2].mean(axis=0)
    reach_m = max(float(np.max(np.ptp(xylt[:, :2], axis=0))), _LEAST_APART_M) * 0.75
    return np.asarray(middle + reach_m * _UNIT_GRID, float)


def _beside(xylt: FloatArray) -> FloatArray:
    """Shape (n, 2); the strongest spots themselves too."""
    strongest = xylt[np.argsort(-xylt[:, 2])[:_BESIDE], :2]
    return np.asarray((strongest[:, None, :] + _AROUND).reshape(-1, 2), float)
