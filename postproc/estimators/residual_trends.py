"""Trends in the residuals of a fit, tested with their correlation and beside the fit's own columns.

With design X of the fit, further columns T and residuals e of covariance Omega, all averaged over
squares and whitened, the part of T off X gives the generalised least-squares estimate (Frisch &
Waugh, Econometrica 1(4), 1933)

    b = (T' T)^-1 T' e,    cov b = (T' T)^-1
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model import path_loss
from logger.core.places import Places
from postproc.estimators.residual_covariance import (
    ResidualNoise,
    averages,
    residual_noise,
    unit_columns,
)

_LEAST_OFF_SHARE = 1e-3  # of a column off the fit's: less is rounding
_SINGULAR = 1e-6  # singular values below it are rounding
_LEAST_SIGMA_DB = 0.01  # a bin that the fit passes through exactly
_BREAKPOINTS = (0.25, 0.5, 0.75)  # of the range of L


class Ground(NamedTuple):
    """Levels of a walk, shape (n,): position, residual `e_db`, L = 10 log10 d, azimuth in radians.

    The azimuth is that seen from the estimate; `design` (n, 4) is the derivative of the model by
    the state.
    """

    x_m: FloatArray
    y_m: FloatArray
    e_db: FloatArray
    distance_db: FloatArray
    azimuth: FloatArray
    design: FloatArray


class Bins(NamedTuple):
    """Mean residuals and their standard errors, shape (m,), in bins about `centre`.

    `centre` is in metres, or in degrees of azimuth.
    """

    centre: FloatArray
    mean_db: FloatArray
    sigma_db: FloatArray
    readings: IntArray


class ExponentChange(NamedTuple):
    """Change of the exponent beyond a distance, and its standard error.

    Positive where levels fall faster there.
    """

    distance_m: float
    eta_change: float
    eta_sigma: float


class Sector(NamedTuple):
    """Direction in which levels are strongest, and the difference to the opposite one.

    `chi2` has 2 degrees of freedom.
    """

    azimuth_deg: float
    difference_db: float
    difference_sigma_db: float
    chi2: float


def noise_of(ground: Ground, *columns: FloatArray) -> ResidualNoise:
    """Noise of the residuals beside the fit and further columns (n,)."""
    one = np.ones(len(ground.e_db))
    design = np.column_stack([ground.design, *columns])
    return residual_noise(Places.of(ground.x_m, ground.y_m), one, one, design, ground.e_db)


def exponent_change(ground: Ground) -> ExponentChange | None:
    """The most significant change of the exponent beyond a quarter, half or three quarters of L."""
    low, high = np.quantile(ground.distance_db, [0.02, 0.98])
    changes = []
    for share in _BREAKPOINTS:
        break_db = low + share * (high - low)
        estimate = _estimate_beside_fit(ground, -np.maximum(ground.distance_db - break_db, 0.0))
        if estimate is not None:
            (change,), ((variance,),) = estimate
            distance_m = float(path_loss.distance_m(break_db))
            changes.append(ExponentChange(distance_m, float(change), float(np.sqrt(variance))))
    return max(changes, key=lambda c: abs(c.eta_change) / c.eta_sigma, default=None)


def sector(ground: Ground) -> Sector | None:
    """First harmonic of the residuals over the azimuth: e = a sin + b cos."""
    estimate = _estimate_beside_fit(ground, np.sin(ground.azimuth), np.cos(ground.azimuth))
    if estimate is None:
        return None
    harmonic, covariance = estimate
    size = max(float(np.hypot(*harmonic)), 1e-12)
    direction = harmonic / size
    return Sector(
        azimuth_deg=float(np.degrees(np.arctan2(*harmonic)) % 360.0),
        difference_db=2.0 * size,
        difference_sigma_db=2.0 * float(np.sqrt(direction @ covariance @ direction)),
        chi2=float(harmonic @ np.linalg.solve(covariance, harmonic)),
    )


def _estimate_beside_fit(
    ground: Ground, *columns: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Coefficients (k,) of further columns and their covariance.

    None where the fit explains all that they do.
    """
    noise = noise_of(ground, *columns)
    rows = np.column_stack([unit_columns(ground.design), *columns, ground.e_db])
    rows = averages(noise.square, np.ones(len(rows)), rows)
    white = np.linalg.solve(np.linalg.cholesky(noise.covariance_db2), rows)
    design, further = white[:, :4], white[:, 4:]
    off = further - _project(design, further)
    off_columns, e = off[:, :-1], off[:, -1]
    if len(rows) <= rows.shape[1]:
        return None
    least = _LEAST_OFF_SHARE * np.linalg.norm(further[:, :-1], 2)
    if np.linalg.norm(off_columns, -2) < least:
        return None
    covariance = np.asarray(np.linalg.inv(off_columns.T @ off_columns), float)
    return covariance @ off_columns.T @ e, covariance


def _project(design: FloatArray, values: FloatArray) -> FloatArray:
    """The part of the columns of `values` that the design spans."""
    basis, size, _ = np.linalg.svd(design, full_matrices=False)
    basis = basis[:, size > _SINGULAR * size[0]]
    return np.asarray(basis @ (basis.T @ values), float)


def bin_means(ground: Ground, noise: ResidualNoise, number: IntArray, centre: FloatArray) -> Bins:
    """Mean residual of each bin; `number` (n,) is the bin of each level.

    The standard error is that of residuals left by a fit, (I - H) Omega (I - H)' with H = X (X'
    X)^-1 X'.
    """
    of_square = np.zeros((len(centre), len(noise.covariance_db2)))
    np.add.at(of_square, (number, noise.square), 1.0)
    readings = np.sum(of_square, axis=1).astype(np.int64)
    occupied = np.flatnonzero(readings)
    mean = of_square[occupied] / readings[occupied, None]
    root = np.sqrt(np.bincount(noise.square))
    ones = np.ones(len(number))
    design = root[:, None] * averages(noise.square, ones, unit_columns(ground.design))
    off = mean - root * _project(design, (mean / root).T).T
    variance = np.einsum("bi,ij,bj->b", off, noise.covariance_db2, off)
    sigma_db = np.maximum(np.sqrt(variance), _LEAST_SIGMA_DB)
    mean_db = np.bincount(number, ground.e_db, len(centre))[occupied] / readings[occupied]
    return Bins(centre[occupied], mean_db, sigma_db, readings[occupied])
