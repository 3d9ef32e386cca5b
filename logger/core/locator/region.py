"""Where the mass of a posterior lies: highest-density set and separate places.

A posterior is a set of square cells that tile the searched area, each with a probability. Density
is probability by area. The highest-density set of level 0.95 holds the densest cells that together
have 95 % of the mass: the smallest region of that probability, whatever its shape (Hyndman, The
American Statistician 50(2), 1996).
"""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray, IntArray

LEVEL = 0.95
SADDLE = 0.5
"""Two peaks are one place when the pass between them is higher than this share of the lower
peak.
"""

_ROWS = 256


@dataclass(frozen=True, slots=True)
class Squares:
    """Square cells, shape (n,): centre and side in metres, probability (sum 1)."""

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


def highest_density(cells: Squares, level: float = LEVEL) -> IntArray:
    """Indices of the densest cells that hold `level` of the mass, densest first."""
    order = np.argsort(-cells.density, kind="stable")
    held = np.cumsum(cells.probability[order])
    count = int(np.searchsorted(held, level * held[-1])) + 1
    return order[:count]


def area_m2(cells: Squares, level: float = LEVEL) -> float:
    """Area of the highest-density set."""
    return float(np.sum(cells.size_m[highest_density(cells, level)] ** 2))


def mode_regions(cells: Squares, level: float) -> list[IntArray]:
    """Split a highest-density set into places, each the indices of its cells.

    Cells are added from the densest on; one that touches nothing opens a place, others join the
    neighbouring place with the highest peak. Places that meet at more than `SADDLE` times the lower
    peak are merged.
    """
    chosen = highest_density(cells, level)
    density = cells.density[chosen]
    peak = list(
        range(len(chosen))
    )  # of the place a cell belongs to; refers onward once that place is merged
    for i, met in enumerate(_denser_neighbours(cells, chosen)):
        roots = sorted({_root(peak, k) for k in met.tolist()})
        for root in roots[1:]:
            if density[i] > SADDLE * density[root]:
                peak[root] = roots[0]
        peak[i] = roots[0] if roots else i
    label = np.array([_root(peak, i) for i in range(len(chosen))])
    return [chosen[label == k] for k in np.unique(label)]


def _root(peak: list[int], k: int) -> int:
    while peak[k] != k:
        k = peak[k]
    return k


def _denser_neighbours(cells: Squares, chosen: IntArray) -> list[IntArray]:
    """For each chosen cell those before it that share an edge or a corner with it."""
    x, y, half = cells.x_m[chosen], cells.y_m[chosen], 0.5 * cells.size_m[chosen] * (1.0 + 1e-6)
    found = []
    for i in range(0, len(chosen), _ROWS):
        end = min(i + _ROWS, len(chosen))
        reach = half[i:end, None] + half[:end]
        touch = (np.abs(x[i:end, None] - x[:end]) <= reach) & (
            np.abs(y[i:end, None] - y[:end]) <= reach
        )
        found += [np.flatnonzero(row[: i + k]) for k, row in enumerate(touch)]
    return found
