"""Highest-density regions as few squares: their outlines are then found in a tenth of the time."""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.region import Squares, highest_density
from postproc.estimators.region_outline import outline

_ONE_NUMBER = np.array([1 << 32, 1])
"""Makes one number of column and row, which are counted in the finest cells."""


def rings(cells: Squares, share: float, origin_m: tuple[float, float]) -> list[FloatArray]:
    """Outline of the smallest region with this share of the probability: closed rings (k, 2) in
    metres from `origin_m`.

    Outer rings run counterclockwise, holes clockwise.
    """
    parts = outline(few_squares(cells, share), 1.0)
    found = [
        np.asarray(ring.coords, float)
        for part in parts
        for ring in (part.exterior, *part.interiors)
    ]
    return [ring - origin_m for ring in found]


def few_squares(cells: Squares, share: float) -> Squares:
    """The cells of a region, four of them that make up a square joined to one, again and again."""
    chosen = highest_density(cells, share)
    largest = int(np.argmax(cells.size_m))
    # a corner of the largest cell is one of every smaller square of the tree
    corner_x_m, corner_y_m = (
        v[largest] - 0.5 * cells.size_m[largest] for v in (cells.x_m, cells.y_m)
    )
    finest_m = float(np.min(cells.size_m))
    side = np.rint(cells.size_m[chosen] / finest_m).astype(np.int64)
    west = np.rint((cells.x_m[chosen] - corner_x_m) / finest_m - 0.5 * side).astype(np.int64)
    south = np.rint((cells.y_m[chosen] - corner_y_m) / finest_m - 0.5 * side).astype(np.int64)
    square = np.column_stack([side, west, south])
    whole = round(float(cells.size_m[largest]) / finest_m)
    joined = 1
    while joined < whole:
        square = _joined(square, joined)
        joined *= 2
    side_m = square[:, 0] * finest_m
    x_m, y_m = (
        corner + square[:, i] * finest_m + 0.5 * side_m
        for i, corner in ((1, corner_x_m), (2, corner_y_m))
    )
    return Squares(x_m, y_m, side_m, np.full(len(square), 1.0 / len(square)))


def _joined(square: IntArray, side: int) -> IntArray:
    """Squares (n, 3) of side, west and south, with those of one side joined where four fill the
    next larger one.
    """
    mine = square[:, 0] == side
    if np.count_nonzero(mine) < 4:
        return square
    small = square[mine]
    parent = small[:, 1:] // (2 * side)
    _, first, which, counts = np.unique(
        parent @ _ONE_NUMBER, return_index=True, return_inverse=True, return_counts=True
    )
    full = counts == 4
    corner = parent[first[full]] * (2 * side)
    larger = np.column_stack([np.full(len(corner), 2 * side), corner])
    return np.vstack([square[~mine], small[~full[which]], larger])
