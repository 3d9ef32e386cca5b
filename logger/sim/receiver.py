"""A GNSS receiver on a walk: RMC, GGA and GSA of each epoch, as a u-blox M8 prints them."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import reduce
from operator import xor

import numpy as np

from logger.sim.walk import Walk
from logger.sim.world import World

MPS_PER_KNOT = 1852 / 3600
SPEED_SIGMA_MPS = 0.05
COURSE_FROM_MPS = 0.3
"""Slower than this no course is printed."""
GEOID_M = 48.0
SATELLITES = (2, 5, 12, 15, 21, 24, 25, 29, 67, 68, 77, 84)  # GPS and GLONASS by NMEA numbers
PDOP, HDOP, VDOP = 1.68, 0.92, 1.41

NO_FIX = (
    "GNRMC,,V,,,,,,,,,,N",
    "GNGGA,,,,,,0,00,99.99,,,,,,",
    "GNGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99",
)


@dataclass(frozen=True, slots=True)
class GnssNoise:
    """Error on each axis: a first-order Gauss-Markov part and a white part of each epoch."""

    wander_sigma_m: float = 3.0
    wander_time_s: float = 60.0
    white_sigma_m: float = 0.2


class SimulatedReceiver:
    """One receiver from power-up on, without a fix for `cold_start_s` seconds."""

    def __init__(
        self,
        world: World,
        walk: Walk,
        utc_start: datetime,
        rng: np.random.Generator,
        noise: GnssNoise | None = None,
        cold_start_s: float = 0.0,
        altitude_m: float = 540.0,
    ) -> None:
        self._world = world
        self._walk = walk
        self._utc_start = utc_start
        self._rng = rng
        self._noise = noise or GnssNoise()
        self._cold_start_s = cold_start_s
        self._altitude_m = altitude_m
        self._wander_m = rng.normal(0.0, self._noise.wander_sigma_m, 3)  # east, north, up
        self._t_s = 0.0

    def epoch(self, t_s: float) -> bytes:
        """The sentences of one epoch; epochs come in order."""
        error_m = self._advance(t_s)
        texts = NO_FIX if t_s < self._cold_start_s else self._fix(t_s, error_m)
        return b"".join(sentence(text) for text in texts)

    def _advance(self, t_s: float) -> tuple[float, float, float]:
        """Position error in metres: x' = a x + sqrt(1 - a^2) sigma w, a = exp(-dt / T)."""
        noise = self._noise
        decay = float(np.exp(-(t_s - self._t_s) / noise.wander_time_s))
        drive_m = self._rng.normal(0.0, noise.wander_sigma_m, 3)
        self._wander_m = decay * self._wander_m + np.sqrt(1.0 - decay**2) * drive_m
        self._t_s = t_s
        east_m, north_m, up_m = self._wander_m + self._rng.normal(0.0, noise.white_sigma_m, 3)
        return float(east_m), float(north_m), float(up_m)

    def _fix(self, t_s: float, error_m: tuple[float, float, float]) -> tuple[str, str, str]:
        east_m, north_m = self._walk.position(t_s)
        lat_deg, lon_deg = self._world.to_latlon(east_m + error_m[0], north_m + error_m[1])
        utc = self._utc_start + timedelta(seconds=t_s)
        time = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02d}"
        position = f"{_angle(lat_deg, 2, 'NS')},{_angle(lon_deg, 3, 'EW')}"
        altitude = f"{self._altitude_m + error_m[2]:.1f}"
        quality = f"{len(SATELLITES):02d},{HDOP:.2f}"
        satellites = ",".join(f"{number:02d}" for number in SATELLITES)
        return (
            f"GNRMC,{time},A,{position},{self._speed_course(t_s)},{utc:%d%m%y},,,A",
            f"GNGGA,{time},{position},1,{quality},{altitude},M,{GEOID_M:.1f},M,,",
            f"GNGSA,A,3,{satellites},{PDOP:.2f},{HDOP:.2f},{VDOP:.2f}",
        )

    def _speed_course(self, t_s: float) -> str:
        """Speed in knots and course in degrees."""
        speed_mps, course_deg = self._walk.motion(t_s)
        speed_mps = abs(speed_mps + float(self._rng.normal(0.0, SPEED_SIGMA_MPS)))
        course = f"{course_deg:.2f}" if speed_mps >= COURSE_FROM_MPS else ""
        return f"{speed_mps / MPS_PER_KNOT:.3f},{course}"


def sentence(text: str) -> bytes:
    """Text between `$` and a checksum, with its line end."""
    body = text.encode("ascii")
    return b"$%b*%02X\r\n" % (body, reduce(xor, body))


def _angle(angle_deg: float, degree_digits: int, letters: str) -> str:
    """As `ddmm.mmmmm`; the second of `letters` is the negative hemisphere."""
    # Rounded once, in steps of 1e-5 minutes, so that no 60.00000 minutes come out.
    degrees, steps = divmod(round(abs(angle_deg) * 6_000_000), 6_000_000)
    minutes, fraction = divmod(steps, 100_000)
    return f"{degrees:0{degree_digits}d}{minutes:02d}.{fraction:05d},{letters[angle_deg < 0.0]}"
