"""Is an estimator as good as it says: NEES, NIS, whiteness.

Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, sec. 5.4: for a consistent
estimator the normalised errors are chi-square distributed, and innovations are white.
"""

import numpy as np
from scipy.stats import chi2

from logger.core.arrays import FloatArray


def nees(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised estimation error squared e' P^-1 e, shape (n,), of errors (n, k) and covariances (n, k, k)."""
    weighted = np.linalg.solve(covariance, error[..., None])[..., 0]
    return np.asarray(np.sum(error * weighted, axis=-1), float)


def mean_bounds(count: int, dof: int = 1, level: float = 0.95) -> tuple[float, float]:
    """Two-sided bounds of the mean of `count` chi-square values with `dof` degrees of freedom.

    `count` is the number of independent values: of runs for NEES, of readings for NIS.
    """
    tail = 0.5 * (1.0 - level)
    return float(chi2.ppf(tail, count * dof) / count), float(chi2.ppf(1.0 - tail, count * dof) / count)


def lag1(values: FloatArray) -> float:
    """Autocorrelation of neighbours in a series (n,); 0 where it says nothing (constant or fewer than 3)."""
    off = values - np.mean(values) if len(values) else values
    power = float(off @ off)
    if len(values) < 3 or power <= 0.0:
        return 0.0
    return float(off[1:] @ off[:-1]) / power
