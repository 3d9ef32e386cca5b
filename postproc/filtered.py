"""A filter's path through the readings of one cell, whatever filter it was."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from logger.core import ekf
from logger.core.observations import CellObservations

FloatArray = npt.NDArray[np.float64]


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


def reference_ekf(obs: CellObservations) -> Filtered:
    """The specification's EKF over all readings of a cell, started at the walker's place at the first."""
    places = zip(obs.x_m.tolist(), obs.y_m.tolist(), obs.level_dbm.tolist(), strict=True)
    state = ekf.start(float(obs.x_m[0]), float(obs.y_m[0]))
    rows, innovations = [], []
    for x_m, y_m, level_dbm in places:
        state, innovation_db, variance_db2 = ekf.step(state, x_m, y_m, level_dbm)
        rows.append((*state[:4], *state.p))
        innovations.append((innovation_db, variance_db2))
    packed, found = np.array(rows), np.array(innovations)
    return Filtered(obs.t_ns, packed[:, :4], _matrices(packed[:, 4:]), found[:, 0], found[:, 1])


def _matrices(triangles: FloatArray) -> FloatArray:
    """Full covariances, shape (n, 4, 4), of upper triangles, shape (n, 10)."""
    matrices = np.zeros((len(triangles), 4, 4))
    rows, columns = np.triu_indices(4)
    matrices[:, rows, columns] = triangles
    matrices[:, columns, rows] = triangles
    return matrices
