"""Tails of normal distributions: of one value, and of correlated values that are all positive.

The latter has no closed form for more than three dimensions. By expectation propagation each
reading's factor Phi is replaced by a Gaussian that leaves the same mean and variance where all
others are taken as given (Minka, UAI 2001; for this integral Cunningham, Hennig & Lacoste-Julien,
arXiv 1111.6832).
"""

from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from logger.core.arrays import FloatArray
from logger.core.model.noise import inverse_of_lower

Float = TypeVar("Float", np.float32, np.float64)

_SQRT_2PI = float(np.sqrt(2.0 * np.pi))
_HALF_ROOT = float(np.sqrt(0.125))  # of u: half of u / sqrt(2), the argument of erfc
_ERFC = (
    0.17087277,
    -0.82215223,
    1.48851587,
    -1.13520398,
    0.27886807,
    -0.18628806,
    0.09678418,
    0.37409196,
    1.00002368,
    -1.26551223,
)
"""Coefficients of erfcc, highest power first."""
_SWEEPS = 12  # enough for all cases seen: eight without sites of a similar case, two with
_DAMPED = 0.8  # a full step may oscillate
_CLOSE_NATS = 0.05  # far below what decides between hypotheses
_LEAST_PRECISION = 1e-10  # above zero, below that of any reading


def log_cdf_and_slope(u: npt.NDArray[Float]) -> tuple[npt.NDArray[Float], npt.NDArray[Float]]:
    """Log of the standard normal distribution function, and its slope phi(u) / Phi(u).

    Relative errors are below 2e-7, in single precision below 2e-6. From a rational approximation of
    erfc whose logarithm stays finite far in the tail (Press et al., Numerical Recipes, sec. 6.2,
    erfcc).
    """
    half = 0.5 * u
    t = 1.0 / (1.0 + np.abs(u) * _HALF_ROOT)
    power = np.full_like(t, _ERFC[0])
    for coefficient in _ERFC[1:]:
        power *= t
        power += coefficient
    tail = 0.5 * t * np.exp(power)  # of -|u|, times exp(u^2 / 2)
    bell = np.exp(-half * np.maximum(u, 0.0))  # 1 below zero
    share = np.where(u < 0.0, tail, 1.0 - bell * tail)
    log_cdf = np.log(share) - half * np.minimum(u, 0.0)
    return log_cdf, bell / (_SQRT_2PI * share)


class Moments(NamedTuple):
    """Log of an integral over values f, and the mean and variance of f under its integrand."""

    log_integral: FloatArray
    mean: FloatArray
    variance: FloatArray


class Sites(NamedTuple):
    """Gaussians exp(-precision f^2 / 2 + shift f) instead of one reading per point, (g,) each."""

    precision: FloatArray
    shift: FloatArray


def log_all_positive(
    mean: FloatArray,
    covariance: FloatArray,
    readings: FloatArray,
    own_variance: FloatArray,
    begun: Sites | None = None,
) -> tuple[float, Sites]:
    """Log probability that all readings are positive, and the sites found.

    Values f ~ N(`mean`, `covariance`) of shape (g,) and (g, g); at point i `readings[i]` times f_i
    and noise of `own_variance[i]` of its own. `begun` are the sites of a similar case.
    """
    precision, shift = begun or Sites(np.zeros(len(mean)), np.zeros(len(mean)))
    found = -np.inf
    for sweep in range(_SWEEPS):
        joint = _gaussian_integral(mean, covariance, readings * precision, readings * shift)
        of_cavity = np.maximum(1.0 / joint.variance - precision, _LEAST_PRECISION)
        without = (joint.mean / joint.variance - shift) / of_cavity
        log_phi, tilted, narrowed = tilted_moments(without, 1.0 / of_cavity, own_variance)
        log_site = 0.5 * (
            np.log1p(precision / of_cavity)
            + of_cavity * without**2
            - (of_cavity * without + shift) ** 2 / (of_cavity + precision)
        )
        last, found = found, float(readings @ (log_phi + log_site) + joint.log_integral)
        if abs(found - last) < _CLOSE_NATS:
            break
        share = _DAMPED if sweep else 1.0
        precision = (1.0 - share) * precision + share * np.maximum(
            1.0 / narrowed - of_cavity, _LEAST_PRECISION
        )
        shift = (1.0 - share) * shift + share * (tilted / narrowed - of_cavity * without)
    return found, Sites(precision, shift)


def _gaussian_integral(
    mean: FloatArray, covariance: FloatArray, precision: FloatArray, shift: FloatArray
) -> Moments:
    """Those of N(f; mean, covariance) exp(-precision f^2 / 2 + shift f)."""
    root = np.sqrt(precision)
    scaled = root[:, None] * covariance
    factor = np.asarray(np.linalg.cholesky(np.eye(len(mean)) + scaled * root), float)
    known = inverse_of_lower(factor) @ scaled
    pull = shift - precision * mean
    moved = covariance @ pull - known.T @ (known @ pull)
    log_integral = shift @ mean - 0.5 * mean @ (precision * mean) + 0.5 * pull @ moved
    log_integral -= np.sum(np.log(np.diagonal(factor)))
    variance = np.diagonal(covariance) - np.einsum("ij,ij->j", known, known)
    return Moments(np.asarray(log_integral, float), mean + moved, variance)


def tilted_moments(
    mean: FloatArray, variance: FloatArray, own_variance: FloatArray | float
) -> Moments:
    """Those of normals f that are positive with noise of `own_variance`, each on its own."""
    sd = np.sqrt(variance + own_variance)
    u = mean / sd
    log_phi, slope = log_cdf_and_slope(u)
    narrowed = variance - (variance / sd) ** 2 * slope * (u + slope)
    return Moments(log_phi, mean + variance * slope / sd, narrowed)
