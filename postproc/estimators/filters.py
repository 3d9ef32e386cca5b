"""Filters over all readings of a cell, and the path they took."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logger.core import ekf, shadow_ekf
from logger.core.arrays import FloatArray, IntArray
from logger.core.observations import CellObservations
from logger.core.shadow_ekf import ShadowNoise, ShadowState
from postproc.estimators import kernels
from postproc.estimators.metrics import Consistency, consistency

MOST_ROWS = 10_000
"""Of a longer walk the states after every so many readings are kept, up to the last."""

_ALL = slice(None)


@dataclass(frozen=True, slots=True)
class Filtered:
    """States after readings, in the order these were taken: `t_ns` (m,), `x` (m, k), `p` (m, k, k).

    k is 4, or 5 with the shadowing last. `innovation_db` and `innovation_var_db2` have shape (m,);
    they are NaN for a smoother and where no level was expected. `consistency` is that of all
    readings used, kept as rows or not.
    """

    t_ns: IntArray
    x: FloatArray
    p: FloatArray
    innovation_db: FloatArray
    innovation_var_db2: FloatArray
    consistency: Consistency | None = None

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def nis(self) -> FloatArray:
        """Normalised innovation squared, shape (m,): chi-square with one degree of freedom for an
        honest filter.
        """
        return self.innovation_db**2 / self.innovation_var_db2


class ShadowPass(NamedTuple):
    """The shadowing EKF's path, its last state, and the log-likelihood of the levels but for a
    constant.
    """

    filtered: Filtered
    end: ShadowState
    log_likelihood: float


def kept_rows(count: int) -> IntArray:
    """Numbers of the readings after which a state is kept."""
    every = max(-(-count // MOST_ROWS), 1)
    return np.arange((count - 1) % every, count, every)


def reference_ekf(obs: CellObservations) -> Filtered:
    """The specification's EKF over all readings of a cell, started at the walker's place at the
    first.
    """
    rows, innovation = kept_rows(len(obs)), np.empty((2, len(obs)))
    x, p = np.empty((len(rows), 4)), np.empty((len(rows), 4, 4))
    readings = tuple(np.array(values, float) for values in (obs.x_m, obs.y_m, obs.level_dbm))
    start = ekf.start(float(obs.x_m[0]), float(obs.y_m[0]))
    state = np.array(start[:4]), ekf.covariance_matrix(start.p)
    kernels.reference(*state, ekf.Q_PER_STEP, ekf.R_DB2, readings, rows, innovation, (x, p))
    return Filtered(
        obs.t_ns[rows], x, p, innovation[0, rows], innovation[1, rows], consistency(*innovation)
    )


def shadow_pass(
    obs: CellObservations,
    state: ShadowState,
    noise: ShadowNoise,
    *,
    readings: slice = _ALL,
    rows: IntArray | None = None,
    given: FloatArray | None = None,
) -> ShadowPass:
    """Run the shadowing EKF over readings of a cell from a state; fills `given` (n, 6) for
    `rts.smooth`.

    States are kept after the readings `rows`, ascending to the last; by default `kept_rows`.
    Readings with a level of NaN move the filter along and tell it nothing; `Filtered.consistency`
    does not count them.
    """
    columns = (obs.x_m, obs.y_m, obs.position_sigma_m, obs.level_dbm)
    x_m, y_m, sigma_m, level_dbm = (np.array(values[readings], float) for values in columns)
    count = len(level_dbm)
    rows = kept_rows(count) if rows is None else rows
    given = np.empty((count, 6)) if given is None else given
    innovation, x, factors = (
        np.empty((2, count)),
        np.empty((len(rows), 5)),
        np.empty((len(rows), 15)),
    )
    walk = (x_m, y_m, sigma_m, level_dbm, np.array(obs.limit[readings]))
    end = kernels.shadow(state, noise, walk, rows, innovation, (x, factors), given)
    p = shadow_ekf.covariance_matrix(factors)
    told = consistency(*innovation[:, np.isfinite(level_dbm)])
    found = Filtered(obs.t_ns[readings][rows], x, p, innovation[0, rows], innovation[1, rows], told)
    log_likelihood = -0.5 * float(
        np.nansum(np.log(innovation[1]) + innovation[0] ** 2 / innovation[1])
    )
    return ShadowPass(found, end, log_likelihood)
