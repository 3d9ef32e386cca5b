"""A filter's path through the readings of one cell, whatever filter it was."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from logger.core.arrays import FloatArray
from logger.core.ekf import Q_PER_STEP, R_DB2, EkfState, start, step
from logger.core.observations import CellObservations


@dataclass(frozen=True, slots=True)
class Filtered:
    """States after each reading used: `t_ns` (n,), `x` (n, 4) in state order, `p` (n, 4, 4).

    `innovation_db` and `innovation_var_db2` have shape (n,); they are NaN for a smoother.
    """

    t_ns: npt.NDArray[np.int64]
    x: FloatArray
    p: FloatArray
    innovation_db: FloatArray
    innovation_var_db2: FloatArray

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def nis(self) -> FloatArray:
        """Normalised innovation squared, shape (n,): chi-square with one degree of freedom for an honest filter."""
        return self.innovation_db**2 / self.innovation_var_db2


def run_ekf(obs: CellObservations, state: EkfState, *, q: float = Q_PER_STEP, r_db2: float = R_DB2) -> Filtered:
    """Run the EKF over all readings of a cell from a state; `q` and `r_db2` as in `ekf.step`."""
    rows = []
    for x_m, y_m, level_dbm in zip(obs.x_m.tolist(), obs.y_m.tolist(), obs.level_dbm.tolist(), strict=True):
        state, innovation_db, variance_db2 = step(state, x_m, y_m, level_dbm, q=q, r_db2=r_db2)
        rows.append((*state[:4], *state.p, innovation_db, variance_db2))
    packed = np.array(rows)
    return Filtered(obs.t_ns, packed[:, :4], _matrices(packed[:, 4:14]), packed[:, 14], packed[:, 15])


def reference_ekf(obs: CellObservations) -> Filtered:
    """The specification's EKF over all readings of a cell, started at the walker's place at the first."""
    return run_ekf(obs, start(float(obs.x_m[0]), float(obs.y_m[0])))


def _matrices(triangles: FloatArray) -> FloatArray:
    """Full covariances, shape (n, 4, 4), of upper triangles, shape (n, 10)."""
    matrices = np.zeros((len(triangles), 4, 4))
    rows, columns = np.triu_indices(4)
    matrices[:, rows, columns] = triangles
    matrices[:, columns, rows] = triangles
    return matrices
