"""What a walk shows of the distance without any model, pooled with the posterior.

Two observables say how far from the strongest reading a transmitter stands: over how wide a place
the levels within 10 dB of it are heard, and how far it rises above the median. On the measured
walks the log of the distance is normal about a line in them. The posterior does not know that: its
priors are of one walk at a time. Both are opinions on the same levels, so they are not multiplied
but pooled in the log density, with weights whose sum is one (Genest and Zidek, Statistical Science
1(1), 1986):

    log p(x) = w log p_posterior(x) + (1 - w) log q(x) + constant

Line and weight were chosen on 506 measured walks past 62 transmitters, each of 15 campaigns left
out in turn: the mean log density over campaigns rises by .19 nat, the areas fall by a tenth at the
same coverage (.97), past transmitters within 50 m by a quarter.
"""

from math import log
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.mixture import Mixture, log_sum
from logger.core.places import Places
from logger.core.readings import Readings

_POSTERIOR_WEIGHT = 0.8
"""w. With .9 half of the gain; with .7 campaigns whose levels say more lose up to .3 nat."""
_TOP_DB = 10.0
"""Levels so close to the strongest make up the place where the cell is strong."""
_UNSURE_DB = 1.0
"""A level is no surer than this. Else 0.01 dB decides which of two equal readings is the strongest,
and which are within 10 dB of it: of a measured walk that halved the region.
"""
_MOST_PLACES = 20
"""So many of the readings that are nearly as strong are enough."""
_LOG_M, _PER_LOG_SPREAD, _PER_DB, _SIGMA = 2.80, 0.68, -0.022, 0.94
"""The line, and the standard deviation of the log of the distance in metres about it."""
_LEAST_M = 10.0
"""Of the spread, and of the distance: the errors of the receiver's positions."""
_PART_OF_SIDE = 0.4
"""Least distance of a square, in sides: the mean distance within it from its centre."""


class Observables(NamedTuple):
    """The places of readings that may be the strongest, and the two observables.

    `weight` (k,): the probability of each of the `places`.
    """

    places: Places
    weight: FloatArray
    spread_m: float
    above_median_db: float

    def log_density(self, square: FloatArray) -> FloatArray:
        """Log density per square metre at squares (3, h), up to a constant."""
        away_m = self.places.distances_m(Places.of(*square[:2]))
        log_m = np.log(np.maximum(away_m, np.maximum(_LEAST_M, _PART_OF_SIDE * square[2])))
        middle = _LOG_M + _PER_LOG_SPREAD * log(self.spread_m) + _PER_DB * self.above_median_db
        of_places = -0.5 * ((log_m - middle) / _SIGMA) ** 2 - 2.0 * log_m
        return log_sum(of_places.T + np.log(self.weight))


def observables(obs: Readings) -> Observables:
    """Those of the readings."""
    level_dbm = obs.level_dbm
    below_db = np.max(level_dbm) - level_dbm
    strongest = np.argsort(below_db, kind="stable")[:_MOST_PLACES]
    weight = np.exp(-below_db[strongest] / _UNSURE_DB)
    is_top = 1.0 / (1.0 + np.exp((below_db - _TOP_DB) / _UNSURE_DB))
    xy_m = obs.places.xy_m
    from_middle_m = xy_m - np.average(xy_m, axis=1, weights=is_top)[:, None]
    spread_m = float(np.sqrt(np.sum(np.average(from_middle_m**2, axis=1, weights=is_top))))
    above_db = float(np.max(level_dbm) - np.median(level_dbm))
    places = obs.places.part(strongest)
    return Observables(places, weight / np.sum(weight), max(spread_m, _LEAST_M), above_db)


def pool(mixed: Mixture, square: FloatArray, seen: Observables) -> Mixture:
    """The mixture over squares (3, h) pooled with what the observables say."""
    p = mixed.probability
    log_area = 2.0 * np.log(square[2])
    with np.errstate(divide="ignore"):
        log_p = _POSTERIOR_WEIGHT * (np.log(p) - log_area)
    log_p += (1.0 - _POSTERIOR_WEIGHT) * seen.log_density(square) + log_area
    pooled = np.exp(log_p - np.max(log_p))
    ratio = pooled / np.sum(pooled) / np.where(p > 0.0, p, 1.0)
    return mixed._replace(share=mixed.share * ratio)
