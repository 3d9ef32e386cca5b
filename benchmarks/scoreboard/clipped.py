"""The limit for censored levels: the posterior for known white noise and a known lower limit.

A level reported as the floor c was at most c + 1/2 before rounding: Phi((c + 1/2 - mu) / sigma)
(Tobin, Econometrica 26(1), 1958). Given the levels, P0 and eta are normal; the product of these
terms is integrated over them by Laplace's method, with Newton steps from the mean.
"""

import numpy as np
from scipy.special import log_ndtr

from logger.core.arrays import FloatArray
from logger.core.errors import EstimationError
from logger.core.model.path_loss import log_distance_db

from . import ours
from .likelihood import Likelihood, nearest_m
from .world import Noise, Walk

_HALF_STEP_DB = 0.5
_NEWTON_STEPS = 9


class ClippedLikelihood(Likelihood):
    """Likelihood of positions for a walk with levels at `floor_dbm`, for known white noise.

    Raises `EstimationError` without a level above the floor.
    """

    def __init__(self, walk: Walk, noise: Noise, floor_dbm: float) -> None:
        if noise.shadow_db:
            raise EstimationError("the limit of clipped levels is known for white noise only")
        uncensored = walk.level_dbm > floor_dbm
        super().__init__(
            Walk(walk.x_m[uncensored], walk.y_m[uncensored], walk.level_dbm[uncensored]), noise
        )
        self._every = walk
        self._reach_odds = ours.log_reach_odds(walk)
        self._censored = Walk(
            walk.x_m[~uncensored], walk.y_m[~uncensored], walk.level_dbm[~uncensored]
        )
        self._white_db = noise.white_db
        self._most_dbm = floor_dbm + _HALF_STEP_DB

    def _log_p(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        _, (a00, a01, a11), b, (m0, m1) = self.linear(x_m, y_m)
        distance_db = log_distance_db(
            x_m - self._censored.x_m[:, None], y_m - self._censored.y_m[:, None]
        )
        p0, eta, h00, h01, h11 = m0, m1, a00, a01, a11
        for _ in range(_NEWTON_STEPS):
            u = (self._most_dbm - p0 + eta * distance_db) / self._white_db
            mills = np.exp(-0.5 * u * u - log_ndtr(u)) / np.sqrt(2.0 * np.pi)
            pull, bend = -mills / self._white_db, mills * (mills + u) / self._white_db**2
            h00, h01 = a00 + np.sum(bend, axis=0), a01 - np.sum(bend * distance_db, axis=0)
            h11 = a11 + np.sum(bend * distance_db**2, axis=0)
            g0 = np.sum(pull, axis=0) - a00 * (p0 - m0) - a01 * (eta - m1)
            g1 = -np.sum(pull * distance_db, axis=0) - a01 * (p0 - m0) - a11 * (eta - m1)
            det = h00 * h11 - h01**2
            p0, eta = p0 + (h11 * g0 - h01 * g1) / det, eta + (h00 * g1 - h01 * g0) / det
        beyond = np.sum(
            log_ndtr((self._most_dbm - p0 + eta * distance_db) / self._white_db), axis=0
        )
        off0, off1 = p0 - m0, eta - m1
        away = 0.5 * (a00 * off0**2 + 2.0 * a01 * off0 * off1 + a11 * off1**2)
        log_p = 0.5 * np.sum(b * np.stack([m0, m1]), axis=0) + beyond - away
        log_p -= 0.5 * np.log(h00 * h11 - h01**2)
        return np.asarray(
            log_p + ours.log_position_prior(nearest_m(self._every, x_m, y_m), self._reach_odds),
            float,
        )
