"""Whether an estimator is as good as it claims: NEES, NIS, whiteness.

Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, sec. 5.4: for
a consistent estimator the normalised errors are chi-square distributed, and innovations are white.
"""

from math import nan, sqrt
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray

NIS_95, NIS_999 = 3.841, 10.828
"""Points of chi-square with one degree of freedom."""
_MANY_DOF = 200
"""From here on Wilson & Hilferty's points for 95 % are exact to 5e-5."""
_LAGS = 20
_WHITE_SIGMAS = 1.96  # 95 % of a normal law


SIGMA_PER_MAD = 1.4826
"""Standard deviation of a normal law by its median absolute deviation."""


class Consistency(NamedTuple):
    """A filter's innovations against the variances it claims for them.

    `n` readings were used, and `n_at_limit` of them were at the modem's limit. The mean NIS of the
    others lies in `nis_bounds` for 95 % of consistent filters. `autocorrelation` (lags 1 to 20 or
    fewer) of the normalised innovations lies within +-`white_bound` at 95 % of the lags if they are
    white.
    """

    n: int
    n_at_limit: int
    mean_nis: float
    nis_bounds: tuple[float, float]
    autocorrelation: tuple[float, ...]
    white_bound: float


def nees(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised estimation error squared e' P^-1 e, shape (...,).

    Errors have shape (..., k), covariances (..., k, k).
    """
    weighted = np.linalg.solve(covariance, error[..., None])[..., 0]
    return np.asarray(np.sum(error * weighted, axis=-1), float)


def mean_bounds(count: int, dof: int = 1, level: float = 0.95) -> tuple[float, float]:
    """Two-sided bounds of the mean of `count` chi-square values with `dof` degrees of freedom.

    `count` is the number of runs for NEES, of readings for NIS.
    """
    tail = 0.5 * (1.0 - level)
    low, high = (_chi_square_point(count * dof, p) / count for p in (tail, 1.0 - tail))
    return low, high


def _chi_square_point(dof: int, p: float) -> float:
    """Value that a chi-square of `dof` degrees of freedom stays below with probability p.

    For many degrees the cube root is normal (Wilson & Hilferty, Proc. Nat. Acad. Sci. 17, 1931).
    """
    if dof >= _MANY_DOF:
        variance = 2.0 / (9.0 * dof)
        return float(dof * (1.0 - variance + NormalDist().inv_cdf(p) * sqrt(variance)) ** 3)
    from scipy.special import gammaincinv  # noqa: PLC0415 (0.3 s)

    return float(2.0 * gammaincinv(0.5 * dof, p))


def autocorrelation(values: FloatArray, lags: int) -> FloatArray:
    """Autocorrelation of a series (n,) at lags 0 to `lags`, at most n - 1.

    The biased estimate, which is positive semidefinite; 0 beyond lag 0 of a series that is constant
    or shorter than 3.
    """
    lags = min(lags, max(len(values) - 1, 0))
    off = values - np.mean(values) if len(values) else values
    power = float(off @ off)
    if len(values) < 3 or power <= 0.0:
        return np.asarray(np.eye(lags + 1)[0])
    size = 1 << (len(values) + lags - 1).bit_length()  # the transform of a power of 2 is quick
    spectrum = np.fft.rfft(off, size)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size)[: lags + 1] / power, float)


def lag1(values: FloatArray) -> float:
    """Autocorrelation of neighbours in a series (n,); 0 if it is constant or shorter than 3."""
    at_lag = autocorrelation(values, 1)
    return float(at_lag[1]) if len(at_lag) > 1 else 0.0


def consistency(innovation_db: FloatArray, variance_db2: FloatArray) -> Consistency:
    """Consistency of a filter from its innovations (n,) and their variances (n,).

    They are NaN for readings at the modem's limit.
    """
    normalised = (innovation_db / np.sqrt(variance_db2))[np.isfinite(innovation_db)]
    count = len(normalised)
    return Consistency(
        n=len(innovation_db),
        n_at_limit=len(innovation_db) - count,
        mean_nis=float(np.mean(normalised**2)) if count else nan,
        nis_bounds=mean_bounds(count) if count else (nan, nan),
        autocorrelation=tuple(autocorrelation(normalised, _LAGS)[1:].tolist()),
        white_bound=_WHITE_SIGMAS / sqrt(count) if count else nan,
    )
