"""Squares in compact groups, each compared with its surroundings only."""

import numpy as np

from logger.core.arrays import FloatArray, IntArray

_EACH = 64
"""Squares of a group: its matrices stay in the processor's cache."""


def compact_groups(point_m: FloatArray) -> list[IntArray]:
    """Indices of points (2, n) in groups of at most 64 that are close together.

    Columns of equal numbers, each cut into groups along y (sort-tile-recursive packing:
    Leutenegger, Lopez & Edgington, ICDE 1997).
    """
    x_m, y_m = point_m
    count = len(x_m)
    groups = -(-count // _EACH)
    columns = max(round(groups**0.5), 1)
    column_of_rank = np.arange(count) * columns // max(count, 1)
    by_x = np.argsort(x_m, kind="stable")
    order = by_x[np.lexsort((y_m[by_x], column_of_rank))]
    ends = np.searchsorted(column_of_rank, np.arange(1, columns + 1))
    starts = np.append(0, ends[:-1])
    return [
        order[first : min(first + _EACH, end)]
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
        for first in range(start, end, _EACH)
    ]


def around(squares: FloatArray, group: FloatArray, apart_m: float = 0.0) -> IntArray:
    """Indices of the squares (3, n) that may be within `apart_m` of those of a group (3, g).

    Rows are x, y and side. Distances count along each axis.
    """
    half_m, of_group_m = 0.5 * squares[2], 0.5 * group[2]
    is_near = np.ones(squares.shape[1], np.bool_)
    for at_m, of_group in zip(squares[:2], group[:2], strict=True):
        reach_m = half_m + apart_m
        is_near &= at_m + reach_m >= np.min(of_group - of_group_m)
        is_near &= at_m - reach_m <= np.max(of_group + of_group_m)
    return np.flatnonzero(is_near)
