"""Simulated worlds: log-distance levels at the source's height, one builder for each difficulty.

Unless stated otherwise, P0 ~ U(-45, -15) dBm, eta ~ U(2.3, 3.9), and the source is 25 to 200 m from
a point of the walk and never closer than 25 m to any. Every world is rotated by a random angle and
shifted to usual UTM coordinates, so that no grid is aligned with it by chance.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import log_distance_db

from .walks import COUNT, SHAPES, STEP_M, Points, circle_radius_m
from .world import Noise, Place, Walk, World

Build = Callable[[np.random.Generator], World]
GpsError = Literal["white", "slow", "constant"]

TWO_SCALE = Noise(1.0, 7.0, 20.0, in_plane=True, step_db=1.0, long_share=0.75, long_m=300.0)
"""As the residuals of measured walks: three quarters of the variance are correlated over 100 to 350
m (hills, streets), the rest over 10 to 30 m.
"""
FLOOR_DBM = -110.0
SPEC_RADIUS_M, SPEC_READINGS = 500.0, 50
GPS_SIGMA_M = 5.0
BEAM_WIDTH_DEG, FRONT_TO_BACK_DB = 65.0, 25.0
"""Half-power beam width and front-to-back ratio of the sector antenna."""

_ORIGIN_M = (400_000.0, 5_700_000.0)
_AWAY_M = (25.0, 200.0)
_GPS_MEMORY_S = 60.0
_APART_M = (200.0, 500.0)
_PASSED_M = (25.0, 60.0)
_LEAST_SHARE = 0.2


def plain(rng: np.random.Generator, shape: str, noise: Noise) -> World:
    """A source beside a walk of some shape; with its twin for a straight or a round walk."""
    points, source = _beside(rng, shape, _AWAY_M)
    world = _simulate_walk(rng, points, source, noise)
    return _place_randomly(rng, replace(world, mirror=_mirror_of(shape, source)))


def clipped_world(rng: np.random.Generator, shape: str, share: float, noise: Noise) -> World:
    """Levels in steps of 1 dB; P0 such that this share of them is at -110 dBm or below.

    Those are reported as exactly -110 dBm.
    """
    points, source = _beside(rng, shape, _AWAY_M)
    loud = _simulate_walk(rng, points, source, replace(noise, step_db=0.0)).walk
    shift_db = FLOOR_DBM + 0.5 - np.quantile(loud.level_dbm, share)
    whole = replace(loud, level_dbm=np.round(loud.level_dbm + shift_db))
    walk = replace(whole, level_dbm=np.maximum(whole.level_dbm, FLOOR_DBM))
    rounded_noise = replace(noise, step_db=1.0)
    return _place_randomly(
        rng, World(walk, whole, (source,), noise=rounded_noise, floor_dbm=FLOOR_DBM)
    )


def with_gps_errors(rng: np.random.Generator, shape: str, kind: GpsError) -> World:
    """A pass at 15 to 40 m with errors of the receiver's position of 5 m an axis.

    The errors are independent for each fix, slow (60 s) or constant.
    """
    points, source = _beside(rng, shape, (15.0, 40.0))
    world = _simulate_walk(rng, points, source, Noise(3.0))
    count = len(world.walk)
    memory = {"white": 0.0, "slow": np.exp(-1.0 / _GPS_MEMORY_S), "constant": 1.0}[kind]
    east_m, north_m = (GPS_SIGMA_M * gauss_markov(rng, count, memory) for _ in range(2))
    walk = replace(world.walk, x_m=world.walk.x_m + east_m, y_m=world.walk.y_m + north_m)
    return _place_randomly(rng, replace(world, walk=walk, position_sigma_m=GPS_SIGMA_M))


def shared_identity(rng: np.random.Generator, shape: str) -> World:
    """Two sources 200 to 500 m apart, both passed within 60 m.

    The stronger of their levels is received. Their powers are within 5 dB, and each is the stronger
    one in a fifth of the readings or more.
    """
    while True:
        points = SHAPES[shape](rng, COUNT, STEP_M)
        one, other = _near(rng, points, _PASSED_M), _near(rng, points, _PASSED_M)
        if (
            one is None
            or other is None
            or not _APART_M[0] <= np.hypot(*np.subtract(one, other)) <= _APART_M[1]
        ):
            continue
        p0_dbm, eta = _power(rng), _exponent(rng)
        levels = np.stack(
            [
                _level_dbm(points, one, p0_dbm, eta),
                _level_dbm(points, other, p0_dbm + rng.uniform(-5.0, 5.0), eta),
            ]
        )
        levels += 3.0 * rng.normal(size=levels.shape)
        if _LEAST_SHARE <= np.mean(levels[0] > levels[1]) <= 1.0 - _LEAST_SHARE:
            walk = Walk(*points, np.max(levels, axis=0))
            return _place_randomly(rng, World(walk, walk, (one, other), eta=eta, noise=Noise(3.0)))


def past_sector_antenna(rng: np.random.Generator, shape: str, noise: Noise) -> World:
    """As `plain`, but the source has a sector antenna."""
    return with_sector_antenna(rng, plain(rng, shape, noise))


def with_sector_antenna(rng: np.random.Generator, world: World) -> World:
    """The same walk past a sector antenna with a random azimuth."""
    walk, ((x_m, y_m),) = world.walk, world.sources
    azimuth_deg = np.degrees(np.arctan2(walk.x_m - x_m, walk.y_m - y_m))
    level_dbm = walk.level_dbm + sector_pattern_db(azimuth_deg - rng.uniform(0.0, 360.0))
    if world.noise is not None and world.noise.step_db:
        level_dbm = world.noise.step_db * np.round(level_dbm / world.noise.step_db)
    heard = replace(walk, level_dbm=level_dbm)
    return replace(world, walk=heard, whole=heard)


def sector_pattern_db(azimuth_deg: FloatArray) -> FloatArray:
    """Loss of a sector antenna by the azimuth off its beam (3GPP TR 36.942, 4.2.1)."""
    off_deg = (azimuth_deg + 180.0) % 360.0 - 180.0
    return -np.minimum(12.0 * (off_deg / BEAM_WIDTH_DEG) ** 2, FRONT_TO_BACK_DB)


def past_antenna(
    rng: np.random.Generator, noise: Noise, *, height_m: float, pass_m: float, count: int
) -> World:
    """A walk of streets that passes an antenna above the receiver at a horizontal distance.

    The walk has `count` readings. It is closest to the antenna there and not at one of its ends.
    """
    while True:
        points = SHAPES["random"](rng, count, STEP_M)
        source = _near(rng, points, (0.98 * pass_m, pass_m))
        if source is None:
            continue
        closest = int(np.argmin(np.hypot(points[0] - source[0], points[1] - source[1])))
        if 0.1 * count <= closest < 0.9 * count:
            world = _simulate_walk(rng, points, source, noise, height_m)
            return _place_randomly(rng, world)


def specified_scenario(rng: np.random.Generator, count: int, *, spread: bool) -> World:
    """The specification's scenario: `count` readings 500 m from the station, 3 dB.

    They are the first of 50 on the circle (`spread`: all around it).
    """
    angle = 2.0 * np.pi * np.arange(count) / (count if spread else SPEC_READINGS)
    points = SPEC_RADIUS_M * np.cos(angle), SPEC_RADIUS_M * np.sin(angle)
    return _place_randomly(rng, _simulate_walk(rng, points, (0.0, 0.0), Noise(3.0)))


def _place_randomly(rng: np.random.Generator, world: World) -> World:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return world.transform(turn, _ORIGIN_M)


def _beside(
    rng: np.random.Generator, shape: str, away_m: tuple[float, float]
) -> tuple[Points, Place]:
    while True:
        points = SHAPES[shape](rng, COUNT, STEP_M)
        source = _near(rng, points, away_m)
        if source:
            return points, source


def _near(rng: np.random.Generator, points: Points, away_m: tuple[float, float]) -> Place | None:
    """A place at a distance from a point of the walk; None where it is too close to another."""
    k, bearing, away = (
        rng.integers(len(points[0])),
        rng.uniform(0.0, 2.0 * np.pi),
        rng.uniform(*away_m),
    )
    x_m, y_m = points[0][k] + away * np.cos(bearing), points[1][k] + away * np.sin(bearing)
    closest_m = np.min(np.hypot(points[0] - x_m, points[1] - y_m))
    return (float(x_m), float(y_m)) if closest_m >= away_m[0] else None


def _simulate_walk(
    rng: np.random.Generator,
    points: Points,
    source: Place,
    noise: Noise,
    height_m: float = 0.0,
) -> World:
    eta = _exponent(rng)
    level_dbm = _level_dbm(points, source, _power(rng), eta, height_m)
    level_dbm += noise.white_db * rng.normal(size=len(points[0]))
    if noise.shadow_db:
        root = np.linalg.cholesky(noise.shadowing_db2(*points) + 1e-9 * np.eye(len(points[0])))
        level_dbm += root @ rng.normal(size=len(points[0]))
    if noise.step_db:
        level_dbm = noise.step_db * np.round(level_dbm / noise.step_db)
    walk = Walk(*points, level_dbm)
    return World(walk, walk, (source,), eta=eta, noise=noise)


def _mirror_of(shape: str, source: Place) -> Place | None:
    """Mirror image in a straight walk, or the inverse point of a circle.

    The ratio of the distances to a point and its inverse is constant on the circle.
    """
    if shape == "straight":
        return source[0], -source[1]
    if shape == "circle":
        factor = circle_radius_m() ** 2 / (source[0] ** 2 + source[1] ** 2)
        return factor * source[0], factor * source[1]
    return None


def _power(rng: np.random.Generator) -> float:
    return float(rng.uniform(-45.0, -15.0))


def _exponent(rng: np.random.Generator) -> float:
    return float(rng.uniform(2.3, 3.9))


def _level_dbm(
    points: Points, source: Place, p0_dbm: float, eta: float, height_m: float = 0.0
) -> FloatArray:
    distance_db = log_distance_db(points[0] - source[0], points[1] - source[1], height_m)
    return np.asarray(p0_dbm - eta * distance_db, float)


def gauss_markov(rng: np.random.Generator, count: int, memory: FloatArray | float) -> FloatArray:
    """Stationary series (count,) of unit variance.

    `memory` is the correlation with the value before, one for all or of shape (count - 1,).
    """
    values, of_step = rng.normal(size=count), np.broadcast_to(memory, count - 1).tolist()
    for k, kept in enumerate(of_step, 1):
        values[k] = kept * values[k - 1] + np.sqrt(1.0 - kept**2) * values[k]
    return values
