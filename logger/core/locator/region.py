"""Where the probability of a posterior lies: highest-density regions and separate modes.

The highest-density region of level 0.95 is made of the densest squares that together have 95 % of
the probability: the smallest region with that probability (Hyndman, The American Statistician
50(2), 1996).
"""

from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.packing import around, compact_groups
from logger.core.places import Places

LEVEL = 0.95
HALF = 0.5
"""Level of the inner region."""
SADDLE = 0.5
"""Two peaks are one mode if the saddle is higher than this share of the lower peak."""

_TOUCH = 1.0 + 1e-6
"""Squares that share an edge touch in spite of rounding, and both have what lies on it."""


@dataclass(frozen=True, slots=True)
class Squares:
    """Squares that tile the searched area, (n,): centre and side in m, probability (sum 1)."""

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray
    probability: FloatArray

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def density(self) -> FloatArray:
        """Probability per square metre, shape (n,)."""
        return self.probability / self.size_m**2


def with_distant(squares: Squares, distant_share: FloatArray) -> Squares:
    """The squares where some transmitters are distant, by `Posterior.distant_share` (n,)."""
    p = squares.probability / (1.0 - distant_share)
    return replace(squares, probability=p / np.sum(p))


def highest_density(
    squares: Squares, level: float = LEVEL, among: IntArray | None = None
) -> IntArray:
    """Indices of the densest squares with `level` of the probability, densest first.

    With `among`, indices of some squares, only these count, and `level` is a share of theirs.
    """
    indices = np.arange(len(squares)) if among is None else among
    densest_first = indices[np.argsort(-squares.density[indices], kind="stable")]
    cumulative = np.cumsum(squares.probability[densest_first])
    count = int(np.searchsorted(cumulative, level * cumulative[-1])) + 1
    return densest_first[:count]


def coarse_cover(squares: Squares, most: int) -> FloatArray:
    """At most so many squares (3, n) that cover the 95 % region: centre and side in m."""
    square = np.stack([squares.x_m, squares.y_m, squares.size_m])
    largest = square[:, np.argmax(squares.size_m)]
    corner_m = largest[:2, None] - 0.5 * largest[2]  # is one of squares of every size
    square = square[:, highest_density(squares)]
    side_m = float(np.min(square[2]))
    # the smallest give way to those of the tree that have them inside
    while square.shape[1] > most:
        side_m *= 2.0
        is_small = square[2] < 0.75 * side_m
        at = np.unique(np.floor((square[:2, is_small] - corner_m) / side_m), axis=1)
        larger = np.vstack([corner_m + (at + 0.5) * side_m, np.full((1, at.shape[1]), side_m)])
        square = np.hstack([square[:, ~is_small], larger])
    return square


def contains(squares: Squares, indices: IntArray, place: Places) -> bool:
    """Whether a position is in one of the squares `indices`, or on its corner."""
    half_m = 0.5 * _TOUCH * squares.size_m[indices]
    is_in = np.abs(squares.x_m[indices] - place.x_m) <= half_m
    return bool(np.any(is_in & (np.abs(squares.y_m[indices] - place.y_m) <= half_m)))


def area_m2(squares: Squares, level: float = LEVEL) -> float:
    """Area of the highest-density region."""
    return float(np.sum(squares.size_m[highest_density(squares, level)] ** 2))


def mode_regions(squares: Squares, level: float) -> list[IntArray]:
    """The separate parts of a highest-density region, each as the indices of its squares.

    Squares are added from the densest on. One that touches none begins a part; others join the
    neighbouring part with the highest peak. Parts that meet above `SADDLE` times the lower peak are
    merged.
    """
    chosen = highest_density(squares, level)
    density = squares.density[chosen]
    peak = list(range(len(chosen)))  # of each square's part; points on where that part was merged
    for i, neighbours in enumerate(_denser_neighbours(squares, chosen)):
        peaks = sorted({_final_peak(peak, k) for k in neighbours.tolist()})
        for lower in peaks[1:]:
            if density[i] > SADDLE * density[lower]:
                peak[lower] = peaks[0]
        peak[i] = peaks[0] if peaks else i
    label = np.array([_final_peak(peak, i) for i in range(len(chosen))])
    return [chosen[label == k] for k in np.unique(label)]


def _final_peak(peak: list[int], k: int) -> int:
    while peak[k] != k:
        k = peak[k]
    return k


def _denser_neighbours(squares: Squares, chosen: IntArray) -> list[IntArray]:
    """For each chosen square those before it that share an edge or a corner with it."""
    square = np.stack([squares.x_m, squares.y_m, _TOUCH * squares.size_m])[:, chosen]
    pairs = [np.zeros((2, 0), np.int64)]
    for group in compact_groups(square[:2]):
        near = around(square, square[:, group])
        x_m, y_m, side_m = square[:, group, None]
        reach_m = 0.5 * (side_m + square[2, near])
        touches = np.abs(x_m - square[0, near]) <= reach_m
        touches &= np.abs(y_m - square[1, near]) <= reach_m
        touches &= near < group[:, None]
        row, column = np.nonzero(touches)
        pairs.append(np.stack([group[row], near[column]]))
    of_square, neighbour = np.concatenate(pairs, axis=1)
    order = np.argsort(of_square, kind="stable")
    ends = np.searchsorted(of_square[order], np.arange(1, len(chosen)))
    return np.split(neighbour[order], ends)
