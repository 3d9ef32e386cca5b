"""Images with a position on the Earth."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pyproj import CRS, Transformer

from logger.core.arrays import FloatArray


class Area(NamedTuple):
    """The plan's area: a mesh (2, k, k) of points in `crs`, and the finest useful pixel."""

    crs: CRS
    mesh: FloatArray
    finest_m: float

    def within(self, crs: CRS) -> FloatArray:
        """The mesh in another reference system, shape (2, k, k); x is east."""
        return np.stack(Transformer.from_crs(self.crs, crs, always_xy=True).transform(*self.mesh))


@dataclass(frozen=True, slots=True)
class Ground:
    """Pixels (rows, columns, 4) of a part of the Earth.

    The centre of pixel (column, row) lies at `affine` (2, 3) @ [column, row, 1] in `crs`.
    """

    pixels: npt.NDArray[np.uint8]
    crs: CRS
    affine: FloatArray

    def pixel_at(self, area: Area) -> tuple[FloatArray, FloatArray]:
        """Column and row, with fractions, of each point of the area's mesh."""
        return pixel_of(self.affine, area.within(self.crs))


def pixel_of(affine: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Column and row of points (2, ...)."""
    offset = points - affine[:, 2].reshape(2, *[1] * (points.ndim - 1))
    column, row = np.tensordot(np.linalg.inv(affine[:, :2]), offset, axes=1)
    return column, row
