"""The distance that a level gives, and its error.

True levels z = B - 10 eta log10 d + n, n ~ N(0, Gamma^2). The distance is computed with B~ instead
of B: d~ = 10^((B~ - z) / (10 eta)) = d 10^((B~ - B - n) / (10 eta)). With the slope of the level by
the distance,

    C = -10 eta / (d ln 10)    dB per metre,

the first term of the Taylor series is eps = d~ - d = (B - B~ + n) / C, so eps ~ N((B - B~) / C,
Gamma^2 / C^2). The series is that of an exponential: d~ / d is log-normal, and the normal law holds
while Gamma is small against 10 eta / ln 10, which is 11 to 17 dB.
"""

from math import exp
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import DB_PER_E_FOLD


class RangeError(NamedTuple):
    """Mean and sigma of d~ - d in metres: by the first Taylor term, exact, and simulated."""

    slope_db_per_m: float
    mean_m: float
    sigma_m: float
    exact_mean_m: float
    exact_sigma_m: float
    simulated_mean_m: float
    simulated_sigma_m: float


def slope_db_per_m(distance_m: float, eta: float) -> float:
    """C: how fast the level changes with the distance."""
    return -DB_PER_E_FOLD * eta / distance_m


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
    log_scale = 1.0 / (DB_PER_E_FOLD * eta)
    noise_db = offset_db + sigma_db * rng.normal(size=trials)
    errors_m = distance_m * (np.exp(-log_scale * noise_db) - 1.0)
    variance = (log_scale * sigma_db) ** 2
    mean_m = distance_m * exp(-log_scale * offset_db + 0.5 * variance)
    error = RangeError(
        slope_db_per_m=c,
        mean_m=offset_db / c,
        sigma_m=sigma_db / abs(c),
        exact_mean_m=mean_m - distance_m,
        exact_sigma_m=mean_m * (exp(variance) - 1.0) ** 0.5,
        simulated_mean_m=float(np.mean(errors_m)),
        simulated_sigma_m=float(np.std(errors_m)),
    )
    return error, np.asarray(errors_m, float)
