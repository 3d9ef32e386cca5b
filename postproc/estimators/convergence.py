"""Whether an estimator has ended with an answer that can be true.

A fit that runs away or a filter that diverges ends with numbers too: positions on the other side of
the Earth, a power of gigawatts, an indefinite covariance. They are never passed on.
"""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.places import Places
from logger.core.readings import Readings

REACH_M = 30_000.0
"""From the nearest reading: a GSM cell reaches at most 35 km, the locator searches this far."""
P0_RANGE_DBM = (-200.0, 100.0)
"""At 1 m, where free space leaves 25 to 35 dBm of the 65 dBm that the strongest base station
radiates; the lower end is a level that no modem can receive.
"""
MOST_ETA = 10.0
"""Measured exponents lie between 1.5 and 6, indoors included."""


_NO_RETURN = 2.0
"""A search with this many times the largest exponent has never come back: it goes on for ever."""


def ended_well(
    state: FloatArray, covariance: FloatArray, obs: Readings, *, any_slope: bool = False
) -> bool:
    """Whether `state` [x, y, P0, eta, ...] and its covariance are an answer to the readings.

    `any_slope` lets the exponent be negative too, as the specification's filter does.
    """
    is_finite = np.all(np.isfinite(state)) and np.all(np.isfinite(covariance))
    if not is_finite or np.any(np.diagonal(covariance) < 0.0):
        return False
    return is_possible(state, obs.places, any_slope=any_slope)


def is_possible(state: FloatArray, places: Places, *, any_slope: bool = False) -> bool:
    """Whether such a transmitter could be received at these places."""
    near = places.distances_m(Places.of(*state[:2])).min() < REACH_M
    power = P0_RANGE_DBM[0] <= state[2] <= P0_RANGE_DBM[1]
    slope = abs(state[3]) <= MOST_ETA and (any_slope or state[3] > 0.0)
    return bool(near and power and slope)


def is_lost(state: FloatArray) -> bool:
    """Whether a search that is at this state follows a flat valley to nowhere."""
    return bool(abs(state[3]) > _NO_RETURN * MOST_ETA)
