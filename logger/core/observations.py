"""Readings joined to the walker's track: what every estimator is given."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from logger.core.geo import Utm

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class CellObservations:
    """Levels of one cell along the walk, in time order; all arrays have shape (n,).

    `x_m, y_m` is the receiver in the run's UTM zone, `position_sigma_m` its standard deviation per axis,
    `scan_seq` the record number of the scan a level came from.
    """

    cell: str
    rat: str | None
    utm: Utm
    t_ns: IntArray
    x_m: FloatArray
    y_m: FloatArray
    position_sigma_m: FloatArray
    level_dbm: FloatArray
    scan_seq: IntArray

    def __len__(self) -> int:
        return len(self.t_ns)
