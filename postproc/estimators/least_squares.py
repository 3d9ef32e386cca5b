"""Least squares over [x, y, P0, eta] from several starts.

Least squares is as good as its start: start it from the modes of the posterior, and read `rivals`
and `bounded`.

At a given position P0 and eta are linear, so Levenberg-Marquardt searches over the position only
(variable projection: Golub & Pereyra, Inverse Problems 19(2), 2003; Jacobian by Kaufman, BIT 15,
1975). A robust loss and limited readings end that: the search then goes on over all four. A level
at the floor means that the true one is no higher, by the residual
sigma sqrt(-2 log Phi((floor - model) / sigma)) (Tobin, Econometrica 26(1), 1958).

The search is not scipy's, which takes half a second of imports and gives other answers in the same
time: of 504 measured walks 250 (trf) to 389 (lm, tolerance 1e-12) ended within 1 cm of these, up to
7 at a higher minimum, and in 3 to 6 the verdict on convergence differed.

The covariance counts correlated residuals: for the weighted linear problem with design J, weights W
and residuals of covariance Omega (`residuals.residual_noise`)

    cov = (J' W J)^-1 J' W Omega W J (J' W J)^-1

(sandwich: Huber 1967; White, Econometrica 48(4), 1980). It takes the model as linear about the
minimum. Where the misfit rises more slowly than that, each axis of the position's ellipse is
stretched to where the misfit, minimised over P0 and eta, has risen by what was expected at its end;
a profile likelihood, one axis at a time.

The 95 % ellipse then held the truth in all of 80 simulated walks with 3 dB of white noise and in
81 % with 6 dB over 15 m, where sigma^2 (J' W J)^-1 did in 97 and 23 %. In 165 measured walks a
third of the ellipses are bounded, and 55 % of these held the truth.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.certainty import CHI2_95_2DOF
from logger.core.errors import EstimationError
from logger.core.locator.orthant import log_cdf_and_slope
from logger.core.model import path_loss
from logger.core.places import Places
from logger.core.readings import Readings
from postproc.estimators.convergence import REACH_M, ended_well, is_lost, is_possible
from postproc.estimators.least_squares_rows import Rows, each_reading, group
from postproc.estimators.residuals import (
    ROUNDING_DB,
    SIGMA_PER_MEDIAN,
    Shapes,
    averages,
    residual_noise,
)

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]


def influence(loss: Loss, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Influence psi(u) / u and its slope psi'(u), u in units of the loss's scale.

    The losses are scipy's.
    """
    if loss == "soft_l1":
        return (1.0 + u**2) ** -0.5, (1.0 + u**2) ** -1.5
    if loss == "huber":
        return 1.0 / np.maximum(np.abs(u), 1.0), np.where(np.abs(u) <= 1.0, 1.0, 0.0)
    if loss == "cauchy":
        return 1.0 / (1.0 + u**2), (1.0 - u**2) / (1.0 + u**2) ** 2
    return np.ones_like(u), np.ones_like(u)


_FIRST_DAMPING = 1e-3  # of the largest diagonal element: starts are near their minimum
_LEAST_GAIN = 1e-8  # relative: a cost that falls by less is that of the minimum
_LEAST_STEP = 1e-8  # in units of the scale
_MOST_DAMPING = 1e30  # no step improves: the cost is flat to the last bit, or not finite

_ArrayFunction = Callable[[FloatArray], FloatArray]


class Minimum(NamedTuple):
    """Where a search ended, half the sum of squares there, and whether that is a minimum.

    Of a search for [x, y, P0, eta] it has to be one that can be, too.
    """

    state: FloatArray
    cost: float
    converged: bool


def minimise(
    misfit: _ArrayFunction,
    slope: _ArrayFunction,
    start: FloatArray,
    scale: Sequence[float],
    most_steps: int,
    is_lost: Callable[[FloatArray], bool] | None = None,
) -> Minimum:
    """Minimum of |misfit|^2 / 2 over the unknowns, shape (k,), from a start.

    `misfit` maps the unknowns to shape (n,), `slope` to its derivative (n, k). `scale` has the
    usual size of a step in each unknown. A search that `is_lost` ends without a minimum.
    """
    unit = np.asarray(scale, float)
    x, e = np.asarray(start, float), misfit(start)
    cost, damping, growth = 0.5 * float(e @ e), 0.0, 2.0
    normal = gradient = np.empty(0)
    is_new = True
    for _ in range(most_steps):
        if is_new:
            jacobian = slope(x) * unit
            normal, gradient = jacobian.T @ jacobian, jacobian.T @ e
            damping = damping or _FIRST_DAMPING * float(np.max(np.diag(normal)))
        step = -np.linalg.solve(normal + damping * np.eye(len(x)), gradient)
        if float(np.max(np.abs(step))) < _LEAST_STEP:
            return Minimum(x, cost, converged=True)
        further = x + unit * step
        e_further = misfit(further)
        gain = cost - 0.5 * float(e_further @ e_further)
        promised = 0.5 * float(step @ (damping * step - gradient))
        is_new = gain > 0.0
        if is_new:
            x, e, cost = further, e_further, cost - gain
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain / promised - 1.0) ** 3)
            growth = 2.0
            if is_lost is not None and is_lost(x):
                return Minimum(x, cost, converged=False)
            if gain < _LEAST_GAIN * cost:
                return Minimum(x, cost, converged=True)
        else:
            damping, growth = damping * growth, 2.0 * growth
            if not damping < _MOST_DAMPING:
                return Minimum(x, cost, converged=bool(np.isfinite(cost)))
    return Minimum(x, cost, converged=False)


_Pair = tuple[FloatArray, FloatArray]

_STEPS = 100  # searches that converge take some 20
_SCALE = (10.0, 10.0, 3.0, 0.3)  # usual sigmas of x, y (m), P0 (dB) and eta
_LEAST_SCALE_DB = 1.0  # of a robust loss: levels are rounded to 1 dB
_LEAST_RATE, _LEAST_SLOPE = 1e-3, 0.1  # below these a row is far beyond what the loss follows


class Search(NamedTuple):
    """What is minimised: the loss of the rows' deviations.

    `sigma_db` scales a robust loss and limits.
    """

    rows: Rows
    loss: Loss
    sigma_db: float

    def minima(self, starts: Places) -> list[Minimum]:
        """Minima reached from starts, best first; impossible ones come last."""
        positions = list(starts.xy_m.T)
        projected = [self._search_position(start) for start in positions]
        if self.loss == "linear" and np.all(self.rows.free):
            return _best_first(projected)
        at_starts = [self.rows.best_at(start) for start in positions]
        return self._search_states([*(minimum.state for minimum in projected), *at_starts])

    def refine(self, minima: Sequence[Minimum]) -> list[Minimum]:
        """The minima of this search near those of one with another sigma, best first."""
        return self._search_states([minimum.state for minimum in minima])

    def _search_states(self, states: Sequence[FloatArray]) -> list[Minimum]:
        """Minima reached from states, best first; of states in one metre one is taken."""
        metres = (tuple(np.round(state[:2])) for state in states)
        each_once = dict(zip(metres, states, strict=True)).values()
        return _best_first([self._search_state(state) for state in each_once])

    def _search_position(self, start: FloatArray) -> Minimum:
        misfit, slope = self.projection()

        def search() -> Minimum:
            end = minimise(misfit, slope, start, _SCALE[:2], _STEPS)
            return self._minimum(self.rows.best_at(end.state), end.cost, end.converged)

        return _tolerate_divergence(search, self.rows.best_at(start))

    def projection(self) -> tuple[_ArrayFunction, _ArrayFunction]:
        """Misfit (n,) of a position beyond what P0 and eta explain, and its derivative (n, 2).

        The derivative leaves out that of the projection (Kaufman).
        """
        rows = self.rows.levels()
        root, best = np.sqrt(rows.weight), _latest(rows.regression)

        def misfit(position: FloatArray) -> FloatArray:
            state, distance_db = best(position)
            model_dbm = path_loss.level_dbm(state[2], state[3], distance_db)
            return root * (rows.level_dbm - model_dbm)

        def slope(position: FloatArray) -> FloatArray:
            state, distance_db = best(position)
            slopes = rows.position_slopes(position, state[3], distance_db)
            basis = np.linalg.qr(np.column_stack([root, root * distance_db]))[0]
            weighted = -root[:, None] * slopes
            return np.asarray(weighted - basis @ (basis.T @ weighted), float)

        return misfit, slope

    def _search_state(self, state: FloatArray) -> Minimum:
        root, deviation = np.sqrt(self.rows.weight), _latest(self.deviation)

        def misfit(state: FloatArray) -> FloatArray:
            return root * deviation(state)[0]

        def slope(state: FloatArray) -> FloatArray:
            return (root * deviation(state)[1])[:, None] * self.rows.jacobian(state)

        def search() -> Minimum:
            if self.loss == "linear":
                end = minimise(misfit, slope, state, _SCALE, _STEPS, is_lost)
            else:
                end = _minimise_loss(misfit, slope, state, self.loss, self._scale_db)
            return self._minimum(end.state, end.cost, end.converged)

        return _tolerate_divergence(search, state)

    @property
    def _scale_db(self) -> float:
        return max(self.sigma_db, _LEAST_SCALE_DB)

    def _minimum(self, state: FloatArray, cost: float, success: bool) -> Minimum:
        possible = is_possible(state, self.rows.places)
        return Minimum(state, float(cost), success and possible)

    def deviation(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deviation in dB (n,), positive where the model is too high, and its slope (n,)."""
        deviation, rate = self.rows.residuals(state), np.ones(len(self.rows.limit))
        hidden = ~self.rows.free
        side = -self.rows.limit[hidden]
        u = -side * deviation[hidden] / self.sigma_db
        log_phi, mills = log_cdf_and_slope(u)
        size = self.sigma_db * np.sqrt(np.maximum(-2.0 * log_phi, 1e-12))
        deviation[hidden], rate[hidden] = side * size, self.sigma_db * mills / size
        return deviation, rate

    def linear_problem(self, state: FloatArray) -> Rows:
        """Rows of the weighted linear problem with the same minimum.

        Their levels deviate by psi(r) / (mean psi' dr/dmodel).
        """
        r, rate = self.deviation(state)
        psi, slope = influence(self.loss, np.sqrt(self.rows.weight) * r / self._scale_db)
        mean_slope = max(float(np.mean(slope)), _LEAST_SLOPE)
        e = r * psi / (mean_slope * np.maximum(rate, _LEAST_RATE))
        model_dbm = self.rows.residuals(state) + self.rows.level_dbm
        weight = self.rows.weight * np.where(rate > _LEAST_RATE, rate**2, _LEAST_RATE**2)
        return self.rows._replace(level_dbm=model_dbm - e, weight=weight)


def _best_first(minima: Sequence[Minimum]) -> list[Minimum]:
    return sorted(minima, key=lambda minimum: (not minimum.converged, minimum.cost))


def _latest(function: Callable[[FloatArray], _Pair]) -> Callable[[FloatArray], _Pair]:
    """Remembers the last result: a slope is asked for where the misfit was."""
    at, found = np.empty(0), (np.empty(0), np.empty(0))

    def at_state(state: FloatArray) -> _Pair:
        nonlocal at, found
        if not np.array_equal(state, at):
            at, found = state.copy(), function(state)
        return found

    return at_state


def _minimise_loss(
    misfit: _ArrayFunction, slope: _ArrayFunction, start: FloatArray, loss: Loss, scale_db: float
) -> Minimum:
    from scipy.optimize import least_squares  # noqa: PLC0415 (half a second; rarely used)

    end = least_squares(
        misfit, start, jac=slope, x_scale=_SCALE, loss=loss, f_scale=scale_db, max_nfev=_STEPS
    )
    return Minimum(np.asarray(end.x, float), float(end.cost), bool(end.success))


def _tolerate_divergence(search: Callable[[], Minimum], start: FloatArray) -> Minimum:
    """The end of a search, or its start where it ran beyond what floats hold."""
    try:
        with np.errstate(all="ignore"):
            minimum = search()
    except (ValueError, np.linalg.LinAlgError):
        return Minimum(start, np.inf, converged=False)
    if not np.all(np.isfinite(minimum.state)):
        return Minimum(start, np.inf, converged=False)
    return minimum


_STEP = 2.0**0.25  # along a profile: the end of an axis is found to 19 %
_LEAST_M2 = 1e-6  # levels that are all alike fit exactly anywhere
_SINGULAR = 1e-8  # singular values below it are rounding


class Sandwich(NamedTuple):
    """Covariance (4, 4) of [x, y, P0, eta] and weighted residual variance.

    `inflation` is the factor by which correlation widens the position, `bounded` whether the
    readings end all axes of its ellipse.
    """

    covariance: FloatArray
    variance_db2: float
    inflation: float
    bounded: bool


def sandwich(rows: Rows, design: FloatArray, state: FloatArray) -> Sandwich:
    """Covariance of the fit whose minimum is `state` (4,).

    `rows` are those of the linear problem, `design` (n, 4) is the model's derivative by the state.
    """
    e = rows.residuals(state)
    scale = np.sqrt(rows.weight @ design**2)
    scale = np.where(scale > 0.0, scale, 1.0)
    scaled = design / scale
    bread = _inverse_square(np.sqrt(rows.weight)[:, None] * scaled)
    shapes = Shapes.of(rows.places, rows.readings, rows.weight)
    noise = residual_noise(shapes, design, e)
    total = np.bincount(noise.square, rows.weight)
    score = bread @ (total[:, None] * averages(noise.square, rows.weight, scaled)).T
    covariance = score @ noise.covariance_db2 @ score.T
    variance_db2 = float(rows.weight @ e**2) / max(len(e) - 4, 1)
    wide, narrow = np.linalg.det(covariance[:2, :2]), np.linalg.det(variance_db2 * bread[:2, :2])
    inflation = float(np.sqrt(wide / narrow)) if wide > 0.0 < narrow else 1.0
    unit = np.outer(scale, scale)
    covariance, bounded = _stretch(rows, state, covariance / unit, bread / unit)
    return Sandwich(covariance, variance_db2, inflation, bounded)


def _inverse_square(rows: FloatArray) -> FloatArray:
    """(A' A)^-1; what is not observed is widely uncertain."""
    _, size, axes = np.linalg.svd(rows, full_matrices=len(rows) < rows.shape[1])
    size = np.pad(size, (0, rows.shape[1] - len(size)))
    axes = axes / np.maximum(size, _SINGULAR * size[0])[:, None]
    return np.asarray(axes.T @ axes, float)


def _stretch(
    rows: Rows, state: FloatArray, covariance: FloatArray, bread: FloatArray
) -> tuple[FloatArray, bool]:
    """Covariance with the position's axes stretched, and whether the readings end all of them."""
    position = covariance[:2, :2]
    curvature = np.linalg.pinv(bread[:2, :2])
    variance, axes = np.linalg.eigh(position)
    variance = np.maximum(variance, _LEAST_M2)
    reach_m = np.empty(2)
    for k, axis in enumerate(axes.T):
        begin_m = np.sqrt(CHI2_95_2DOF * variance[k])
        rise = CHI2_95_2DOF * variance[k] * (axis @ curvature @ axis)
        reach_m[k] = max(end_m(rows, state, side * axis, begin_m, rise) for side in (1.0, -1.0))
    more = axes @ np.diag(reach_m**2 / CHI2_95_2DOF - variance) @ axes.T
    # P0 and eta move with the position
    along = np.vstack([np.eye(2), (np.linalg.pinv(position) @ covariance[:2, 2:]).T])
    stretched = covariance + along @ more @ along.T
    return 0.5 * (stretched + stretched.T), bool(np.all(reach_m < REACH_M))


def end_m(rows: Rows, state: FloatArray, axis: FloatArray, begin_m: float, rise: float) -> float:
    """Distance from the minimum along `axis` (2,) at which the misfit has risen by `rise`.

    `begin_m` at least, 30 km at most.
    """
    if begin_m >= REACH_M:
        return begin_m
    n_steps = 2 + int(np.log(REACH_M / begin_m) / np.log(_STEP))
    lowest = profile_misfit(rows, state)
    for step_m in np.geomspace(begin_m, REACH_M, n_steps).tolist():
        if profile_misfit(rows, state[:2] + step_m * axis) - lowest >= rise:
            return float(step_m)
    return REACH_M


def profile_misfit(rows: Rows, position: FloatArray) -> float:
    """Weighted squared misfit of a position [x, y, ...], P0 and eta free."""
    state, distance_db = rows.regression(position)
    residual_db = path_loss.level_dbm(state[2], state[3], distance_db) - rows.level_dbm
    return float(rows.weight @ residual_db**2)


_FEWEST = 5  # levels; four unknowns fit four exactly
_SAME_POSITION_M = 5.0  # searches that end nearer have found the same minimum


@dataclass(frozen=True)
class BatchFit:
    """Best fit: `state` [x, y, P0, eta], `covariance` (4, 4), residual `sigma_db`, readings `n`.

    `cost` is chi2 / 2. `converged` is False also for an exponent that is not positive and a
    position over 30 km away. State and covariance are then no answer; a covariance that could not
    be computed is NaN. `inflation` is the factor by which correlated residuals have widened the
    covariance of the position. `bounded` is False where in some direction positions fit as well up
    to 30 km away; the covariance then reaches that far. `rivals` are states of other minima within
    5.991 of the best chi-square.
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


def fit(
    obs: Readings,
    starts: Places,
    *,
    loss: Loss = "linear",
    height_m: float = 0.0,
) -> BatchFit:
    """Best fit from some starts (k,); `height_m` is the antenna's, in metres.

    Raises `EstimationError` for fewer than 5 readings within the receiver's limits.
    """
    n_levels = int(np.count_nonzero(obs.limit == 0))
    if n_levels < _FEWEST or not len(starts):
        raise EstimationError(
            f"{n_levels} readings do not determine a position, power and exponent: "
            f"at least {_FEWEST}"
        )
    robust = loss != "linear"
    rows, levels = group(obs, height_m, robust=robust), each_reading(obs, height_m).levels()
    sigma_db = min(_sigma_db(levels, rows.best_at(start), robust=True) for start in starts.xy_m.T)
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
        sigma_db = float(np.median(np.abs(r))) * SIGMA_PER_MEDIAN
    else:
        sigma_db = float(np.sqrt(r @ r / max(len(r) - 4, 1)))
    return max(sigma_db, ROUNDING_DB)


def _distinct(best: FloatArray, others: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Those of the states that are elsewhere than the best one and than each other."""
    distinct = [best]
    for other in others:
        if all(np.hypot(*(other[:2] - state[:2])) > _SAME_POSITION_M for state in distinct):
            distinct.append(other)
    return tuple(distinct[1:])
