"""The readings of a cell against the model of its strongest place."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.model.path_loss import log_distance_db
from postproc.estimators import least_squares
from postproc.result import CellResult


@dataclass(frozen=True, slots=True)
class Fit:
    """Level and residual of each reading, shape (n,), by its distance from the strongest place of
    the posterior.

    `distance_m` is the model's, with the antenna's height and the receiver's error; the model is
    `p0_dbm - 10 eta lg distance_m`. `within` are the readings that are no end of the modem's scale; `residual_db` is
    level minus model, NaN for the others.
    """

    distance_m: FloatArray
    level_dbm: FloatArray
    residual_db: FloatArray
    within: BoolArray
    p0_dbm: float
    eta: float
    scatter_db: float

    def model_dbm(self, distance_m: FloatArray) -> FloatArray:
        """Level expected at distances, shape as given."""
        return np.asarray(self.p0_dbm - 10.0 * self.eta * np.log10(distance_m), float)


def fit_of(cell: CellResult) -> Fit | None:
    """The fit that the answer of a cell stands for; None where it has no place."""
    posterior, obs = cell.posterior, cell.obs
    if posterior is None or obs is None:
        return None
    obs = obs.usable()
    if posterior.offsets is not None:
        obs = obs.on_one_scale(posterior.offsets.mean_db)
    state, height_m = posterior.modes[0].state, posterior.prior.height_m
    within = np.asarray(obs.limit == 0, np.bool_)
    residual_db = np.where(within, -least_squares.residuals(state, obs, height_m), np.nan)
    dx_m, dy_m = state[0] - obs.x_m, state[1] - obs.y_m
    away_db = log_distance_db(dx_m, dy_m, height_m, obs.position_sigma_m)
    scatter_db = float(np.nanstd(residual_db)) if np.any(within) else float("nan")
    return Fit(
        10.0 ** (0.1 * away_db),
        obs.level_dbm,
        residual_db,
        within,
        float(state[2]),
        float(state[3]),
        scatter_db,
    )
