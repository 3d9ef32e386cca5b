"""Rectangles, gaps and selections of what is drawn, in metres east and north of the first fix."""

from collections.abc import Iterable
from math import floor, log10
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.places import MAX_GAP_S

_LEAST_WALK_M = 100.0
"""A walk on the spot is drawn as if it were this long, or the plan would show GPS noise alone."""
_MOST_WALKS = 4.0
"""A region wider than this many walks extends outside: the walk would shrink to a dot."""
_MARGIN = 0.08
"""Free space around what is drawn, as a share of the longer side."""


class Box(NamedTuple):
    """Rectangle in local metres."""

    west: float
    south: float
    east: float
    north: float

    @classmethod
    def around(cls, points_m: FloatArray) -> "Box":
        """The smallest rectangle that contains points (n, 2)."""
        (west, south), (east, north) = points_m.min(axis=0), points_m.max(axis=0)
        return cls(float(west), float(south), float(east), float(north))

    @property
    def width(self) -> float:
        """East to west."""
        return self.east - self.west

    @property
    def height(self) -> float:
        """North to south."""
        return self.north - self.south

    @property
    def size(self) -> float:
        """The longer side."""
        return max(self.width, self.height)

    @property
    def corners_m(self) -> FloatArray:
        """South-west and north-east corner, shape (2, 2)."""
        return np.array([(self.west, self.south), (self.east, self.north)])

    def enlarge(self, margin_x_m: float, margin_y_m: float | None = None) -> "Box":
        """With a margin on every side; `margin_y_m` only where it differs."""
        margin_y_m = margin_x_m if margin_y_m is None else margin_y_m
        return Box(
            self.west - margin_x_m,
            self.south - margin_y_m,
            self.east + margin_x_m,
            self.north + margin_y_m,
        )

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether a point lies inside."""
        return self.west <= x_m <= self.east and self.south <= y_m <= self.north


def plan_box(walked_m: FloatArray, extras_m: Iterable[FloatArray]) -> Box:
    """The plan's rectangle: the walk (n, 2), and each extra (k, 2) that keeps the walk visible."""
    box = Box.around(walked_m)
    walk_m = max(box.size, _LEAST_WALK_M)
    box = _at_least_half_as_wide(box.enlarge(0.5 * (walk_m - box.size)))
    for points_m in extras_m:
        larger = Box.around(np.vstack([points_m, box.corners_m]))
        if larger.size <= _MOST_WALKS * walk_m:
            box = larger
    return _at_least_half_as_wide(box.enlarge(_MARGIN * box.size))


def _at_least_half_as_wide(box: Box) -> Box:
    """With the shorter side at least half the longer one: a straight walk needs room as well."""
    margins = (0.5 * max(0.5 * box.size - side, 0.0) for side in (box.width, box.height))
    return box.enlarge(*margins)


def split_at_gaps(t_ns: IntArray, points_m: FloatArray) -> list[FloatArray]:
    """Points (n, 2) cut into strips (k, 2) where nothing came for more than `MAX_GAP_S`."""
    starts = np.flatnonzero(np.diff(t_ns) > MAX_GAP_S * 1e9) + 1
    return np.split(points_m, starts)


def evenly_spaced(count: int, most: int) -> IntArray:
    """At most `most` indices out of `count`, evenly spaced, the first and the last among them."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).astype(np.int64))


def round_step(span: float, most: int) -> float:
    """A step of 1, 2 or 5 times a power of ten that divides `span` into at most `most` parts."""
    if span <= 0.0:
        return 1.0
    power = 10.0 ** floor(log10(span / most))
    steps = (power, 2 * power, 5 * power, 10 * power)
    return next(step for step in steps if span / step <= most + 1e-9)
