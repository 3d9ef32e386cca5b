"""Shapes of walks: positions in metres, shape (n,), one every `step_m`."""

from collections.abc import Callable

import numpy as np

from logger.core.arrays import FloatArray

COUNT = 600
STEP_M = 1.4
"""A reading a second at walking speed."""

_SPIRAL_TURNS = 2.0
_STREET_M = 60.0
_TURN_DEG = 70.0

Points = tuple[FloatArray, FloatArray]
Shape = Callable[[np.random.Generator, int, float], Points]


def straight(_: np.random.Generator, count: int, step_m: float) -> Points:
    """East along the axis, the middle at the origin."""
    return step_m * np.arange(-0.5 * count, 0.5 * count), np.zeros(count)


def corner(_: np.random.Generator, count: int, step_m: float) -> Points:
    """Two equal legs at a right angle, like an L."""
    s, leg = np.arange(count) * step_m, 0.5 * count * step_m
    return np.minimum(s, leg), np.maximum(s - leg, 0.0)


def square(_: np.random.Generator, count: int, step_m: float) -> Points:
    """Once around a block."""
    s, side = np.arange(count) * step_m, 0.25 * count * step_m
    knots = side * np.arange(5)
    return np.interp(s, knots, side * np.array([0, 1, 1, 0, 0])), np.interp(
        s, knots, side * np.array([0, 0, 1, 1, 0])
    )


def circle(_: np.random.Generator, count: int, step_m: float) -> Points:
    """Once around the origin."""
    radius_m = circle_radius_m(count, step_m)
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius_m * np.cos(angle), radius_m * np.sin(angle)


def circle_radius_m(count: int = COUNT, step_m: float = STEP_M) -> float:
    """Radius of `circle`."""
    return count * step_m / (2.0 * np.pi)


def spiral(_: np.random.Generator, count: int, step_m: float) -> Points:
    """Archimedean, two turns outwards, at even speed."""
    fine = np.linspace(0.0, 2.0 * np.pi * _SPIRAL_TURNS, 20 * count)
    x, y = fine * np.cos(fine), fine * np.sin(fine)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    pitch_m = count * step_m / length[-1]
    angle = np.interp(np.arange(count) * step_m, pitch_m * length, fine)
    return pitch_m * angle * np.cos(angle), pitch_m * angle * np.sin(angle)


def random(rng: np.random.Generator, count: int, step_m: float) -> Points:
    """A new street every 60 m, at a normal angle to the last."""
    streets = int(np.ceil(count * step_m / _STREET_M))
    heading = np.cumsum(np.radians(_TURN_DEG) * rng.normal(size=streets))
    at_step = heading[(np.arange(count) * step_m // _STREET_M).astype(int)]
    return np.cumsum(step_m * np.cos(at_step)), np.cumsum(step_m * np.sin(at_step))


SHAPES: dict[str, Shape] = {
    "straight": straight,
    "L": corner,
    "square": square,
    "circle": circle,
    "spiral": spiral,
    "random": random,
}
TELLING = ("L", "square", "random", "spiral")
"""Shapes without an exact twin."""
