"""What the online locator takes and gives."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray

_MOST_READINGS = 400
"""As many as a test of the walk against its own halves gathers into blocks."""


class LevelReading(NamedTuple):
    """A reading with the receiver's position; `limit` as in `censoring.limits`."""

    x_m: float
    y_m: float
    sigma_m: float
    level_dbm: float
    limit: int


class StrongestMode(NamedTuple):
    """Strongest mode: mean [x, y, P0, eta], covariance (4, 4), probability, sigma of a level."""

    state: FloatArray
    covariance: FloatArray
    probability: float
    sigma_db: float


class ReadingsInOrder:
    """Readings of a walk in their order; when there are too many, every second one is dropped."""

    def __init__(self) -> None:
        self._readings: list[LevelReading] = []
        self._every = 1
        self._count = 0

    def add(self, latest: LevelReading) -> None:
        """Take the next reading."""
        if self._count % self._every == 0:
            self._readings.append(latest)
        self._count += 1
        if len(self._readings) > _MOST_READINGS:
            self._readings = self._readings[::2]
            self._every *= 2

    def columns(self) -> FloatArray:
        """Rows x, y, sigma of the position, level and limit; shape (5, n)."""
        return np.array(self._readings, float).reshape(-1, 5).T
