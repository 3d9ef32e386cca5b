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
from logger.core.model.path_loss import distance_m, receiver_error_db2
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
    away_m = distance_m(distance_db)
    east = (points.x_m[:, None] - positions.x_m) / away_m
    north = (points.y_m[:, None] - positions.y_m) / away_m
    found, cosine, sine = [east, north], east, north
    for _ in range(1, orders):  # the next power of east + i north
        cosine, sine = cosine * east - sine * north, cosine * north + sine * east
        found += [cosine, sine]
    return found


def receiver_variance(blocks: Blocks, prior: Prior, distance_db: FloatArray) -> FloatArray | None:
    """Variance (n, h), in units of sigma^2, of the receiver's position error; None without one.

    An error sigma_g at distance d moves the level by about (10 / ln 10) eta sigma_g / d.
    """
    if not np.any(blocks.places.sigma_m):
        return None
    sigma_m = blocks.places.sigma_m[:, None] / prior.sigma_db
    return receiver_error_db2(prior.eta, sigma_m, distance_db)
