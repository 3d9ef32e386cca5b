"""Base stations on the ground, and their levels at a position.

    level = P0 - 10 eta log10(d) + shadowing(position) + fading(reading)

The level is rounded and not below the floor; d is the distance in space, at least 1 m.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from pyproj import Proj

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import log_distance_db
from logger.core.types import Broadcast

WAVES = 512
"""The error of one field's correlation is 1/sqrt(2 WAVES)."""


@dataclass(frozen=True, slots=True, eq=False)
class Shadowing:
    """The shadowing of one transmitter at each position, constant in time.

    Log-normal: a Gaussian field with covariance sigma^2 exp(-d / d_c), which is Gudmundson's model
    (Electronics Letters 27(23), 1991). It is a sum of plane waves with random wave numbers of its
    spectrum in the plane, proportional to (1 + (k d_c)^2)^(-3/2). Over the seeds its variance and
    its correlation are exact at every position, without grid, edge or interpolation; one field has
    both within some 3 %.
    """

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


@dataclass(frozen=True, slots=True)
class Transmitter:
    """One cell: its position, its power (P0 in dBm at 1 m), its identity and what it broadcasts."""

    east_m: float
    north_m: float
    p0_dbm: float
    eta: float
    mcc: str
    mnc: str
    lac: int
    cid: int
    arfcn: int
    bsic: int
    height_m: float = 0.0
    broadcast: Broadcast | None = None


@dataclass(frozen=True, slots=True)
class Radio:
    """How levels spread, and what a receiver resolves.

    `floor_dbm` is where GSM's RXLEV begins (3GPP TS 45.008 8.1.4), `step_db` its resolution; 0
    means no rounding.
    """

    shadowing_sigma_db: float = 6.0
    decorrelation_m: float = 20.0
    fading_sigma_db: float = 2.0
    floor_dbm: float = -110.0
    step_db: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Transmitters around an origin; levels have the shape (transmitter, *positions)."""

    transmitters: tuple[Transmitter, ...]
    origin_lat_deg: float
    origin_lon_deg: float
    radio: Radio
    shadowing: tuple[Shadowing, ...]

    @classmethod
    def build(
        cls,
        transmitters: tuple[Transmitter, ...],
        origin_lat_deg: float,
        origin_lon_deg: float,
        radio: Radio,
        rng: np.random.Generator,
    ) -> Self:
        """A world with random shadowing."""
        shadowing = tuple(
            Shadowing.draw(radio.shadowing_sigma_db, radio.decorrelation_m, rng)
            for _ in transmitters
        )
        return cls(transmitters, origin_lat_deg, origin_lon_deg, radio, shadowing)

    def levels_dbm(self, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
        """Levels by the formula alone."""
        return np.stack(
            [_level_dbm(transmitter, east_m, north_m) for transmitter in self.transmitters]
        )

    def shadowed_dbm(self, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
        """Levels that the position determines: by the formula and with shadowing."""
        shadows_db = np.stack([shadowing.at_db(east_m, north_m) for shadowing in self.shadowing])
        return self.levels_dbm(east_m, north_m) + shadows_db

    def received_dbm(
        self, east_m: FloatArray, north_m: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Levels of one reading at each position: with fading, rounded, not below the floor."""
        level_dbm = self.shadowed_dbm(east_m, north_m)
        level_dbm = level_dbm + rng.normal(0.0, self.radio.fading_sigma_db, level_dbm.shape)
        if self.radio.step_db > 0.0:
            level_dbm = np.round(level_dbm / self.radio.step_db) * self.radio.step_db
        return np.maximum(level_dbm, self.radio.floor_dbm)

    def to_latlon(self, east_m: float, north_m: float) -> tuple[float, float]:
        """Latitude and longitude in degrees (WGS 84)."""
        lon_deg, lat_deg = self._projection()(east_m, north_m, inverse=True)
        return float(lat_deg), float(lon_deg)

    def to_local(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """East and north of the origin in metres."""
        east_m, north_m = self._projection()(lon_deg, lat_deg)
        return float(east_m), float(north_m)

    def _projection(self) -> Proj:
        # Azimuthal equidistant: distances from the origin are true, those of UTM are up to 0.04 %
        # shorter. Made anew for each use, as one must not be shared by threads.
        return Proj(
            proj="aeqd", lat_0=self.origin_lat_deg, lon_0=self.origin_lon_deg, ellps="WGS84"
        )


def _level_dbm(transmitter: Transmitter, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
    flat_m = np.hypot(
        np.asarray(east_m) - transmitter.east_m, np.asarray(north_m) - transmitter.north_m
    )
    return transmitter.p0_dbm - transmitter.eta * log_distance_db(
        flat_m, np.full_like(flat_m, transmitter.height_m)
    )
