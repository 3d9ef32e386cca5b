"""Base stations on the ground, and their levels at a position.

    level = P0 - 10 eta log10(d) + shadowing(position) + fading(reading)

The level is rounded and not below the floor; d is the distance in space, at least 1 m.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
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

    @property
    def name(self) -> str:
        """Its identity."""
        return f"{self.mcc}-{self.mnc}-{self.lac}-{self.cid}"


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


NEIGHBOURS = 6
SUBTRACTED = 31
"""Penalty time with which the offset of a cell lowers C2 (3GPP TS 45.008 6.4)."""
ACCESS_DBM = -105
"""Level from which access is allowed, where the path loss criterion C1 begins to count."""


@dataclass(frozen=True, slots=True)
class ReceivedCell:
    """One cell at its level; of one that is not decoded only channel and level are known."""

    cell: Transmitter
    level_dbm: float
    is_decoded: bool

    @property
    def rxlev(self) -> int:
        """Index of the level, 0 below -110 dBm to 63 (3GPP TS 45.008 8.1.4)."""
        return min(max(round(self.level_dbm) + 111, 0), 63)

    @property
    def dbm(self) -> int:
        return round(self.level_dbm)

    @property
    def c1(self) -> int:
        """Path loss criterion: the level above that from which access is allowed."""
        return self.dbm - ACCESS_DBM

    @property
    def c2(self) -> int:
        """Reselection criterion: C1 and the offset of the cell, once its penalty time is over."""
        broadcast = self.cell.broadcast or Broadcast()
        offset_db = broadcast.cro_db or 0
        return self.c1 - offset_db if broadcast.penalty_time == SUBTRACTED else self.c1 + offset_db


@dataclass(frozen=True, slots=True)
class ModemFix:
    """A fix of the modem's GNSS receiver."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    utc: datetime
    speed_mps: float
    course_deg: float


@dataclass(frozen=True, slots=True)
class Air:
    """The strongest decoded cell serves, its offset included; the others follow by level.

    `fix` gives the position, None without one.
    """

    serving: ReceivedCell | None
    others: tuple[ReceivedCell, ...]
    fix: Callable[[], ModemFix | None]

    @classmethod
    def of(
        cls, cells: Sequence[ReceivedCell], fix: Callable[[], ModemFix | None] = lambda: None
    ) -> Self:
        by_level = sorted(cells, key=lambda one: one.level_dbm, reverse=True)
        decoded = [one for one in by_level if one.is_decoded]
        serving = max(decoded, key=_attraction_dbm, default=None)
        return cls(serving, tuple(one for one in by_level if one is not serving), fix)

    @property
    def neighbours(self) -> tuple[ReceivedCell, ...]:
        """Those that a modem measures: on the channels that its serving cell lists, if it does."""
        if self.serving is None:
            return ()
        broadcast = self.serving.cell.broadcast or Broadcast()
        listed = broadcast.neighbour_arfcns
        others = [one for one in self.others if listed is None or one.cell.arfcn in listed]
        return tuple(others[:NEIGHBOURS])

    @property
    def decoded_neighbours(self) -> tuple[ReceivedCell, ...]:
        return tuple(one for one in self.neighbours if one.is_decoded)

    @property
    def decoded_cells(self) -> tuple[ReceivedCell, ...]:
        """All cells that a full scan can name."""
        return (
            ()
            if self.serving is None
            else (self.serving, *(one for one in self.others if one.is_decoded))
        )


def _attraction_dbm(one: ReceivedCell) -> float:
    """Level with the offset that raises C2; one that lowers it is for a moving telephone."""
    return one.level_dbm + max(one.c2 - one.c1, 0)
