"""The readings of a cell against the model at its most likely position."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.model import path_loss
from logger.core.model.path_loss import log_distance_db
from postproc.estimators import least_squares
from postproc.result import CellResult


@dataclass(frozen=True, slots=True)
class Fit:
    """Level and residual of each reading (n,) by its distance from the most likely position.

    `distance_m` is the model's, with the antenna's height and the receiver's error; the model is
    `p0_dbm - 10 eta lg distance_m`. `uncensored` are the readings within the modem's scale;
    `residual_db` is level minus model, NaN for the others, and `sigma_db` its standard deviation.
    """

    distance_m: FloatArray
    level_dbm: FloatArray
    residual_db: FloatArray
    uncensored: BoolArray
    p0_dbm: float
    eta: float
    sigma_db: float

    def model_dbm(self, distance_m: FloatArray) -> FloatArray:
        """Level expected at distances, shape as given."""
        return path_loss.level_dbm(self.p0_dbm, self.eta, log_distance_db(distance_m, 0.0))


def fit_of(cell: CellResult) -> Fit | None:
    """The fit of a cell's answer; None where it has no position."""
    posterior, obs = cell.posterior, cell.obs
    if posterior is None or obs is None:
        return None
    obs = obs.usable()
    if posterior.offsets is not None:
        obs = obs.on_one_scale(posterior.offsets.mean_db)
    state, height_m = posterior.modes[0].state, posterior.prior.height_m
    x_m, y_m, p0_dbm, eta = state.tolist()
    uncensored = np.asarray(obs.limit == 0, np.bool_)
    residual_db = np.where(uncensored, -least_squares.residuals(state, obs, height_m), np.nan)
    sigma_db = float(np.nanstd(residual_db)) if np.any(uncensored) else float("nan")
    distance_db = log_distance_db(x_m - obs.x_m, y_m - obs.y_m, height_m, obs.position_sigma_m)
    distance_m = path_loss.distance_m(distance_db)
    return Fit(distance_m, obs.level_dbm, residual_db, uncensored, p0_dbm, eta, sigma_db)
