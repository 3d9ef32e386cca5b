"""Search of the minima of a least-squares fit over [x, y, P0, eta].

At a given position P0 and eta are linear, so Levenberg-Marquardt searches over the position only
(variable projection: Golub & Pereyra, Inverse Problems 19(2), 2003; Jacobian by Kaufman, BIT 15,
1975). A robust loss and limited readings end that: the search then goes on over all four.

A level at the floor means that the true one is no higher, by the residual
sigma sqrt(-2 log Phi((floor - model) / sigma)) (Tobin, Econometrica 26(1), 1958).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.normal_tail import log_cdf_and_slope
from logger.core.model import path_loss
from logger.core.places import Places
from postproc.estimators.convergence import is_lost, is_possible
from postproc.estimators.least_squares_rows import Rows
from postproc.estimators.levenberg_marquardt import Ending, minimise
from postproc.estimators.robust_losses import Loss, influence

_ArrayFunction = Callable[[FloatArray], FloatArray]
_Pair = tuple[FloatArray, FloatArray]

_STEPS = 100  # searches that converge take some 20
_SCALE = (10.0, 10.0, 3.0, 0.3)  # usual sigmas of x, y (m), P0 (dB) and eta
_LEAST_SCALE_DB = 1.0  # of a robust loss: levels are rounded to 1 dB
_LEAST_RATE, _LEAST_SLOPE = 1e-3, 0.1  # below these a row is far beyond what the loss follows


class Minimum(NamedTuple):
    """A state [x, y, P0, eta], its cost chi2 / 2, and whether it is one that can be."""

    state: FloatArray
    cost: float
    converged: bool


class Search(NamedTuple):
    """What is minimised: the loss of the rows' deviations.

    `sigma_db` scales a robust loss and limits.
    """

    rows: Rows
    loss: Loss
    sigma_db: float

    def minima(self, starts: Sequence[tuple[float, float]]) -> list[Minimum]:
        """Minima reached from starts (x, y), best first; impossible ones come last."""
        projected = [self._search_position(start) for start in starts]
        if self.loss == "linear" and np.all(self.rows.free):
            return _best_first(projected)
        at_starts = [self.rows.best_at(*start) for start in starts]
        return self._search_states([*(minimum.state for minimum in projected), *at_starts])

    def refine(self, minima: Sequence[Minimum]) -> list[Minimum]:
        """The minima of this search near those of another with a different sigma, best first."""
        return self._search_states([minimum.state for minimum in minima])

    def _search_states(self, states: Sequence[FloatArray]) -> list[Minimum]:
        """Minima of the loss reached from states, of those within a metre from one, best first."""
        metres = (tuple(np.round(state[:2])) for state in states)
        each_once = dict(zip(metres, states, strict=True)).values()
        return _best_first([self._search_state(state) for state in each_once])

    def _search_position(self, start: tuple[float, float]) -> Minimum:
        """Least squares of the levels over the position, P0 and eta projected out."""
        misfit, slope = self.projection()

        def search() -> Minimum:
            end = minimise(misfit, slope, np.array(start, float), _SCALE[:2], _STEPS)
            state = self.rows.best_at(float(end.x[0]), float(end.x[1]))
            return self._minimum(state, end.cost, end.converged)

        return _tolerate_divergence(search, self.rows.best_at(*start))

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
            dx_m, dy_m = position[0] - rows.x_m, position[1] - rows.y_m
            slopes = path_loss.position_slopes(dx_m, dy_m, state[3], distance_db)
            basis = np.linalg.qr(np.column_stack([root, root * distance_db]))[0]
            weighted = -root[:, None] * slopes
            return np.asarray(weighted - basis @ (basis.T @ weighted), float)

        return misfit, slope

    def _search_state(self, state: FloatArray) -> Minimum:
        """Minimum of the loss of all rows over all four unknowns."""
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
            return self._minimum(end.x, end.cost, end.converged)

        return _tolerate_divergence(search, state)

    @property
    def _scale_db(self) -> float:
        return max(self.sigma_db, _LEAST_SCALE_DB)

    def _minimum(self, state: FloatArray, cost: float, success: bool) -> Minimum:
        possible = is_possible(state, Places.of(self.rows.x_m, self.rows.y_m))
        return Minimum(state, float(cost), success and possible)

    def deviation(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deviation in dB of each row and its derivative by the model, shape (n,).

        Positive where the model is too high.
        """
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
    """The function, which knows its last result: a slope is asked for where the misfit was."""
    at, found = np.empty(0), (np.empty(0), np.empty(0))

    def at_state(state: FloatArray) -> _Pair:
        nonlocal at, found
        if not np.array_equal(state, at):
            at, found = state.copy(), function(state)
        return found

    return at_state


def _minimise_loss(
    misfit: _ArrayFunction, slope: _ArrayFunction, start: FloatArray, loss: Loss, scale_db: float
) -> Ending:
    """As `minimise`, for a robust loss."""
    from scipy.optimize import least_squares  # noqa: PLC0415 (half a second; rarely used)

    end = least_squares(
        misfit, start, jac=slope, x_scale=_SCALE, loss=loss, f_scale=scale_db, max_nfev=_STEPS
    )
    return Ending(np.asarray(end.x, float), float(end.cost), bool(end.success))


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
