"""What the online locator takes and gives."""

from dataclasses import replace
from typing import NamedTuple

from logger.core.arrays import FloatArray
from logger.core.readings import Readings, in_order

_MOST_READINGS = 400
"""As many as a test of the walk against its own halves gathers into blocks."""


class StrongestMode(NamedTuple):
    """Strongest mode: mean [x, y, P0, eta], covariance (4, 4), probability, sigma of a level."""

    state: FloatArray
    covariance: FloatArray
    probability: float
    sigma_db: float


class ReadingsInOrder:
    """Readings of a walk in their order; when there are too many, every second one is dropped."""

    def __init__(self) -> None:
        self._readings: list[Readings] = []
        self._every = 1
        self._count = 0

    def add(self, latest: Readings) -> None:
        """Take the next reading."""
        if self._count % self._every == 0:
            self._readings.append(latest)
        self._count += 1
        if len(self._readings) > _MOST_READINGS:
            self._readings = self._readings[::2]
            self._every *= 2

    def readings(self) -> Readings:
        """Those that are left, without spikes."""
        return replace(in_order(self._readings), without_spikes=True)
