"""Whether independent values are normal: Kolmogorov-Smirnov with mean and sigma of the sample.

The p-value comes from normal samples that are treated in the same way (Lilliefors, J. Am. Stat.
Assoc. 62(318), 1967).
"""

from math import erf, exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray

_SAMPLES = 200  # resolves p to 0.005
_FEWEST = 8  # with fewer values the test rejects next to nothing
_SIGMA_PER_MAD = 1.4826  # of a normal law


class Normality(NamedTuple):
    """Distance to the normal law with the sample's mean and sigma, and its p-value.

    `limit_sigmas` is where outliers were cut (None: nowhere), `n` how many values were left,
    `n_cut` how many were cut.
    """

    limit_sigmas: float | None
    n: int
    n_cut: int
    distance: float
    p: float


def normality(
    values: FloatArray, limit_sigmas: float | None, rng: np.random.Generator
) -> Normality | None:
    """Check of independent values (n,), None for fewer than 8 or for values that are all equal.

    Values beyond `limit_sigmas` robust sigmas (1.4826 times the median absolute deviation) are cut,
    and the rest is compared with a normal law cut at the same points.
    """
    inner, low, high = _trim(values, limit_sigmas)
    if len(inner) < _FEWEST or not np.ptp(inner) > 0.0:
        return None
    distance = _distance(inner, low, high)
    samples = (_trim(rng.normal(size=len(values)), limit_sigmas) for _ in range(_SAMPLES))
    as_far = sum(_distance(*sample) >= distance for sample in samples)
    p = (as_far + 1.0) / (_SAMPLES + 1.0)
    return Normality(limit_sigmas, len(inner), len(values) - len(inner), distance, p)


def _trim(values: FloatArray, limit_sigmas: float | None) -> tuple[FloatArray, float, float]:
    """Values within the limits, and the limits in the values' unit."""
    if limit_sigmas is None or not len(values):
        return values, -np.inf, np.inf
    middle = float(np.median(values))
    deviation = np.abs(values - middle)
    reach = limit_sigmas * _SIGMA_PER_MAD * float(np.median(deviation))
    return values[deviation <= reach], middle - reach, middle + reach


def _distance(values: FloatArray, low: float, high: float) -> float:
    """Largest difference between the distribution of the values and the truncated normal law."""
    mean, sigma = float(np.mean(values)), max(float(np.std(values, ddof=1)), 1e-300)
    if np.isfinite(low):
        sigma *= _untrimmed_sigma((high - low) / (2.0 * sigma))
    from scipy.special import ndtr  # noqa: PLC0415 (0.5 s, of all who import `postproc.api`)

    below, above = ndtr((low - mean) / sigma), ndtr((high - mean) / sigma)
    model = (ndtr((np.sort(values) - mean) / sigma) - below) / (above - below)
    step = np.arange(len(values)) / len(values)
    return float(max(np.max(model - step), np.max(step + 1.0 / len(values) - model)))


def _untrimmed_sigma(reach: float) -> float:
    """Sigma of a normal law by that of its part within +-`reach` of the part's sigmas.

    Fixed-point steps; 20 of them settle to 1e-6 for limits of 2 sigma and more.
    """
    factor = 1.0
    for _ in range(20):
        k = reach / factor
        density = exp(-0.5 * k * k) / (2.0 * pi) ** 0.5
        share = 1.0 - 2.0 * k * density / max(erf(k / sqrt(2.0)), 1e-12)
        factor = min(max(share, 0.2) ** -0.5, 2.0)
    return float(factor)
