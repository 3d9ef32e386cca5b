"""What a level says of a distance, and whether its errors are normal.

True levels z = B - 10 eta log10 d + n, n ~ N(0, Gamma^2); the distance is read off with B~ instead
of B: d~ = 10^((B~ - z) / (10 eta)) = d 10^((B~ - B - n) / (10 eta)). With the slope of the level by
the distance,

    C = -10 eta / (d ln 10)    dB per metre,

the first term of the Taylor series is eps = d~ - d = (B - B~ + n) / C, so eps ~ N((B - B~) / C,
Gamma^2 / C^2). The series is that of an exponential: d~ / d is log-normal, and the normal law holds
while Gamma is small against 10 eta / ln 10, which is 11 to 17 dB.
"""

from math import exp, log, pi
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from logger.core.arrays import FloatArray

_DECADE = log(10.0)
_DRAWS = 200
_FEWEST = 8


class RangeError(NamedTuple):
    """Mean and standard deviation of d~ - d in metres: by the first Taylor term, exact, and
    simulated.
    """

    slope_db_per_m: float
    mean_m: float
    sigma_m: float
    exact_mean_m: float
    exact_sigma_m: float
    simulated_mean_m: float
    simulated_sigma_m: float


class Normality(NamedTuple):
    """Kolmogorov-Smirnov distance to the normal law with the sample's own mean and sigma, and its
    p-value.

    `limit_sigmas` is where outliers were cut (None: nowhere), `n` how many values were left,
    `n_cut` how many were not.
    """

    limit_sigmas: float | None
    n: int
    n_cut: int
    distance: float
    p: float


def slope_db_per_m(distance_m: float, eta: float) -> float:
    """C: how fast the level changes with the distance."""
    return -10.0 * eta / (distance_m * _DECADE)


def range_errors(
    distance_m: float,
    eta: float,
    sigma_db: float,
    offset_db: float,
    trials: int,
    rng: np.random.Generator,
) -> tuple[RangeError, FloatArray]:
    """The error of ranging by level, `offset_db` = B - B~, and simulated errors (trials,)."""
    c = slope_db_per_m(distance_m, eta)
    log_scale = _DECADE / (10.0 * eta)
    drawn = distance_m * (
        np.exp(-log_scale * (offset_db + sigma_db * rng.normal(size=trials))) - 1.0
    )
    variance = (log_scale * sigma_db) ** 2
    mean = distance_m * exp(-log_scale * offset_db + 0.5 * variance)
    exact = mean - distance_m, mean * (exp(variance) - 1.0) ** 0.5
    error = RangeError(
        c, offset_db / c, sigma_db / abs(c), *exact, float(np.mean(drawn)), float(np.std(drawn))
    )
    return error, np.asarray(drawn, float)


def normality(
    values: FloatArray, limit_sigmas: float | None, rng: np.random.Generator
) -> Normality | None:
    """Kolmogorov-Smirnov check of independent values, None for fewer than 8.

    Values beyond `limit_sigmas` robust sigmas (1.4826 times the median absolute deviation) are cut,
    and the rest is held against a normal law cut at the same places. Mean and sigma are the
    sample's own, so the p-value comes from samples that are treated likewise (Lilliefors, J. Am.
    Stat. Assoc. 62(318), 1967).
    """
    kept, low, high = _cut(values, limit_sigmas)
    if len(kept) < _FEWEST:
        return None
    distance = _distance(kept, low, high)
    as_far = 0
    for _ in range(_DRAWS):
        as_far += _distance(*_cut(rng.normal(size=len(values)), limit_sigmas)) >= distance
    p = (as_far + 1.0) / (_DRAWS + 1.0)
    return Normality(limit_sigmas, len(kept), len(values) - len(kept), distance, p)


def _cut(values: FloatArray, limit_sigmas: float | None) -> tuple[FloatArray, float, float]:
    """Values that stay, and the limits in metres or whatever they are in."""
    if limit_sigmas is None or not len(values):
        return values, -np.inf, np.inf
    middle = float(np.median(values))
    reach = limit_sigmas * 1.4826 * float(np.median(np.abs(values - middle)))
    return values[np.abs(values - middle) <= reach], middle - reach, middle + reach


def _distance(values: FloatArray, low: float, high: float) -> float:
    mean, sigma = float(np.mean(values)), max(float(np.std(values, ddof=1)), 1e-300)
    ordered, n = np.sort(values), len(values)
    wide = sigma * _widening((high - low) / (2.0 * sigma)) if np.isfinite(low) else sigma
    below, above = ndtr((low - mean) / wide), ndtr((high - mean) / wide)
    of_model = (ndtr((ordered - mean) / wide) - below) / (above - below)
    step = np.arange(n) / n
    return float(max(np.max(of_model - step), np.max(step + 1.0 / n - of_model)))


def _widening(reach: float) -> float:
    """Sigma of a normal law by that of its part within `reach` of the latter's sigmas, a few
    fixed-point steps.
    """
    factor = 1.0
    for _ in range(20):
        k = reach / factor
        density = exp(-0.5 * k * k) / (2.0 * pi) ** 0.5
        inside = 1.0 - 2.0 * k * density / max(2.0 * float(ndtr(k)) - 1.0, 1e-12)
        factor = min(max(inside, 0.2) ** -0.5, 2.0)
    return float(factor)
