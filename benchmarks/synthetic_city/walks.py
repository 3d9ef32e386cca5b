"""Walks along the streets of a city, as a survey keeps them."""

from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from benchmarks.synthetic_city.world import (
    BLOCK_M,
    FLOOR_DBM,
    MOST_HEARD,
    NOISE_DB,
    ORIGIN_M,
    ZONE,
    City,
)
from logger.core.places import Places
from postproc.survey.walk_readings import HeardCell, SurveyRun, WalkReadings
from postproc.walk import Naming, named_shares

SPEED_MPS, SCAN_S = 1.4, 3.0
POSITION_SIGMA_M = 4.0
_MOST_SHADOWS = 4.0  # standard deviations of the shadowing, offsets of loggers included
DAY_NS = 86_400 * 10**9
FIRST_UTC_NS = 1_790_000_000 * 10**9


@dataclass(frozen=True)
class Walker:
    """A logger: its offset, and a lie if it tells one."""

    name: str
    offset_db: float
    lie_db: float = 0.0
    lie_m: float = 0.0


def draw_walkers(n: int, seed: int, *, sigma_db: float = 4.0) -> list[Walker]:
    """Honest ones."""
    offsets = np.random.default_rng((seed, 7)).normal(0.0, sigma_db, n)
    return [Walker(f"logger-{i:03d}", float(db)) for i, db in enumerate(offsets)]


def street_walk(city: City, n_scans: int, rng: np.random.Generator) -> np.ndarray:
    """Places (n, 2) along streets: at each corner on, left or right; never back, never outside."""
    blocks = int(city.size_m // BLOCK_M)
    corner = rng.integers(0, blocks + 1, 2)
    heading = int(rng.integers(4))
    steps = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])
    corners = [corner]
    for _ in range(int(n_scans * SPEED_MPS * SCAN_S / BLOCK_M) + 2):
        turns = [h % 4 for h in heading + rng.permutation([0, 0, 1, -1])]
        heading = next(
            (h for h in turns if np.all((corner + steps[h] >= 0) & (corner + steps[h] <= blocks))),
            (heading + 2) % 4,
        )
        corner = corner + steps[heading]
        corners.append(corner)
    along_m = np.arange(len(corners)) * BLOCK_M
    at_m = np.arange(n_scans) * SPEED_MPS * SCAN_S
    points = np.array(corners) * BLOCK_M
    return np.column_stack([np.interp(at_m, along_m, points[:, axis]) for axis in (0, 1)])


def draw_walk(city: City, walker: Walker, number: int, n_scans: int, seed: int) -> WalkReadings:
    """One run of a walker; run `number` begins on that tenth of a day."""
    rng = np.random.default_rng((seed, number))
    true_m = street_walk(city, n_scans, rng)
    near = _near(city, true_m)
    levels = np.array([city.level_dbm(station, true_m) for station in near]).reshape(-1, n_scans)
    levels = np.round(
        levels + walker.offset_db + walker.lie_db + NOISE_DB * rng.standard_normal(levels.shape)
    )
    rank = np.argsort(np.argsort(-levels, axis=0), axis=0)
    cell, scan = np.nonzero((rank < MOST_HEARD) & (levels >= FLOOR_DBM))
    bearing = rng.uniform(0.0, 2 * np.pi)
    lie_m = walker.lie_m * np.array([np.sin(bearing), np.cos(bearing)])
    # errors of a receiver persist: one of the walk, little of the fix
    error_m = rng.normal(0.0, 2.5, 2) + rng.normal(0.0, 1.5, (n_scans, 2))
    said_m = (true_m + error_m + lie_m + np.array(ORIGIN_M))[scan]
    counts = np.bincount(cell, minlength=len(near))
    digest = sha256(f"{seed} {number} {city.seed} {len(city.names)}".encode()).hexdigest()
    heard_by_name = sorted(
        (city.names[near[i]], i, int(counts[i])) for i in range(len(near)) if counts[i]
    )
    new_number = np.zeros(len(near), np.int64)
    for place, (_, i, _) in enumerate(heard_by_name):
        new_number[i] = place
    order = np.lexsort((scan, new_number[cell]))
    run = SurveyRun(
        digest, digest, digest[:32], f"run-{number:06d}.h5", walker.name, walker.name,
        FIRST_UTC_NS + number * DAY_NS // 10, len(cell),
    )  # fmt: skip
    return WalkReadings(
        run,
        tuple(
            HeardCell(name, "GSM", n, n, ((20 + i % 100, i % 64),)) for name, i, n in heard_by_name
        ),
        ZONE,
        new_number[cell][order],
        (scan[order] * SCAN_S * 1e9).astype(np.int64),
        said_m[order, 0],
        said_m[order, 1],
        np.full(len(cell), POSITION_SIGMA_M),
        levels[cell, scan][order],
        scan[order].astype(np.int64),
        np.full(len(cell), -1, np.int64),
        _named_shares(said_m, cell, scan)[order],
    )


def _named_shares(said_m: np.ndarray, cell: np.ndarray, scan: np.ndarray) -> np.ndarray:
    """As `postproc.walk` has them, of readings in scans (n,) at places (n, 2)."""
    _, first, number = np.unique(scan, return_index=True, return_inverse=True)
    naming = Naming(cell, number, np.zeros(len(cell), np.int64))
    return named_shares(Places.of(*said_m[first].T), naming)


def _near(city: City, walk_m: np.ndarray) -> np.ndarray:
    """Stations that could be heard somewhere in the rectangle of the walk."""
    inside_m = np.clip(city.position_m, walk_m.min(axis=0), walk_m.max(axis=0))
    distance_m = np.hypot(*(city.position_m - inside_m).T) + 1.0
    mean_dbm = city.p0_dbm - 10.0 * city.eta * np.log10(distance_m) + city.gain_db
    return np.flatnonzero(mean_dbm > FLOOR_DBM - _MOST_SHADOWS * city.shadow_db)
