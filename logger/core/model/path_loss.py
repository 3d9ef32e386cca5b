"""The log-distance path-loss model, written once for arrays and once for plain floats.

    level = P0 - eta L,    L = 10 log10 d,    d^2 = dx^2 + dy^2 + height^2 + 2 sigma^2 >= 1 m^2

P0 is the level at 1 m, eta the exponent (Rappaport, Wireless Communications, 2nd ed., sec. 4.9).
The antenna is `height_m` above the receiver. The receiver's position has a standard deviation of
`sigma_m` per axis, so that the expected squared distance is larger by 2 sigma^2 than that from the
estimated position.
"""

from math import log, log10

import numpy as np

from logger.core.arrays import FloatArray

MIN_DISTANCE_M = 1.0
"""P0 is the level here; closer distances count as this one: L would go to minus infinity."""

DB_PER_E_FOLD = 10.0 / log(10.0)
"""Change of L where the distance grows by a factor of e: dL/dd = DB_PER_E_FOLD / d."""

_Metres = FloatArray | float


def log_distance_db(
    dx_m: _Metres, dy_m: _Metres, height_m: _Metres = 0.0, sigma_m: _Metres = 0.0
) -> FloatArray:
    """L = 10 log10 d in dB for horizontal offsets, shape of the broadcast arguments."""
    beyond_m2 = np.square(height_m) + 2.0 * np.square(sigma_m)
    return log_distances_db(np.asarray(np.square(dx_m) + np.square(dy_m) + beyond_m2, float))


def log_distances_db(squared_m2: FloatArray) -> FloatArray:
    """L of squared distances d^2, whose memory it takes."""
    np.maximum(squared_m2, MIN_DISTANCE_M**2, out=squared_m2)
    distance_db: FloatArray = np.log10(squared_m2, out=squared_m2)
    distance_db *= 5.0
    return distance_db


def distance_m(distance_db: FloatArray) -> FloatArray:
    """Distance d of a given L."""
    return np.asarray(np.exp(distance_db / DB_PER_E_FOLD), float)  # quicker than a power


def level_dbm(p0_dbm: _Metres, eta: _Metres, distance_db: _Metres) -> FloatArray:
    """Level P0 - eta L, shape of the broadcast arguments."""
    return np.asarray(p0_dbm - eta * distance_db, float)


def level_slopes(
    dx_m: FloatArray,
    dy_m: FloatArray,
    eta: float,
    height_m: _Metres = 0.0,
    sigma_m: _Metres = 0.0,
) -> FloatArray:
    """Derivatives of the level by x, y, P0 and eta, shape (n, 4), for offsets of shape (n,).

    Offsets lead from the receiver to the transmitter. Slopes by x and y are zero within 1 m.
    """
    distance_db = log_distance_db(dx_m, dy_m, height_m, sigma_m)
    by_position = position_slopes(dx_m, dy_m, eta, distance_db)
    return np.column_stack([by_position, np.ones_like(distance_db), -distance_db])


def position_slopes(
    dx_m: FloatArray, dy_m: FloatArray, eta: float, distance_db: FloatArray
) -> FloatArray:
    """Derivatives of the level by x and y, shape (n, 2), where the distance L (n,) is known."""
    slope = -DB_PER_E_FOLD * eta * 10.0 ** (-0.2 * distance_db)
    slope = np.where(distance_db > 0.0, slope, 0.0)
    return np.column_stack([slope * dx_m, slope * dy_m])


def receiver_error_db2(eta: float, sigma_m: FloatArray, distance_db: FloatArray) -> FloatArray:
    """Variance of the level by the receiver's position error, at a given L."""
    by_square_m2 = np.exp((-2.0 / DB_PER_E_FOLD) * distance_db)  # 1 / d^2: a power takes longer
    by_square_m2 *= np.square(DB_PER_E_FOLD * eta * sigma_m)
    return np.asarray(by_square_m2, float)


def log_distance(squared_m2: float) -> float:
    """L in dB for a squared distance d^2: plain floats, for the filters."""
    return 5.0 * log10(max(squared_m2, 1.0))


def level_gradient(
    dx_m: float, dy_m: float, eta: float, beyond_m2: float
) -> tuple[float, float, float, float]:
    """Derivatives of the level by x, y and eta, and its variance per m^2 of receiver error.

    Plain floats, for the filters. `beyond_m2` is height^2 + 2 sigma^2. The derivative by P0 is 1,
    that by eta is -L: the expected level is P0 + eta times the third value. The last value is
    (DB_PER_E_FOLD eta / d)^2.
    """
    squared_m2 = max(dx_m * dx_m + dy_m * dy_m + beyond_m2, 1.0)
    slope = -DB_PER_E_FOLD * eta / squared_m2
    return slope * dx_m, slope * dy_m, -5.0 * log10(squared_m2), slope * slope * squared_m2
