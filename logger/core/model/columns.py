"""The linear columns of the model: what multiplies P0, eta and the harmonics of an antenna pattern.

Given a position, the level is linear in its unknown coefficients:

    z = P0 - eta L + a1 cos b + b1 sin b + a2 cos 2b + b2 sin 2b + ... + v

b is the azimuth under which the transmitter sees the receiver. The columns are 1, which is the same
for all positions, and -L, cos b, sin b, ..., which vary with the position. An omnidirectional
antenna has no harmonics. All coefficients have independent normal priors. Another kind of pattern
is another column here and its prior in `Prior.coefficients`.
"""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.blocks import Blocks, Censored
from logger.core.model.path_loss import distance_m, receiver_error_db
from logger.core.model.prior import Prior
from logger.core.places import Places


def varying_columns(blocks: Blocks, prior: Prior, positions: Places) -> list[FloatArray]:
    """Columns that vary with the position (h,): means over the points of each block, (n, h) each.

    The first is -L, then follow cosine and sine of each harmonic of the antenna pattern.
    """
    columns = _of_points(blocks.points, prior, positions)
    return [blocks.mean(column) for column in columns]


def distances_db(blocks: Blocks, height_m: float, positions: Places) -> FloatArray:
    """L = 10 log10 d of each block from each position (h,), means over its points, shape (n, h)."""
    return blocks.mean(blocks.points.log_distance_to(positions, height_m))


def censored_columns(censored: Censored, prior: Prior, positions: Places) -> list[FloatArray]:
    """The same for censored readings, (g, h) each."""
    return _of_points(censored.places, prior, positions)


def _of_points(points: Places, prior: Prior, positions: Places) -> list[FloatArray]:
    distance_db = points.log_distance_to(positions, prior.height_m)
    columns = [-distance_db]
    if prior.antenna_db:
        columns += _harmonics(points, positions, distance_db, len(prior.antenna_db))
    return columns


def _harmonics(
    points: Places, positions: Places, distance_db: FloatArray, orders: int
) -> list[FloatArray]:
    """Cos kb and sin kb for k = 1 to `orders`, fading to zero right below the antenna."""
    dx_m = points.x_m[:, None] - positions.x_m
    dy_m = points.y_m[:, None] - positions.y_m
    direction = (dx_m + 1j * dy_m) / distance_m(distance_db)
    powers = [direction**k for k in range(1, orders + 1)]
    return [part for power in powers for part in (power.real, power.imag)]


def receiver_variance(blocks: Blocks, prior: Prior, distance_db: FloatArray) -> FloatArray | None:
    """Variance (n, h), in units of sigma^2, of the receiver's position error; None without one.

    An error sigma_g at distance d moves the level by about (10 / ln 10) eta sigma_g / d.
    """
    if not np.any(blocks.places.sigma_m):
        return None
    error_db = receiver_error_db(prior.eta, blocks.places.sigma_m[:, None], distance_db)
    return np.asarray((error_db / prior.sigma_db) ** 2, float)
