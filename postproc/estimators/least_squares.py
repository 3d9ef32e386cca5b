"""Least squares over [x, y, P0, eta] by variable projection, from several starts.

Model z_k = P0 - eta L_k + v_k with L = 10 log10 d, d^2 = |(x, y) - p_k|^2 + h^2, d at least 1 m. At
a given place P0 and eta are linear, so Levenberg-Marquardt searches over the place only (Golub &
Pereyra, Inverse Problems 19(2), 2003; Jacobian by Kaufman, BIT 15, 1975). A robust loss and limited
readings end that: the search then goes on over all four.

What a limit hides is used, not left out. A level at the floor says that the true one is no higher,
by the residual sigma sqrt(-2 log Phi((floor - model) / sigma)) (Tobin, Econometrica 26(1), 1958).

Least squares is as good as its start and silent about other minima: start it from the modes of the
posterior, and read `rivals` and `bounded`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfcx, log_ndtr

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.ellipse import CHI2_95_2DOF
from logger.core.errors import EstimationError
from logger.core.observations import CellObservations
from postproc.estimators.convergence import ended_well, is_possible
from postproc.estimators.least_squares_covariance import Spread, Working, distance_db, spread
from postproc.estimators.residual_covariance import squares
from postproc.estimators.robust_losses import Loss, influence

_OfPlace = Callable[[FloatArray], FloatArray]

_C = 10.0 / log(10.0)
_FEWEST = 5
_SAME_PLACE_M = 5.0
_ROUNDING_DB = 12.0**-0.5
_MOST_ROWS = 2000
_SQUARE_M = 1.0
_STEPS = 200


@dataclass(frozen=True)
class BatchFit:
    """Best fit: `state` [x, y, P0, eta], `covariance` (4, 4), residual `sigma_db`, readings `n`,
    `cost` chi2 / 2.

    `converged` is False also for what cannot be (`sound`): an exponent that is not positive or a
    place over 30 km away. State and covariance are then no answer; a covariance that could not be
    computed is NaN. `inflation` is the factor by which correlated residuals have widened the
    covariance of the place. `bounded` is False where in some direction places fit as well as far as
    30 km away; the covariance then reaches that far. `rivals` are the states of other minima that
    the readings cannot tell from the best one (chi-square within 5.991).
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


class _Rows(NamedTuple):
    """Readings, gathered by place where there are many, shape (n,); `limit` is -1 at the floor, 1
    at the ceiling.
    """

    x_m: FloatArray
    y_m: FloatArray
    level_dbm: FloatArray
    limit: IntArray
    readings: FloatArray
    weight: FloatArray

    @property
    def free(self) -> BoolArray:
        """Which rows are levels, not limits."""
        return np.asarray(self.limit == 0, np.bool_)

    def levels(self) -> "_Rows":
        """Those rows."""
        return _Rows._make(column[self.free] for column in self)


class _Minimum(NamedTuple):
    state: FloatArray
    cost: float
    converged: bool


def residuals(
    state: FloatArray, obs: CellObservations | _Rows, height_m: float = 0.0
) -> FloatArray:
    """Model minus level in dB, shape (n,)."""
    distance = distance_db(obs.x_m, obs.y_m, state[0], state[1], height_m)
    return np.asarray(state[2] - state[3] * distance - obs.level_dbm, float)


def jacobian(state: FloatArray, obs: CellObservations | _Rows, height_m: float = 0.0) -> FloatArray:
    """Derivative of `residuals` by the state, shape (n, 4); zero by x and y where d is held at 1
    m.
    """
    dx, dy = state[0] - obs.x_m, state[1] - obs.y_m
    d2 = dx**2 + dy**2 + height_m**2
    slope = np.where(d2 > 1.0, -_C * state[3] / np.maximum(d2, 1.0), 0.0)
    distance = distance_db(obs.x_m, obs.y_m, state[0], state[1], height_m)
    return np.column_stack([slope * dx, slope * dy, np.ones_like(dx), -distance])


def fit_linear(distance_db: FloatArray, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P0 and eta at a known position: least squares of z = P0 - eta L, and (Phi' Phi)^+ (times
    sigma^2: covariance).
    """
    middle = float(np.mean(distance_db))
    design = np.column_stack([np.ones_like(distance_db), middle - distance_db])
    inverse = np.linalg.pinv(design)
    at_middle = inverse @ level_dbm
    shift = np.array([[1.0, middle], [0.0, 1.0]])  # P0 = level at the middle + eta L_middle
    return shift @ at_middle, shift @ inverse @ inverse.T @ shift.T


def fit(
    obs: CellObservations,
    starts: Sequence[tuple[float, float]],
    *,
    loss: Loss = "linear",
    height_m: float = 0.0,
) -> BatchFit:
    """Best of the fits started at positions (x, y) in metres, for an antenna `height_m` above the
    receiver.

    Raises `EstimationError` for fewer than 5 readings within the receiver's limits: 4 unknowns fit
    those exactly.
    """
    limit = obs.limit
    n_free = int(np.count_nonzero(limit == 0))
    if n_free < _FEWEST or not starts:
        raise EstimationError(
            f"{n_free} readings do not determine a position, power and exponent: at least {_FEWEST}"
        )
    rows = _gathered(obs, limit, robust=loss != "linear")
    sigma_db = _sigma_db(
        obs, limit, [_at(rows, *start, height_m) for start in starts], height_m, robust=True
    )
    found = _Search(rows, loss, height_m, sigma_db).minima(starts)
    sigma_db = _sigma_db(obs, limit, [found[0].state], height_m, robust=loss != "linear")
    search = _Search(rows, loss, height_m, sigma_db)
    if not np.all(rows.free):
        # how much a limit hides depends on sigma, of which the first fit knows more
        found = search.minima([(float(one.state[0]), float(one.state[1])) for one in found])
    state, cost, converged = found[0]
    wide = _spread(search, state, height_m)
    converged = converged and ended_well(state, wide.covariance, obs)
    allowed = 0.5 * CHI2_95_2DOF * wide.variance_db2 * max(wide.inflation, 1.0)
    near = [one.state for one in found[1:] if one.converged and one.cost - cost < allowed]
    rivals = _apart(state, near)
    return BatchFit(
        state,
        wide.covariance,
        sigma_db,
        len(obs),
        converged,
        cost,
        wide.inflation,
        wide.bounded,
        rivals,
    )


_NO_SPREAD = Spread(np.full((4, 4), np.nan), np.nan, 1.0, bounded=False)


def _spread(search: "_Search", state: FloatArray, height_m: float) -> Spread:
    try:
        with np.errstate(all="ignore"):  # what overflows is no covariance, and is left out as such
            return spread(
                search.working(state), jacobian(state, search.rows, height_m), state, height_m
            )
    except (ValueError, OverflowError, np.linalg.LinAlgError):
        return _NO_SPREAD


def _gathered(obs: CellObservations, limit: IntArray, *, robust: bool) -> _Rows:
    """The readings or, of more than 2000, their means by square; a robust fit takes the medians.

    Readings of one place share its shadowing: n of them weigh 2 n / (n + 1), as if half of the
    variance were shared.
    """
    square = squares(obs.x_m, obs.y_m, _MOST_ROWS, _SQUARE_M)
    there = np.bincount(square).astype(float)
    if len(obs) <= _MOST_ROWS:
        return _Rows(
            obs.x_m, obs.y_m, obs.level_dbm, limit, np.ones(len(obs)), 2.0 / (there[square] + 1.0)
        )
    kind, row = np.unique(3 * square + limit + 1, return_inverse=True)
    count = np.bincount(row).astype(float)
    x_m, y_m, level_dbm = (np.bincount(row, v) / count for v in (obs.x_m, obs.y_m, obs.level_dbm))
    if robust:
        middle = np.cumsum(count) - 0.5 * count
        level_dbm = obs.level_dbm[np.lexsort((obs.level_dbm, row))][middle.astype(np.int64)]
    return _Rows(x_m, y_m, level_dbm, kind % 3 - 1, count, 2.0 * count / (there[kind // 3] + 1.0))


def _at(rows: _Rows, x_m: float, y_m: float, height_m: float) -> FloatArray:
    """State of a place: P0 and eta by least squares over the levels."""
    distance = distance_db(rows.x_m, rows.y_m, x_m, y_m, height_m)
    root = np.sqrt(rows.weight)[rows.free]
    design = root[:, None] * np.column_stack([np.ones_like(root), -distance[rows.free]])
    p0_dbm, eta = np.linalg.lstsq(design, root * rows.level_dbm[rows.free], rcond=None)[0]
    return np.array([x_m, y_m, p0_dbm, eta])


def _sigma_db(
    obs: CellObservations,
    limit: IntArray,
    states: Sequence[FloatArray],
    height_m: float,
    *,
    robust: bool,
) -> float:
    """Size of one reading's residual at the best of some states, 0.3 dB at least: levels are
    rounded to whole dB.
    """
    sizes = []
    for state in states:
        r = residuals(state, obs, height_m)[limit == 0]
        sizes.append(
            float(np.median(np.abs(r))) / 0.6745
            if robust
            else float(np.sqrt(r @ r / max(len(r) - 4, 1)))
        )
    return max(min(sizes), _ROUNDING_DB)


class _Search(NamedTuple):
    """What is minimised: weighted loss of the deviations; `sigma_db` scales a robust loss and
    limits.
    """

    rows: _Rows
    loss: Loss
    height_m: float
    sigma_db: float

    def minima(self, starts: Sequence[tuple[float, float]]) -> list[_Minimum]:
        """Minimum reached from each start, best first; what cannot be comes last."""
        found = []
        for start in starts:
            projected = self._projected(start)
            if self.loss == "linear" and np.all(self.rows.free):
                found.append(projected)
            else:
                begun = (projected.state, _at(self.rows, *start, self.height_m))
                found.append(
                    min((self._polished(state) for state in begun), key=lambda one: one.cost)
                )
        return sorted(found, key=lambda one: (not one.converged, one.cost))

    def _projected(self, start: tuple[float, float]) -> _Minimum:
        """Least squares of the levels over the place, P0 and eta projected out."""
        misfit, slope = self._projection()
        method: Literal["lm", "trf"] = "lm" if np.count_nonzero(self.rows.free) >= 2 else "trf"

        def search() -> _Minimum:
            found = least_squares(
                misfit, start, jac=slope, method=method, x_scale=(10.0, 10.0), max_nfev=_STEPS
            )
            state = _at(self.rows, float(found.x[0]), float(found.x[1]), self.height_m)
            return self._minimum(state, found.cost, found.success)

        return _run_away_allowed(search, _at(self.rows, *start, self.height_m))

    def _projection(self) -> tuple[_OfPlace, _OfPlace]:
        """Misfit off the span of what P0 and eta can do, and its derivative without that of the
        span (Kaufman).
        """
        rows = self.rows.levels()
        root = np.sqrt(rows.weight)

        def off(place: FloatArray, values: FloatArray) -> FloatArray:
            distance = distance_db(rows.x_m, rows.y_m, place[0], place[1], self.height_m)
            basis = np.linalg.qr(root[:, None] * np.column_stack([np.ones_like(root), -distance]))[
                0
            ]
            return np.asarray(values - basis @ (basis.T @ values), float)

        def misfit(place: FloatArray) -> FloatArray:
            return off(place, root * rows.level_dbm)

        def slope(place: FloatArray) -> FloatArray:
            state = _at(rows, place[0], place[1], self.height_m)
            return off(place, -root[:, None] * jacobian(state, rows, self.height_m)[:, :2])

        return misfit, slope

    def _polished(self, state: FloatArray) -> _Minimum:
        """Minimum of the whole loss over all four unknowns."""
        root = np.sqrt(self.rows.weight)

        def misfit(state: FloatArray) -> FloatArray:
            return root * self._deviation(state)[0]

        def slope(state: FloatArray) -> FloatArray:
            rate = root * self._deviation(state)[1]
            return rate[:, None] * jacobian(state, self.rows, self.height_m)

        def search() -> _Minimum:
            found = least_squares(
                misfit,
                state,
                jac=slope,
                method="lm" if self.loss == "linear" and len(root) >= 4 else "trf",
                x_scale=(10.0, 10.0, 3.0, 0.3),
                loss=self.loss,
                f_scale=max(self.sigma_db, 1.0),
                max_nfev=_STEPS,
            )
            return self._minimum(np.asarray(found.x, float), found.cost, found.success)

        return _run_away_allowed(search, state)

    def _minimum(self, state: FloatArray, cost: float, success: bool) -> _Minimum:
        return _Minimum(
            state, float(cost), success and is_possible(state, self.rows.x_m, self.rows.y_m)
        )

    def _deviation(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deviation in dB of each row, positive where the model is too high, and its derivative by
        the model.
        """
        r, rate = residuals(state, self.rows, self.height_m), np.ones(len(self.rows.limit))
        side = -self.rows.limit[~self.rows.free]
        u = -side * r[~self.rows.free] / self.sigma_db
        log_hidden = log_ndtr(u)
        size = self.sigma_db * np.sqrt(np.maximum(-2.0 * log_hidden, 1e-12))
        mills = sqrt(2.0 / np.pi) / erfcx(
            -u / sqrt(2.0)
        )  # phi(u) / Phi(u), which are both 0 far out
        r[~self.rows.free], rate[~self.rows.free] = side * size, self.sigma_db * mills / size
        return r, rate

    def working(self, state: FloatArray) -> Working:
        """The linear problem with the same minimum: a level deviates by psi(r) / (mean psi'
        dr/dmodel).
        """
        r, rate = self._deviation(state)
        psi, slope = influence(self.loss, np.sqrt(self.rows.weight) * r / max(self.sigma_db, 1.0))
        kept = rate > 1e-3
        e = r * psi / (max(float(np.mean(slope)), 0.1) * np.maximum(rate, 1e-3))
        model = residuals(state, self.rows, self.height_m) + self.rows.level_dbm
        weight = self.rows.weight * np.where(kept, rate**2, 1e-6)
        return Working(self.rows.x_m, self.rows.y_m, model - e, self.rows.readings, weight)


def _run_away_allowed(search: Callable[[], _Minimum], start: FloatArray) -> _Minimum:
    """What a search has reached, or its start where it ran so far away that floats do not hold
    it.
    """
    try:
        with np.errstate(all="ignore"):
            found = search()
    except (ValueError, np.linalg.LinAlgError):
        found = None
    if found is None or not np.all(np.isfinite(found.state)):
        return _Minimum(start, np.inf, converged=False)
    return found


def _apart(state: FloatArray, others: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Those of the states that stand elsewhere than the best one and than each other."""
    kept = [state]
    for other in others:
        if all(np.hypot(*(other[:2] - one[:2])) > _SAME_PLACE_M for one in kept):
            kept.append(other)
    return tuple(kept[1:])
