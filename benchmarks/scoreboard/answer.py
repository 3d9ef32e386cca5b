"""The estimate of one method for one walk: position, uncertainty and other possible positions."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from logger.core.arrays import FloatArray

from .world import Place

CHI2_95_2DOF = 5.991
"""Here, since trees under test have it in different places."""
_OUTLINE_POINTS = 1440
_ROUNDING_M = 1e-6
"""Of sums of UTM coordinates: the centre of a round walk is a corner of four squares."""


class Region(Protocol):
    """A region that is claimed to hold the source with 95 %."""

    @property
    def area_m2(self) -> float:
        """Its area."""

    def holds(self, place: Place, slack_m: float) -> bool:
        """Whether a place is in it or no further than `slack_m` from it."""

    def radius_m(self, place: Place) -> float:
        """Distance of its farthest point from a place."""


@dataclass(frozen=True, slots=True)
class Ellipse95:
    """95 % ellipse of a Gaussian with the given centre and (2, 2) covariance."""

    centre: Place
    covariance: FloatArray

    @property
    def area_m2(self) -> float:
        return float(np.pi * CHI2_95_2DOF * np.sqrt(np.linalg.det(self.covariance)))

    def radius_m(self, place: Place) -> float:
        off_m = float(np.hypot(*np.subtract(place, self.centre)))
        return off_m + float(np.sqrt(CHI2_95_2DOF * np.max(np.linalg.eigvalsh(self.covariance))))

    def holds(self, place: Place, slack_m: float) -> bool:
        off = np.subtract(place, self.centre)
        if off @ np.linalg.solve(self.covariance, off) <= CHI2_95_2DOF:
            return True
        angle = np.linspace(0.0, 2.0 * np.pi, _OUTLINE_POINTS)
        outline = (
            np.sqrt(CHI2_95_2DOF)
            * np.linalg.cholesky(self.covariance)
            @ [np.cos(angle), np.sin(angle)]
        )
        return bool(np.min(np.hypot(*(outline - off[:, None]))) <= slack_m)


@dataclass(frozen=True, slots=True)
class Disc:
    """All within a radius of a place."""

    centre: Place
    within_m: float

    @property
    def area_m2(self) -> float:
        return float(np.pi * self.within_m**2)

    def radius_m(self, place: Place) -> float:
        return self.within_m + float(np.hypot(*np.subtract(place, self.centre)))

    def holds(self, place: Place, slack_m: float) -> bool:
        return float(np.hypot(*np.subtract(place, self.centre))) <= self.within_m + slack_m


@dataclass(frozen=True, slots=True)
class Squares:
    """A highest-density set: centres and sides of square cells, shape (n,)."""

    x_m: FloatArray
    y_m: FloatArray
    size_m: FloatArray

    @property
    def area_m2(self) -> float:
        return float(np.sum(self.size_m**2))

    def radius_m(self, place: Place) -> float:
        off_m = np.hypot(self.x_m - place[0], self.y_m - place[1])
        return float(np.max(off_m + self.size_m / np.sqrt(2.0)))

    def holds(self, place: Place, slack_m: float) -> bool:
        east_m = np.maximum(np.abs(self.x_m - place[0]) - 0.5 * self.size_m, 0.0)
        north_m = np.maximum(np.abs(self.y_m - place[1]) - 0.5 * self.size_m, 0.0)
        return bool(np.any(np.hypot(east_m, north_m) <= slack_m + _ROUNDING_M))


@dataclass(frozen=True, slots=True)
class Mode:
    """One possible position of the source, with the (2, 2) covariance of its probability."""

    x_m: float
    y_m: float
    covariance: FloatArray
    probability: float = 1.0

    def off_m(self, place: Place) -> float:
        """Distance of its mean to a place."""
        return float(np.hypot(self.x_m - place[0], self.y_m - place[1]))

    def nees(self, place: Place) -> float:
        """Normalised squared error, chi-square with 2 degrees of freedom for a true covariance."""
        off = np.array([place[0] - self.x_m, place[1] - self.y_m])
        return float(off @ np.linalg.solve(self.covariance, off))


@dataclass(frozen=True, slots=True)
class Answer:
    """Estimate, modes (most probable first), region, and verdict.

    Modes are empty for a method without uncertainty. `fits` is False if the method reports that one
    position does not explain the levels.
    """

    x_m: float
    y_m: float
    modes: tuple[Mode, ...] = ()
    region: Region | None = None
    verdict: str | None = None
    fits: bool = True


def gaussian(mean: FloatArray, covariance: FloatArray) -> Answer:
    """Answer of a method that gives only a mean [x, y, ...] and a covariance.

    Raises `ValueError` for an invalid covariance.
    """
    if not (np.all(np.isfinite(mean)) and np.all(np.isfinite(covariance))):
        raise ValueError("diverged")
    x_m, y_m, plane = float(mean[0]), float(mean[1]), covariance[:2, :2]
    if np.min(np.linalg.eigvalsh(plane)) <= 0.0:
        raise ValueError("the covariance is not positive")
    return Answer(x_m, y_m, (Mode(x_m, y_m, plane),), Ellipse95((x_m, y_m), plane))
