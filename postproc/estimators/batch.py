"""Least squares over [x, y, P0, eta] from several starts.

Model z_k = P0 - 10 eta log10(d_k) + v_k. Levenberg-Marquardt with the analytic Jacobian, trust region where a robust
loss is asked for. Least squares is as good as its start and silent about other minima: start it from the modes of
the posterior, and read `rivals`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from logger.core.arrays import FloatArray
from logger.core.ellipse import CHI2_95_2DOF
from logger.core.errors import EstimationError
from logger.core.observations import CellObservations
from logger.core.pathloss import log_distance_db
from postproc.estimators.metrics import lag1

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]

_C = 10.0 / log(10.0)
_SAME_PLACE_M = 5.0
_ROUNDING_DB = 12.0**-0.5
_MOST_LAGS = 200


@dataclass(frozen=True)
class BatchFit:
    """Best fit: `state` [x, y, P0, eta], `covariance` (4, 4), residual `sigma_db`, readings `n`, `cost` chi2 / 2.

    `inflation` is the factor by which correlated residuals have widened the covariance. `rivals` are the states of
    other minima that the readings cannot tell from the best one (chi-square within 5.991).
    """

    state: FloatArray
    covariance: FloatArray
    sigma_db: float
    n: int
    converged: bool
    cost: float
    inflation: float
    rivals: tuple[FloatArray, ...]


def residuals(state: FloatArray, obs: CellObservations) -> FloatArray:
    """Model minus level in dB, shape (n,)."""
    x_m, y_m, p0_dbm, eta = state
    return np.asarray(p0_dbm - eta * log_distance_db(x_m - obs.x_m, y_m - obs.y_m) - obs.level_dbm, float)


def jacobian(state: FloatArray, obs: CellObservations) -> FloatArray:
    """Derivative of `residuals` by the state, shape (n, 4); zero by x and y inside the 1 m clamp."""
    dx, dy = state[0] - obs.x_m, state[1] - obs.y_m
    d2 = dx**2 + dy**2
    slope = np.where(d2 > 1.0, -_C * state[3] / np.maximum(d2, 1.0), 0.0)
    return np.column_stack([slope * dx, slope * dy, np.ones_like(dx), -log_distance_db(dx, dy)])


def fit_linear(distance_db: FloatArray, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P0 and eta at a known position: least squares of z = P0 - eta L, and (Phi' Phi)^+ (times sigma^2: covariance)."""
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
    whiten: bool = False,
) -> BatchFit:
    """Best of the fits started at positions (x, y) in metres.

    `whiten` takes differences z_k - rho z_k-1 with rho the lag-1 correlation of a first fit's residuals; it wants
    readings in time order. Raises `EstimationError` for fewer than 5 readings: 4 unknowns fit those exactly.
    """
    if len(obs) < 5 or not starts:
        raise EstimationError(f"{len(obs)} readings do not determine a position, power and exponent: at least 5")
    found = _minima(obs, starts, loss, rho=0.0)
    rho = 0.0
    if whiten:
        rho = float(np.clip(lag1(residuals(found[0][0], obs)), 0.0, 0.98))
        found = _minima(obs, [(s[0], s[1]) for s, _, _ in found], loss, rho=rho)
    state, cost, converged = found[0]
    sigma_db, covariance, inflation = _spread(state, obs, rho, loss)
    near = [other for other, c, _ in found[1:] if 2.0 * (c - cost) / (sigma_db**2 * inflation) < CHI2_95_2DOF]
    return BatchFit(state, covariance, sigma_db, len(obs), converged, cost, inflation, _apart(state, near))


def _minima(
    obs: CellObservations, starts: Sequence[tuple[float, float]], loss: Loss, *, rho: float
) -> list[tuple[FloatArray, float, bool]]:
    """State, cost and convergence of the fit from each start, best first."""

    def misfit(state: FloatArray) -> FloatArray:
        return _whitened(residuals(state, obs), rho)

    def slope(state: FloatArray) -> FloatArray:
        return _whitened(jacobian(state, obs), rho)

    scale_db = max(_noise_db(obs, starts), 1.0)
    found = []
    for x_m, y_m in starts:
        theta, _ = fit_linear(log_distance_db(x_m - obs.x_m, y_m - obs.y_m), obs.level_dbm)
        result = least_squares(
            misfit,
            np.array([x_m, y_m, *theta]),
            jac=slope,
            method="lm" if loss == "linear" else "trf",
            x_scale=(10.0, 10.0, 3.0, 0.3),
            loss=loss,
            f_scale=scale_db,
            max_nfev=200,
        )
        found.append((np.asarray(result.x, float), float(result.cost), bool(result.success)))
    return sorted(found, key=lambda one: one[1])


def _noise_db(obs: CellObservations, starts: Sequence[tuple[float, float]]) -> float:
    """Robust size of the residuals at the best start: median absolute residual / 0.6745."""
    sizes = []
    for x_m, y_m in starts:
        distance_db = log_distance_db(x_m - obs.x_m, y_m - obs.y_m)
        theta, _ = fit_linear(distance_db, obs.level_dbm)
        sizes.append(float(np.median(np.abs(theta[0] - theta[1] * distance_db - obs.level_dbm))) / 0.6745)
    return min(sizes)


def _whitened(rows: FloatArray, rho: float) -> FloatArray:
    """Rows k - rho times rows k - 1, over sqrt(1 - rho^2); the first as it is."""
    if rho <= 0.0:
        return rows
    return np.concatenate([rows[:1], (rows[1:] - rho * rows[:-1]) / np.sqrt(1.0 - rho**2)])


def _spread(state: FloatArray, obs: CellObservations, rho: float, loss: Loss) -> tuple[float, FloatArray, float]:
    """Residual sigma in dB, covariance of the state, and the inflation in it.

    sigma^2 (J'J)^-1 holds for independent residuals. Correlated ones, c_l at lag l, carry n / (1 + 2 sum c_l)
    readings' worth of information; the sum runs to the first negative c_l (initial positive sequence: Geyer,
    Statist. Sci. 7(4), 1992) and the covariance is multiplied by 1 + 2 sum c_l. With a robust loss sigma is the
    robust one, over the efficiency of 0.85 or better that the losses have with normal noise.
    """
    r, j = _whitened(residuals(state, obs), rho), _whitened(jacobian(state, obs), rho)
    # levels that fit perfectly are still rounded to whole dB
    sigma = max(float(np.sqrt(r @ r / max(len(r) - 4, 1))), _ROUNDING_DB)
    if loss != "linear":
        sigma = min(sigma, float(np.median(np.abs(r))) / 0.6745 / np.sqrt(0.85))
    inflation = _inflation(r)
    scale = np.sqrt(np.sum(j * j, axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    _, singular, axes = np.linalg.svd(j / scale, full_matrices=False)
    axes = axes / np.maximum(singular, 1e-8 * singular[0])[:, None]  # what is not observed is widely uncertain
    covariance = inflation * sigma**2 * (axes.T @ axes) / np.outer(scale, scale)
    return sigma, 0.5 * (covariance + covariance.T), inflation


def _inflation(r: FloatArray) -> float:
    """1 + 2 sum of the autocorrelations up to the first negative one, at least 1."""
    off = r - np.mean(r)
    power = float(off @ off)
    total = 0.0
    for lag in range(1, min(len(r) // 3, _MOST_LAGS)):
        correlation = float(off[lag:] @ off[:-lag]) / power if power > 0.0 else 0.0
        if correlation <= 0.0:
            break
        total += correlation
    return 1.0 + 2.0 * total


def _apart(state: FloatArray, others: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Those of the states that stand elsewhere than the best one and than each other."""
    kept = [state]
    for other in others:
        if all(np.hypot(*(other[:2] - one[:2])) > _SAME_PLACE_M for one in kept):
            kept.append(other)
    return tuple(kept[1:])
