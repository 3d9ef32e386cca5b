"""Trends in the residuals of a fit, judged with their correlation and beside what the fit could
still take up.

With design X of the fit, further columns T and residuals e of covariance Omega, all averaged over
squares and whitened, the part of T off X gives the generalised least-squares estimate (Frisch &
Waugh, Econometrica 1(4), 1933)

    b = (T' T)^-1 T' e,    cov b = (T' T)^-1
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from logger.core.arrays import FloatArray, IntArray
from postproc.estimators.residual_covariance import ResidualNoise, averages, residual_noise

_LEAST_OWN_SHARE = 1e-3
_SINGULAR = 1e-6
_LEAST_SIGMA_DB = 0.01  # a bin that the fit passes through exactly


class Ground(NamedTuple):
    """Levels of a walk, shape (n,): place, residual `e_db`, L = 10 log10 d, azimuth from the
    estimate in radians.

    `design` (n, 4) is the derivative of the model by the state.
    """

    x_m: FloatArray
    y_m: FloatArray
    e_db: FloatArray
    distance_db: FloatArray
    azimuth: FloatArray
    design: FloatArray


class Bins(NamedTuple):
    """Mean residuals and their standard errors, shape (m,), in bins about `centre` (metres, or
    degrees of azimuth).
    """

    centre: FloatArray
    mean_db: FloatArray
    sigma_db: FloatArray
    readings: IntArray


class Bend(NamedTuple):
    """Change of the exponent beyond a distance, positive where levels fall faster there, and its
    standard error.
    """

    distance_m: float
    eta_change: float
    eta_sigma: float


class Sector(NamedTuple):
    """How much stronger one side of the place is than the opposite one, towards which azimuth;
    chi-square (2).
    """

    azimuth_deg: float
    difference_db: float
    difference_sigma_db: float
    chi2: float


def noise_of(ground: Ground, *more: FloatArray) -> ResidualNoise:
    """Noise of the residuals beside the fit and further columns (n,)."""
    one = np.ones(len(ground.e_db))
    return residual_noise(
        ground.x_m, ground.y_m, one, one, np.column_stack([ground.design, *more]), ground.e_db
    )


def bend(ground: Ground) -> Bend | None:
    """The surest change of the exponent beyond a quarter, half or three quarters of the walk's
    range of L.
    """
    low, high = np.quantile(ground.distance_db, [0.02, 0.98])
    found = []
    for share in (0.25, 0.5, 0.75):
        at_db = low + share * (high - low)
        estimate = _own_part(ground, -np.maximum(ground.distance_db - at_db, 0.0))
        if estimate is not None:
            change, sigma = float(estimate[0][0]), float(np.sqrt(estimate[1][0, 0]))
            found.append(Bend(float(10.0 ** (0.1 * at_db)), change, sigma))
    return max(found, key=lambda one: abs(one.eta_change) / one.eta_sigma, default=None)


def sector(ground: Ground) -> Sector | None:
    """First harmonic of the residuals over the azimuth: e = a sin + b cos."""
    estimate = _own_part(ground, np.sin(ground.azimuth), np.cos(ground.azimuth))
    if estimate is None:
        return None
    (a, b), covariance = estimate
    size = max(float(np.hypot(a, b)), 1e-12)
    towards = np.array([a, b]) / size
    chi2 = float(np.array([a, b]) @ np.linalg.solve(covariance, [a, b]))
    sigma = float(np.sqrt(towards @ covariance @ towards))
    return Sector(float(np.degrees(np.arctan2(a, b)) % 360.0), 2.0 * size, 2.0 * sigma, chi2)


def _own_part(ground: Ground, *columns: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Coefficients (k,) of further columns and their covariance; None where the fit can do all that
    they do.
    """
    noise = noise_of(ground, *columns)
    one = np.ones(len(ground.e_db))
    rows = averages(
        noise.square, one, np.column_stack([_scaled(ground.design), *columns, ground.e_db])
    )
    white = solve_triangular(cholesky(noise.covariance_db2, lower=True), rows, lower=True)
    off = white[:, 4:] - _projected(white[:, :4], white[:, 4:])
    own, e = off[:, :-1], off[:, -1]
    free = len(rows) > rows.shape[1]
    if not free or np.linalg.norm(own, -2) < _LEAST_OWN_SHARE * np.linalg.norm(white[:, 4:-1], 2):
        return None
    covariance = np.asarray(np.linalg.inv(own.T @ own), float)
    return covariance @ own.T @ e, covariance


def _scaled(design: FloatArray) -> FloatArray:
    return np.asarray(design / np.maximum(np.sqrt(np.mean(design**2, axis=0)), 1e-300), float)


def _projected(design: FloatArray, values: FloatArray) -> FloatArray:
    """The part of the columns of `values` that the design spans."""
    basis, size, _ = np.linalg.svd(design, full_matrices=False)
    basis = basis[:, size > _SINGULAR * size[0]]
    return np.asarray(basis @ (basis.T @ values), float)


def binned(ground: Ground, noise: ResidualNoise, number: IntArray, centre: FloatArray) -> Bins:
    """Mean residual of each bin; `number` (n,) says which bin a level is in.

    The standard error is that of residuals left by a fit, (I - H) Omega (I - H)' with H = X (X'
    X)^-1 X'.
    """
    squares = len(noise.covariance_db2)
    each = np.zeros((len(centre), squares))
    np.add.at(each, (number, noise.square), 1.0)
    readings = np.sum(each, axis=1)
    kept = np.flatnonzero(readings > 0)
    mean = each[kept] / readings[kept, None]
    root = np.sqrt(np.bincount(noise.square))
    design = root[:, None] * averages(noise.square, np.ones(len(number)), _scaled(ground.design))
    left = (mean / root) - _projected(design, (mean / root).T).T
    left = left * root
    sigma = np.sqrt(np.einsum("bi,ij,bj->b", left, noise.covariance_db2, left))
    means = np.bincount(number, ground.e_db, len(centre))[kept] / readings[kept]
    return Bins(
        centre[kept], means, np.maximum(sigma, _LEAST_SIGMA_DB), readings[kept].astype(np.int64)
    )
