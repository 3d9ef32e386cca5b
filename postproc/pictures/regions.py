"""Outlines of highest-density regions.

The squares of a region are merged before they are outlined, which takes a tenth of the time.
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import HALF, LEVEL, Squares, highest_density
from postproc.estimators.region_outline import outline

Rings = list[FloatArray]
"""Outline of a region: closed rings (k, 2), outer ones counterclockwise, holes clockwise."""

_KEY_FACTORS = np.array([1 << 32, 1])
"""Combine column and row, counted in the finest squares, into one integer."""


def regions_of(posterior: Posterior, origin_m: tuple[float, float]) -> dict[str, Rings]:
    """Outlines of the 95 % and the 50 % region; the latter is empty where it would not be true."""
    regions = {"95": region_rings(posterior.squares, LEVEL, origin_m), "50": list[FloatArray]()}
    if posterior.half_is_true:
        regions["50"] = region_rings(posterior.squares, HALF, origin_m)
    return regions


def region_rings(cells: Squares, share: float, origin_m: tuple[float, float]) -> Rings:
    """Outline of the smallest region with this share of the probability, from `origin_m` in m."""
    polygons = outline(merge_squares(cells, share), 1.0)
    return [
        np.asarray(ring.coords, float) - origin_m
        for polygon in polygons
        for ring in (polygon.exterior, *polygon.interiors)
    ]


def merge_squares(cells: Squares, share: float) -> Squares:
    """The squares of a region; four that make up a larger square are merged, again and again."""
    inside = highest_density(cells, share)
    centre_m = np.column_stack([cells.x_m, cells.y_m])
    largest = int(np.argmax(cells.size_m))
    # a corner of the largest square is a corner of a smaller square at every scale of the tree
    corner_m = centre_m[largest] - 0.5 * cells.size_m[largest]
    finest_m = float(np.min(cells.size_m))
    side = np.rint(cells.size_m[inside] / finest_m).astype(np.int64)
    south_west = (centre_m[inside] - corner_m) / finest_m - 0.5 * side[:, None]
    squares = np.column_stack([side, np.rint(south_west).astype(np.int64)])
    largest_side = round(float(cells.size_m[largest]) / finest_m)
    merged_side = 1
    while merged_side < largest_side:
        squares = _merge_four(squares, merged_side)
        merged_side *= 2
    side_m = squares[:, 0] * finest_m
    x_m, y_m = (corner_m + squares[:, 1:] * finest_m + 0.5 * side_m[:, None]).T
    return Squares(x_m, y_m, side_m, np.full(len(squares), 1.0 / len(squares)))


def _merge_four(squares: IntArray, side: int) -> IntArray:
    """Merge squares (n, 3) of one side where four fill the next larger square.

    Columns are side, west and south.
    """
    of_side = squares[:, 0] == side
    if np.count_nonzero(of_side) < 4:
        return squares
    small = squares[of_side]
    parent = small[:, 1:] // (2 * side)
    _, first, which, counts = np.unique(
        parent @ _KEY_FACTORS, return_index=True, return_inverse=True, return_counts=True
    )
    complete = counts == 4
    corner = parent[first[complete]] * (2 * side)
    larger = np.column_stack([np.full(len(corner), 2 * side), corner])
    return np.vstack([squares[~of_side], small[~complete[which]], larger])
