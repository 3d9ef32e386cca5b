"""A walk past a source, for fits of the log-distance model."""

import numpy as np

from logger.core.places import Places, Utm
from logger.core.readings import Readings

SOURCE = np.array([60.0, 90.0, -30.0, 3.0])


def walk(
    rng, *, noise_db=3.0, count=400, shadow_m=0.0, straight=False, source=SOURCE, height_m=0.0
):
    """An L-shaped or straight walk of 2 m steps; noise white or decorrelating over `shadow_m`."""
    s = 2.0 * np.arange(count)
    x = s - count if straight else np.minimum(s, count)
    y = 0.0 * s if straight else np.maximum(s - count, 0.0)
    noise = rng.normal(size=count)
    rho = np.exp(-2.0 / shadow_m) if shadow_m else 0.0
    for k in range(1, count):
        noise[k] = rho * noise[k - 1] + np.sqrt(1.0 - rho**2) * noise[k]
    distance = np.sqrt((x - source[0]) ** 2 + (y - source[1]) ** 2 + height_m**2)
    level = source[2] - 10.0 * source[3] * np.log10(distance) + noise_db * noise
    number = np.arange(count)
    return Readings(
        "c",
        None,
        Places.of(x, y, utm=Utm(32), sigma_m=np.zeros(count), t_ns=number * 10**9),
        level,
        number,
    )


def nees(fit, source=SOURCE):
    error = (fit.state - source)[:2]
    return float(error @ np.linalg.solve(fit.covariance[:2, :2], error))
