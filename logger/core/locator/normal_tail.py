"""The lower tail of the normal distribution, finite and fast where it is far out."""

from typing import TypeVar

import numpy as np
import numpy.typing as npt

Float = TypeVar("Float", np.float32, np.float64)

_SQRT_2PI = float(np.sqrt(2.0 * np.pi))
_HALF_ROOT = float(np.sqrt(0.125))  # of u: half of u / sqrt(2), the argument of erfc


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
