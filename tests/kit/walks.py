"""Walks past one transmitter, simulated independently of `logger.sim`."""

from dataclasses import replace

import numpy as np

from logger.core.locator.region import highest_density
from logger.core.places import Places, Utm
from logger.core.readings import Readings

FLOOR_DBM = -110.0


def observations(x, y, level, position_sigma=0.0):
    at = np.arange(len(x))
    x, y, level = (np.asarray(v, float) for v in (x, y, level))
    return Readings(
        "c",
        "gsm",
        Places.of(x, y, utm=Utm(32), sigma_m=np.full(len(x), position_sigma), t_ns=at * 10**9),
        level,
        at,
    )


def single_reading(x, y, level, limit=0, sigma_m=3.0):
    """One reading, as the device takes them."""
    place = Places.of(x, y, sigma_m=np.array([sigma_m]))
    return Readings.one("c", "gsm", place, level, limit)


def with_places(obs, **columns):
    """The readings with other columns of their places."""
    return replace(obs, places=replace(obs.places, **columns))


def path(shape, count=600, step=1.4):
    """Positions of a walk, about 840 m long."""
    s = np.arange(count) * step
    length = count * step
    if shape == "straight":
        return s - length / 2, np.zeros(count)
    if shape == "L":
        return np.minimum(s, length / 2), np.maximum(s - length / 2, 0.0)
    if shape == "circle":
        radius = length / (2 * np.pi)
        return radius * np.cos(s / radius), radius * np.sin(s / radius)
    if shape == "spiral":
        return _spiral(s, length)
    if shape == "random":
        return _streets(s, length)
    side = length / 4
    corner = [0, side, 2 * side, 3 * side, length]
    return np.interp(s, corner, [0, side, side, 0, 0]), np.interp(s, corner, [0, 0, side, side, 0])


def _spiral(s, length, turns=3.0):
    """Archimedean spiral, outward, in about equal steps.

    The length of the spiral grows with the square of the angle.
    """
    end = 2 * np.pi * turns
    angle = end * np.sqrt(s / length)
    radius = 2 * length / end**2 * angle
    return radius * np.cos(angle), radius * np.sin(angle)


def _streets(s, length, blocks=12, seed=10):
    """Straight on, left or right at every crossing, always the same way; never back."""
    turn = np.random.default_rng(seed).choice([-1, 0, 1], blocks)
    heading = 0.5 * np.pi * np.cumsum(turn)
    side = length / blocks
    corner = np.arange(blocks + 1) * side
    x, y = (np.append(0.0, np.cumsum(side * f(heading))) for f in (np.cos, np.sin))
    return np.interp(s, corner, x), np.interp(s, corner, y)


def shadowing(rng, x, y, sigma_db, d_c):
    """First-order autoregressive along the path."""
    rho = np.exp(-np.hypot(np.diff(x), np.diff(y)) / d_c)
    s = rng.normal(size=len(x))
    for k, r in enumerate(rho, start=1):
        s[k] = r * s[k - 1] + np.sqrt(1 - r * r) * s[k]
    return sigma_db * s


def simulate(rng, shape, *, white_db=3.0, shadow_db=0.0, d_c=15.0, count=600, step=1.4):
    """Readings of a walk and the source, 25 to 200 m off one of its points and never closer."""
    x, y = path(shape, count, step)
    while True:
        k, bearing, away = rng.integers(count), rng.uniform(0, 2 * np.pi), rng.uniform(25, 200)
        source = x[k] + away * np.cos(bearing), y[k] + away * np.sin(bearing)
        distance = np.hypot(x - source[0], y - source[1])
        if distance.min() >= 25.0:
            break
    level = (
        rng.uniform(-45, -15)
        - 10 * rng.uniform(2.3, 3.9) * np.log10(distance)
        + white_db * rng.normal(size=count)
    )
    if shadow_db:
        level = np.round(level + shadowing(rng, x, y, shadow_db, d_c))
    return observations(x, y, level), source


def censor_at_floor(obs, share):
    """Levels as a GSM modem reports them if `share` of them are at the lower limit of its scale."""
    weaker = np.round(obs.level_dbm - np.quantile(obs.level_dbm, share) + FLOOR_DBM)
    return replace(obs, level_dbm=np.maximum(weaker, FLOOR_DBM))


def region_contains(posterior, point, slack_m=0.0):
    """True if the 95 % region contains a point."""
    chosen = highest_density(posterior.squares)
    squares = posterior.squares
    reach = 0.5 * squares.size_m[chosen] + slack_m
    inside = (np.abs(squares.x_m[chosen] - point[0]) <= reach) & (
        np.abs(squares.y_m[chosen] - point[1]) <= reach
    )
    return bool(np.any(inside))


def nearest_mode_m(posterior, point):
    return min(np.hypot(m.x_m - point[0], m.y_m - point[1]) for m in posterior.modes)


def add_position_errors(rng, sigma_m, obs):
    """The same walk with slow errors of the receiver's position."""
    east_m, north_m = (sigma_m * _lasting(rng, len(obs)) for _ in range(2))
    sigmas_m = np.full(len(obs), sigma_m)
    return with_places(obs, x_m=obs.x_m + east_m, y_m=obs.y_m + north_m, sigma_m=sigmas_m)


def _lasting(rng, count, memory=0.98):
    """Unit errors of one axis that last for a minute."""
    values = rng.normal(size=count)
    for k in range(1, count):
        values[k] = memory * values[k - 1] + np.sqrt(1.0 - memory**2) * values[k]
    return values
