"""Least squares over [x, y, P0, eta] from several starts.

Least squares is as good as its start and does not report other minima by itself: start it from the
modes of the posterior, and read `rivals` and `bounded`. Levels at the modem's limit are used as the
bounds that they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.ellipse import CHI2_95_2DOF
from logger.core.errors import EstimationError
from logger.core.readings import Readings
from postproc.estimators.convergence import ended_well
from postproc.estimators.least_squares_covariance import Sandwich, sandwich
from postproc.estimators.least_squares_rows import Rows, each_reading, group
from postproc.estimators.least_squares_search import Search
from postproc.estimators.robust_losses import Loss

_FEWEST = 5  # levels; four unknowns fit four exactly
_SAME_POSITION_M = 5.0  # searches that end nearer have found the same minimum
_ROUNDING_DB = 12.0**-0.5  # of levels in whole dB
_SIGMA_PER_MEDIAN = 1.0 / 0.6745  # of the absolute value, of a normal law


@dataclass(frozen=True)
class BatchFit:
    """Best fit: `state` [x, y, P0, eta], `covariance` (4, 4), residual `sigma_db`, readings `n`.

    `cost` is chi2 / 2. `converged` is False also for what cannot be: an exponent that is not
    positive or a position over 30 km away. State and covariance are then no answer; a covariance
    that could not be computed is NaN. `inflation` is the factor by which correlated residuals have
    widened the covariance of the position. `bounded` is False where in some direction positions fit
    as well as far as 30 km away; the covariance then reaches that far. `rivals` are the states of
    other minima that the readings cannot distinguish from the best one (chi-square within 5.991).
    """

    state: FloatArray
    covariance: FloatArray
    sigma_db: float
    n: int
    converged: bool
    cost: float
    inflation: float
    bounded: bool
    rivals: tuple[FloatArray, ...]


def residuals(state: FloatArray, obs: Readings, height_m: float = 0.0) -> FloatArray:
    """Model minus level in dB of each reading, shape (n,), for a state [x, y, P0, eta]."""
    return each_reading(obs, height_m).residuals(state)


def jacobian(state: FloatArray, obs: Readings, height_m: float = 0.0) -> FloatArray:
    """Derivative of `residuals` by the state, shape (n, 4)."""
    return each_reading(obs, height_m).jacobian(state)


def fit(
    obs: Readings,
    starts: Sequence[tuple[float, float]],
    *,
    loss: Loss = "linear",
    height_m: float = 0.0,
) -> BatchFit:
    """Best of the fits started at positions (x, y) in metres, `height_m` that of the antenna.

    Raises `EstimationError` for fewer than 5 readings within the receiver's limits.
    """
    n_levels = int(np.count_nonzero(obs.limit == 0))
    if n_levels < _FEWEST or not starts:
        raise EstimationError(
            f"{n_levels} readings do not determine a position, power and exponent: "
            f"at least {_FEWEST}"
        )
    robust = loss != "linear"
    rows, levels = group(obs, height_m, robust=robust), each_reading(obs, height_m).levels()
    sigma_db = min(_sigma_db(levels, rows.best_at(*start), robust=True) for start in starts)
    minima = Search(rows, loss, sigma_db).minima(starts)
    sigma_db = _sigma_db(levels, minima[0].state, robust=robust)
    search = Search(rows, loss, sigma_db)
    if not np.all(rows.free):
        # how much a limit hides depends on sigma, of which the first fit knows more
        minima = search.refine(minima)
    best = minima[0]
    spread = _sandwich(search, best.state)
    allowed = 0.5 * CHI2_95_2DOF * spread.variance_db2 * max(spread.inflation, 1.0)
    near = [m.state for m in minima[1:] if m.converged and m.cost - best.cost < allowed]
    return BatchFit(
        state=best.state,
        covariance=spread.covariance,
        sigma_db=sigma_db,
        n=len(obs),
        converged=best.converged and ended_well(best.state, spread.covariance, obs),
        cost=best.cost,
        inflation=spread.inflation,
        bounded=spread.bounded,
        rivals=_distinct(best.state, near),
    )


def _sandwich(search: Search, state: FloatArray) -> Sandwich:
    try:
        with np.errstate(all="ignore"):  # what overflows is no covariance, and is NaN below
            return sandwich(search.linear_problem(state), search.rows.jacobian(state), state)
    except (ValueError, OverflowError, np.linalg.LinAlgError):
        return Sandwich(np.full((4, 4), np.nan), np.nan, 1.0, bounded=False)


def _sigma_db(levels: Rows, state: FloatArray, *, robust: bool) -> float:
    """Size of one reading's residual, at least that of rounding."""
    r = levels.residuals(state)
    if robust:
        sigma_db = float(np.median(np.abs(r))) * _SIGMA_PER_MEDIAN
    else:
        sigma_db = float(np.sqrt(r @ r / max(len(r) - 4, 1)))
    return max(sigma_db, _ROUNDING_DB)


def _distinct(best: FloatArray, others: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Those of the states that are elsewhere than the best one and than each other."""
    distinct = [best]
    for other in others:
        if all(np.hypot(*(other[:2] - state[:2])) > _SAME_POSITION_M for state in distinct):
            distinct.append(other)
    return tuple(distinct[1:])
