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
from logger.sim.shadowing import Shadowing


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
