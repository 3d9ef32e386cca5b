"""Gaussian elimination in many small symmetric matrices at once: each entry is an array.

The lower triangle of a matrix is packed by rows, so that entry (i, j), j <= i, is number
i (i + 1) / 2 + j, whatever the size of the matrix. Row 0 holds no unknown: entries (k, 0) are the
right-hand side b of A x = b, and entry (0, 0) is a constant c. With A = U D U' and U unit upper
triangular, elimination from the last unknown to the first leaves

    (k, 0)  U^-1 b / D        (k, j)  U_jk        (k, k)  D_k        (0, 0)  c - b' A^-1 b

(Golub & Van Loan, Matrix Computations, 4th ed., sec. 4.1). The first unknowns, and their block of
A^-1, follow without the others.
"""

from functools import reduce
from math import isqrt

import numpy as np

from logger.core.arrays import FloatArray


def packed_index(i: int, j: int) -> int:
    """Number of entry (i, j), j <= i, of a packed lower triangle."""
    return i * (i + 1) // 2 + j


def side(packed: FloatArray) -> int:
    """Number of rows of packed matrices of shape (m, ...)."""
    return (isqrt(8 * len(packed) + 1) - 1) // 2


def eliminate(packed: FloatArray, first: int = 1) -> None:
    """Eliminate the unknowns from the last one down to number `first`, in place."""
    for k in range(side(packed) - 1, first - 1, -1):
        start = packed_index(k, 0)
        row, pivot = packed[start : start + k], packed[start + k]
        ratio = row / pivot
        for i in range(k):
            above = packed_index(i, 0)
            packed[above : above + i + 1] -= ratio[i] * row[: i + 1]
        row[:] = ratio


def log_determinant(eliminated: FloatArray) -> FloatArray:
    """Log |A|, the sum of log D."""
    return np.asarray(np.log(reduce(np.multiply, pivots(eliminated))), float)


def pivots(eliminated: FloatArray) -> list[FloatArray]:
    """D of all unknowns."""
    return [eliminated[packed_index(k, k)] for k in range(1, side(eliminated))]


def solution(eliminated: FloatArray, count: int) -> FloatArray:
    """The first `count` unknowns, shape (count, ...)."""
    found = eliminated[[packed_index(k, 0) for k in range(1, count + 1)]]
    for k in range(1, count):
        for j in range(k):
            found[k] -= eliminated[packed_index(k + 1, j + 1)] * found[j]
    return found


def inverse(eliminated: FloatArray, count: int) -> FloatArray:
    """Block of A^-1 that belongs to the first `count` unknowns, shape (count, count, ...)."""
    found = np.empty((count, count, *eliminated.shape[1:]))
    np.divide(1.0, eliminated[packed_index(1, 1)], out=found[0, 0])
    for k in range(1, count):
        start = packed_index(k + 1, 1)
        unit = eliminated[start : start + k]
        between = -(unit[:, None] * found[:k, :k]).sum(axis=0)
        found[k, :k] = found[:k, k] = between
        np.divide(1.0, eliminated[start + k], out=found[k, k])
        found[k, k] -= (unit * between).sum(axis=0)
    return found
