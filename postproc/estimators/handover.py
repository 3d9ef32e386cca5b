"""EKF that starts where the point-mass posterior has become one tight place, not at the receiver.

The linearised filter is honest only when it starts close and knows how close. So the readings are cut in two: the
shortest prefix that locates the transmitter gives mean and covariance, the EKF runs over the rest, and no reading is
used twice. Correlated readings carry less than their number: r is multiplied by (1 + rho) / (1 - rho), rho being the
correlation from one reading to the next.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from logger.core.ekf import EkfState, upper_triangle
from logger.core.observations import CellObservations
from postproc.estimators import metrics, rts
from postproc.estimators.filtered import Filtered, run_ekf
from postproc.estimators.posterior import Posterior, locate
from postproc.estimators.verdict import verdict

TIGHT_M = 20.0
_FEWEST = 8
_ONE_PLACE = 0.95
_RESOLUTION = 0.03
_MOST_CORRELATED = 0.95


@dataclass(frozen=True)
class EkfRun:
    """Filter and smoother over the readings from number `first` on.

    The filter started from the mode of `posterior`, with variance `r_db2` for one reading.
    """

    posterior: Posterior
    r_db2: float
    first: int
    filtered: Filtered
    smoothed: Filtered


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


def part(obs: CellObservations, readings: slice) -> CellObservations:
    """Some of the readings."""
    arrays = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
    return replace(obs, **{name: getattr(obs, name)[readings] for name in arrays})


def _handover(obs: CellObservations, whole: Posterior) -> tuple[int, Posterior]:
    """About the shortest prefix after which there is one tight place, by bisection."""
    low, high, posterior = min(_FEWEST, len(obs)), len(obs), whole
    while high - low > max(_RESOLUTION * len(obs), 1.0):
        count = (low + high) // 2
        begun = part(obs, slice(count))
        found = locate(begun, whole.prior)
        if is_tight(found) and verdict(found, begun)[0] == "located":
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
    x_m, y_m, p0_dbm, eta = mode.state.tolist()
    state = EkfState(x_m, y_m, p0_dbm, eta, upper_triangle(mode.covariance))
    r_db2 = effective_variance_db2(part(obs, slice(count)), posterior)
    filtered = run_ekf(part(obs, slice(count, None)), state, q=q, r_db2=r_db2)
    x, p = rts.smooth(filtered.x, filtered.p, np.eye(4), q * np.eye(4))
    none = np.full(len(filtered), np.nan)
    return EkfRun(posterior, r_db2, count, filtered, Filtered(filtered.t_ns, x, p, none, none))
