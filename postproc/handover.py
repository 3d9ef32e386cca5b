"""EKF that starts where the point-mass posterior has become one tight place, not at the receiver.

The linearised filter is honest only when it starts close and knows how close. So the readings are cut in two: the
shortest prefix that locates the transmitter gives mean and covariance, the EKF runs over the rest, and no reading is
used twice. Correlated readings carry less than their number: r is multiplied by (1 + rho) / (1 - rho), rho being the
correlation from one reading to the next.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import numpy.typing as npt

from logger.core import ekf
from logger.core.observations import CellObservations
from postproc import metrics, rts
from postproc.posterior import Posterior, locate
from postproc.verdict import verdict

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

TIGHT_M = 20.0
_FEWEST = 8
_ONE_PLACE = 0.95
_RESOLUTION = 0.03
_MOST_CORRELATED = 0.95


@dataclass(frozen=True)
class EkfRun:
    """Filter states after each reading from the hand-over on; `index` (n,) are the numbers of the readings.

    `x` (n, 4) and `p` (n, 4, 4) are filtered, `x_smooth` and `p_smooth` smoothed; `innovation_db`,
    `innovation_var_db2` and `nis` have shape (n,). The filter started from `posterior` with variance `r_db2`.
    """

    posterior: Posterior
    r_db2: float
    index: IntArray
    x: FloatArray
    p: FloatArray
    innovation_db: FloatArray
    innovation_var_db2: FloatArray
    nis: FloatArray
    x_smooth: FloatArray
    p_smooth: FloatArray


@dataclass(frozen=True)
class NoRun:
    """Why the EKF was not started."""

    reason: str


def run(obs: CellObservations, whole: Posterior, *, q: float = 0.0) -> EkfRun | NoRun:
    """Hand over, filter the remaining readings, smooth; `q` is added to the diagonal of P per reading.

    `whole` is the posterior of all readings: where even that is no tight place, no part of them is asked.
    """
    if not is_tight(whole):
        return NoRun(f"the whole walk does not leave one place with a standard deviation below {TIGHT_M:.0f} m")
    count, posterior = _handover(obs, whole)
    if count == len(obs):
        return NoRun("only the whole walk locates the transmitter: no reading is left to filter")
    return _filter(obs, count, posterior, q)


def prefix(obs: CellObservations, count: int) -> CellObservations:
    """The first `count` readings."""
    arrays = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
    return replace(obs, **{name: getattr(obs, name)[:count] for name in arrays})


def _handover(obs: CellObservations, whole: Posterior) -> tuple[int, Posterior]:
    """About the shortest prefix after which there is one tight place, by bisection."""
    low, high, posterior = min(_FEWEST, len(obs)), len(obs), whole
    while high - low > max(_RESOLUTION * len(obs), 1.0):
        count = (low + high) // 2
        part = prefix(obs, count)
        found = locate(part, whole.prior)
        if is_tight(found) and verdict(found, part)[0] == "located":
            high, posterior = count, found
        else:
            low = count
    return high, posterior


def is_tight(posterior: Posterior) -> bool:
    """Whether a Gaussian may stand for the posterior: one place, standard deviation per axis at most 20 m."""
    p = posterior.modes[0].covariance
    return posterior.modes[0].probability >= _ONE_PLACE and sqrt(max(p[0, 0], p[1, 1])) <= TIGHT_M


def effective_variance_db2(obs: CellObservations, posterior: Posterior) -> float:
    """Variance r of one reading for a filter that takes readings as independent.

    rho is the lag-1 correlation of the residuals at the posterior's best place.
    """
    mode = posterior.modes[0]
    d2 = np.maximum((obs.x_m - mode.x_m) ** 2 + (obs.y_m - mode.y_m) ** 2, 1.0)
    residual = obs.level_dbm - mode.state[2] + mode.state[3] * 5.0 * np.log10(d2)
    rho = min(max(metrics.lag1(residual), 0.0), _MOST_CORRELATED)
    return posterior.sigma_db**2 * (1.0 + rho) / (1.0 - rho)


def _filter(obs: CellObservations, count: int, posterior: Posterior, q: float) -> EkfRun:
    mode = posterior.modes[0]
    x, y, p0, eta = mode.state.tolist()
    state = ekf.EkfState(x, y, p0, eta, ekf.upper_triangle(mode.covariance))
    r_db2 = effective_variance_db2(prefix(obs, count), posterior)
    steps = []
    for px, py, level in zip(obs.x_m[count:], obs.y_m[count:], obs.level_dbm[count:], strict=True):
        step = ekf.step(state, float(px), float(py), float(level), q=q, r_db2=r_db2, joseph=True)
        state = step.state
        steps.append(step)
    means = np.array([s.state[:4] for s in steps])
    covariances = np.array([ekf.covariance_matrix(s.state.p) for s in steps])
    innovation = np.array([s.innovation_db for s in steps])
    variance = np.array([s.innovation_var_db2 for s in steps])
    x_smooth, p_smooth = rts.smooth(means, covariances, np.eye(4), q * np.eye(4))
    return EkfRun(
        posterior=posterior,
        r_db2=r_db2,
        index=np.arange(count, len(obs)),
        x=means,
        p=covariances,
        innovation_db=innovation,
        innovation_var_db2=variance,
        nis=innovation**2 / variance,
        x_smooth=x_smooth,
        p_smooth=p_smooth,
    )
