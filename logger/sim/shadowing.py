"""Log-normal shadowing: a Gaussian field with covariance sigma^2 exp(-d / d_c).

The model is Gudmundson's (Electronics Letters 27(23), 1991). The field is a sum of plane waves
with random wave numbers of its spectrum in the plane, proportional to (1 + (k d_c)^2)^(-3/2).
Over the seeds its variance and its correlation are exact at every position, without grid, edge or
interpolation; one field has both within some 3 %.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from logger.core.arrays import FloatArray

WAVES = 512
"""The error of one field's correlation is 1/sqrt(2 WAVES)."""


@dataclass(frozen=True, slots=True, eq=False)
class Shadowing:
    """The shadowing of one transmitter at each position, constant in time."""

    amplitude_db: float
    k_east_per_m: FloatArray
    k_north_per_m: FloatArray
    phase_rad: FloatArray

    @classmethod
    def draw(cls, sigma_db: float, decorrelation_m: float, rng: np.random.Generator) -> Self:
        """A field with standard deviation `sigma_db`, correlated by 1/e over `decorrelation_m`."""
        # The share of waves shorter than 2 pi / k is (1 + (k d_c)^2)^(-1/2).
        share = 1.0 - rng.random(WAVES)
        k_per_m = np.sqrt(share**-2 - 1.0) / decorrelation_m
        direction_rad = rng.uniform(0.0, 2.0 * np.pi, WAVES)
        return cls(
            amplitude_db=sigma_db * float(np.sqrt(2.0 / WAVES)),
            k_east_per_m=k_per_m * np.sin(direction_rad),
            k_north_per_m=k_per_m * np.cos(direction_rad),
            phase_rad=rng.uniform(0.0, 2.0 * np.pi, WAVES),
        )

    def at_db(self, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
        """Shadowing in dB, shape as given; it is added to the level."""
        angle_rad = (
            np.multiply.outer(np.asarray(east_m, float), self.k_east_per_m)
            + np.multiply.outer(np.asarray(north_m, float), self.k_north_per_m)
            + self.phase_rad
        )
        return np.asarray(self.amplitude_db * np.cos(angle_rad).sum(axis=-1), float)
