"""Levels to expect at points not yet walked, under each position of a sample.

For position i, points q, and blocks p of the walk with levels z, with the covariance K of the noise
and A = K_qp K_pp^-1, which carries over what the shadowing at q is known from the walk:

    mu_i(q) = P0_i - eta_i L_i(q) + A (z - P0_i + eta_i L_i(p))
    N(q, q') = sigma^2 (K_qq' - A K_pq') + sum_i w_i G_i C_i G_i'
    G_i = [1, -L_i(q)] - A [1, -L_i(p)],    C_i = cov(P0, eta | i)

A street that has been walked is known from its readings, so walking it again says little.

What readings would say is a lower bound of the mutual information between position and levels, from
the Bhattacharyya coefficients of each pair of positions (Kolchinsky & Tracey, Entropy 19(7), 2017,
eq. 10 with alpha = 1/2):

    I >= -sum_i w_i log sum_j w_j exp(-|mu_i - mu_j|^2_N / 8)
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.guidance.sample import PositionSample
from logger.core.model.blocks import Blocks
from logger.core.model.noise import correlation, shadowing, whiteners
from logger.core.model.path_loss import level_dbm
from logger.core.model.prior import Prior
from logger.core.places import Places

STEP_M = 25.0
"""Distance of the points of a way: half a block, and about the shadowing's correlation."""
_READING_M = 4.5
"""A scan takes 3 to 4 s, in which one walks about this far."""
_LEAST_SHADOW_DB, _LEAST_SHADOW_M = 2.0, 20.0
"""Shadowing that is planned with even where the noise looks white, as on a short walk."""
_ROUNDING_DB2 = 0.05
"""Levels in whole decibels, a few to each point."""


class Forecast(NamedTuple):
    """Expected levels (i, m) under each position, their common covariance (m, m), the weights."""

    level_dbm: FloatArray
    covariance: FloatArray
    weight: FloatArray


class Forecaster:
    """Forecasts for one walk and one sample of positions."""

    def __init__(self, sample: PositionSample, walk: Blocks, prior: Prior) -> None:
        self._sample, self._walk, self._prior = sample, walk, prior
        whitener = whiteners(walk, prior, [sample.number])[0].matrix
        self._inverse = whitener.T @ whitener
        # an antenna at a position of the sample, heard by a walker as certain as this one
        self._places = replace(
            sample.places, sigma_m=np.full(len(sample.places), np.median(walk.places.sigma_m))
        )
        self._walk_db = self._log_distance_db(walk.places)
        expected_dbm = level_dbm(sample.p0_dbm[:, None], sample.eta[:, None], self._walk_db)
        self._residual_db = walk.level_dbm - expected_dbm

    def at(self, points: Places) -> Forecast:
        """Levels at points (m,)."""
        sample, walk = self._sample, self._walk
        noise = sample.noise
        # averaged over the points of a block, as in the covariance of the blocks
        between = walk.mean(shadowing(walk.points.distances_m(points), noise)).T
        known = between @ self._inverse
        apart_m = points.distances_m(points)
        covariance = shadowing(apart_m, noise) - known @ between.T
        covariance[np.diag_indices(len(points))] += noise.white_share * _READING_M / STEP_M
        covariance *= sample.sigma_db**2
        if noise.decorrelation_m == 0.0:
            covariance += _LEAST_SHADOW_DB**2 * correlation(apart_m, _LEAST_SHADOW_M)
        covariance[np.diag_indices(len(points))] += _ROUNDING_DB2
        away_db = self._log_distance_db(points)
        covariance += self._of_coefficients(known, away_db)
        level = level_dbm(sample.p0_dbm[:, None], sample.eta[:, None], away_db)
        return Forecast(level + self._residual_db @ known.T, covariance, sample.weight)

    def nearer_m(self, start: FloatArray, end: FloatArray) -> float:
        """How much nearer the transmitter is at `end` (2,) than at `start`, on average."""
        there_m = self._places.xy_m.T
        by_m = np.hypot(*(there_m - start).T) - np.hypot(*(there_m - end).T)
        return float(self._sample.weight @ by_m)

    def _of_coefficients(self, known: FloatArray, away_db: FloatArray) -> FloatArray:
        """What the uncertainty of P0 and eta adds, the same for all positions: (m, m)."""
        by_p0 = 1.0 - np.sum(known, axis=1)
        by_eta = self._walk_db @ known.T - away_db
        var_p0, cov, var_eta = self._sample.theta_cov * self._sample.weight
        cross = np.outer(by_p0, cov @ by_eta)
        of_p0 = float(np.sum(var_p0)) * np.outer(by_p0, by_p0)
        return np.asarray(of_p0 + cross + cross.T + (by_eta.T * var_eta) @ by_eta, float)

    def _log_distance_db(self, points: Places) -> FloatArray:
        return self._places.log_distance_to(points, self._prior.height_m)


def information_nats(forecast: Forecast, points: IntArray) -> float:
    """Information of readings at points of a forecast, in nats."""
    root = np.linalg.cholesky(forecast.covariance[np.ix_(points, points)])
    level_dbm = forecast.level_dbm[:, points]
    white = np.linalg.solve(root, (level_dbm - level_dbm[0]).T)
    squared = np.sum(white**2, axis=0)
    apart = np.maximum(squared[:, None] + squared - 2.0 * white.T @ white, 0.0)
    overlap = np.exp(-0.125 * apart) @ forecast.weight
    return float(-forecast.weight @ np.log(overlap))
