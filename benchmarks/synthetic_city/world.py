"""Stations with antennas, and what is received at a place.

A level is P0 - 10 eta log10 d, plus an antenna pattern of its first harmonic, plus shadowing that
belongs to the place: Gaussian noise over 25 m and over 200 m, each a field on a grid, equal for
whoever walks there. Receivers add white noise, an offset of their own, and round to 1 dB.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

BLOCK_M = 100.0
"""From street to street."""
GRID_M = 12.5
ZONE = 33
ORIGIN_M = (390_000.0, 5_820_000.0)
NOISE_DB = 2.0
FLOOR_DBM = -108.0
MOST_HEARD = 12
"""Cells that a modem names in one scan."""
AREAS_M = 2000.0
"""Side of a location area."""


@dataclass(frozen=True)
class City:
    """Stations: east and north (s, 2) in metres of the city, P0, eta and antenna, (s,) each."""

    size_m: float
    position_m: np.ndarray
    p0_dbm: np.ndarray
    eta: np.ndarray
    gain_db: np.ndarray
    azimuth_rad: np.ndarray
    names: tuple[str, ...]
    seed: int
    shadow_db: float

    def level_dbm(self, station: int, xy_m: np.ndarray) -> np.ndarray:
        """Level of a station at places (n, 2), without a receiver, shape (n,)."""
        away_m = xy_m - self.position_m[station]
        distance_m = np.sqrt(np.sum(away_m**2, axis=1) + 25.0)
        bearing = np.arctan2(away_m[:, 0], away_m[:, 1])
        pattern_db = self.gain_db[station] * np.cos(bearing - self.azimuth_rad[station])
        return (
            self.p0_dbm[station]
            - 10.0 * self.eta[station] * np.log10(distance_m)
            + pattern_db
            + self._shadow_db(station, xy_m)
        )

    def _shadow_db(self, station: int, xy_m: np.ndarray) -> np.ndarray:
        """A window of a field that all stations share, shifted for each: quick to draw."""
        field = _field(self.seed)
        shift = np.random.default_rng((self.seed, station)).integers(0, len(field), 2)
        at = (xy_m / GRID_M + shift).T
        return self.shadow_db * map_coordinates(field, at, order=1, mode="grid-wrap")


_FIELDS: dict[int, np.ndarray] = {}


def _field(seed: int) -> np.ndarray:
    """Unit variance: half over 25 m, half over 200 m."""
    if seed not in _FIELDS:
        white = np.random.default_rng((seed, 99)).standard_normal((2, 1024, 1024))
        parts = [
            gaussian_filter(part, scale_m / GRID_M / np.sqrt(2.0), mode="wrap")
            for part, scale_m in zip(white, (25.0, 200.0), strict=True)
        ]
        _FIELDS[seed] = sum(part / np.std(part) for part in parts) / np.sqrt(2.0)
    return _FIELDS[seed]


def draw_city(
    n_stations: int, seed: int = 1, *, spacing_m: float = 500.0, shadow_db: float = 5.0
) -> City:
    """Stations at random in a square, as dense as one in a square of `spacing_m`."""
    rng = np.random.default_rng((seed, n_stations))
    size_m = spacing_m * np.sqrt(n_stations)
    position_m = rng.uniform(0.0, size_m, (n_stations, 2))
    area = (position_m // AREAS_M).astype(int)
    across = int(size_m // AREAS_M) + 1
    names = tuple(
        f"262-01-{801 + column + row * across}-{1000 + i}"
        for i, (column, row) in enumerate(area.tolist())
    )
    return City(
        size_m,
        position_m,
        rng.normal(-22.0, 5.0, n_stations),
        rng.normal(3.2, 0.25, n_stations),
        np.abs(rng.normal(0.0, 4.0, n_stations)),
        rng.uniform(0.0, 2 * np.pi, n_stations),
        names,
        seed,
        shadow_db,
    )
