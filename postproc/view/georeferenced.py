"""Pixels with a place on the Earth."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pyproj import CRS, Transformer

from logger.core.arrays import FloatArray


class Area(NamedTuple):
    """The plan's area: a mesh (2, k, k) of places in `crs`, and the finest pixel in metres that is
    worth having.
    """

    crs: CRS
    mesh: FloatArray
    finest_m: float

    def within(self, crs: CRS) -> FloatArray:
        """The mesh in another reference system, shape (2, k, k); x is east."""
        return np.stack(Transformer.from_crs(self.crs, crs, always_xy=True).transform(*self.mesh))


@dataclass(frozen=True, slots=True)
class Ground:
    """Pixels (rows, columns, 4); the middle of pixel (column, row) lies at `affine` (2, 3) @
    [column, row, 1].
    """

    pixels: npt.NDArray[np.uint8]
    crs: CRS
    affine: FloatArray

    def pixel_at(self, area: Area) -> tuple[FloatArray, FloatArray]:
        """Column and row, with fractions, of each place of the area's mesh."""
        return pixel_of(self.affine, area.within(self.crs))


def pixel_of(affine: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Column and row of places (2, ...)."""
    inverse = np.linalg.inv(affine[:, :2])
    x, y = places[0] - affine[0, 2], places[1] - affine[1, 2]
    return inverse[0, 0] * x + inverse[0, 1] * y, inverse[1, 0] * x + inverse[1, 1] * y
