"""The lower tail of the normal distribution, finite and fast where it is far out."""

import numpy as np

from logger.core.arrays import FloatArray

_SQRT_2PI = float(np.sqrt(2.0 * np.pi))
_HALF_ROOT = float(np.sqrt(0.125))  # of u: half of u / sqrt(2), the argument of erfc


def log_cdf_and_slope(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log of the standard normal distribution function, and its slope phi(u) / Phi(u).

    Relative errors are below 2e-7. From a rational approximation of erfc whose logarithm stays
    finite far in the tail (Press et al., Numerical Recipes, sec. 6.2, erfcc).
    """
    squared = 0.5 * u * u
    t = 1.0 / (1.0 + np.abs(u) * _HALF_ROOT)
    power = np.full_like(t, _ERFC[0])
    for coefficient in _ERFC[1:]:
        power *= t
        power += coefficient
    tail = 0.5 * t * np.exp(power)  # of -|u|, times exp(u^2 / 2)
    bell, below = np.exp(-squared), u < 0.0
    share = np.where(below, tail, 1.0 - bell * tail)
    slope = np.where(below, 1.0, bell) / (_SQRT_2PI * share)
    return np.log(share) - np.where(below, squared, 0.0), slope


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
