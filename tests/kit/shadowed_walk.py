"""A walk in a world of the shadowing EKF's own model."""

import math

import numpy as np

from logger.core import shadow_ekf
from logger.core.places import Places
from logger.core.shadow_ekf import ShadowNoise

NOISE = ShadowNoise(shadow_db=6.0, decorrelation_m=15.0, white_db=2.0, height_m=8.0)
TRUTH = np.array([150.0, -80.0, -30.0, 3.1])
SPREAD = np.diag([15.0, 12.0, 4.0, 0.3])


def covariance(rng):
    root = rng.normal(size=(4, 4)) + 2.0 * np.eye(4)
    return SPREAD @ root @ root.T @ SPREAD / 6.0


def distance2(place, x_m, y_m, sigma_m, height_m):
    return (place[0] - x_m) ** 2 + (place[1] - y_m) ** 2 + height_m**2 + 2.0 * sigma_m**2


def expected_level(x, x_m, y_m, sigma_m=0.0, noise=NOISE):
    return x[2] - 5.0 * x[3] * math.log10(distance2(x, x_m, y_m, sigma_m, noise.height_m))


def walk(rng, count=600, noise=NOISE, truth=TRUTH, sigma_m=3.0):
    """Readings (x, y, sigma, level) round three sides of the truth, and the shadowing at each."""
    s = np.linspace(0.0, 3.0, count)
    x = truth[0] + 120.0 * np.interp(s, [0, 1, 2, 3], [-1, 1, 1, -1])
    y = truth[1] + 120.0 * np.interp(s, [0, 1, 2, 3], [-1, -1, 1, 1])
    shadow = noise.shadow_db * rng.normal(size=count)
    for k in range(1, count):
        rho = math.exp(-math.hypot(x[k] - x[k - 1], y[k] - y[k - 1]) / noise.decorrelation_m)
        shadow[k] = rho * shadow[k - 1] + math.sqrt(1.0 - rho * rho) * shadow[k]
    level = [expected_level(truth, *place, sigma_m, noise) for place in zip(x, y, strict=True)]
    level = np.round(np.array(level) + shadow + noise.white_db * rng.normal(size=count))
    return list(zip(x.tolist(), y.tolist(), [sigma_m] * count, level.tolist(), strict=True)), shadow


def released_state(mean, p, noise, reading):
    return shadow_ekf.release(shadow_ekf.hold(mean, noise, Places.of(reading[0], reading[1])), p)


def run(state, noise, readings):
    for reading in readings:
        state = shadow_ekf.step(state, noise, *reading).state
    return state
