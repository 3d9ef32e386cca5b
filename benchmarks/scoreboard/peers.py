"""Least squares from many starts, and a disc about the strongest reading."""

from math import log

import numpy as np
from scipy.optimize import least_squares

from logger.core.arrays import FloatArray
from logger.core.locator.observables import observables
from logger.core.locator.region import LEVEL
from logger.core.model.path_loss import MIN_DISTANCE_M, log_distance_db

from . import ours
from .answer import Answer, Disc, gaussian
from .world import NOISE_OF_MEASURED_WALKS_DB, Place, Walk, World, observations

_C = 10.0 / log(10.0)
_GRID = 12
_STARTS = 40
_MARGIN_M = 250.0
_RADII_M = np.geomspace(1.0, 1e6, 2000)


def least_squares_fit(walk: Walk) -> Answer:
    """Best minimum over [x, y, P0, eta] from the best points of a grid.

    P0 and eta have weak priors. Levenberg-Marquardt with the analytic Jacobian; covariance
    (J'J)^-1 sigma^2, sigma from the residuals. The priors are weighted by the noise, so all
    minima are fitted again once it is known. Raises `ValueError` where there is no covariance.
    """
    states = [_fit(walk, start, NOISE_OF_MEASURED_WALKS_DB) for start in _starts(walk)]
    noise_db = min(_noise_db(state, walk) for state in states)
    states = [_fit(walk, state, noise_db) for state in states]
    state = min(states, key=lambda one: float(np.sum(_residuals(one, walk, noise_db) ** 2)))
    slope = _jacobian(state, walk, noise_db)
    return gaussian(
        state, np.asarray(_noise_db(state, walk) ** 2 * np.linalg.inv(slope.T @ slope), float)
    )


def _starts(walk: Walk) -> list[FloatArray]:
    """Of a grid over the walk and 250 m around, the states with the smallest misfit."""
    low, high = np.array([[f(walk.x_m), f(walk.y_m)] for f in (np.min, np.max)])
    margin_m = max(_MARGIN_M, 0.5 * float(np.max(high - low)))
    east, north = (np.linspace(low[i] - margin_m, high[i] + margin_m, _GRID) for i in (0, 1))
    grid = [_at((float(x), float(y)), walk) for x in east for y in north]
    return sorted(grid, key=lambda state: _noise_db(state, walk))[:_STARTS]


def _at(place: Place, walk: Walk) -> FloatArray:
    """State with the best P0 and eta of a place."""
    loss_db = log_distance_db(place[0] - walk.x_m, place[1] - walk.y_m)
    prior = ours.LINEAR_PRIOR
    weak = _weight_db(NOISE_OF_MEASURED_WALKS_DB)
    design = np.vstack([np.column_stack([np.ones_like(loss_db), -loss_db]), np.diag(weak)])
    theta = np.linalg.lstsq(
        design, np.concatenate([walk.level_dbm, weak * prior.mean]), rcond=None
    )[0]
    return np.array([*place, *theta])


def _weight_db(noise_db: float) -> FloatArray:
    """Weights of the priors of P0 and eta beside residuals of some noise, shape (2,)."""
    return noise_db * np.sqrt(ours.LINEAR_PRIOR.precision)


def _noise_db(state: FloatArray, walk: Walk) -> float:
    """Standard deviation of the residuals, four degrees of freedom taken off."""
    misfit = _misfit_db(state, walk)
    return float(np.sqrt(misfit @ misfit / max(len(walk) - 4, 1)))


def _fit(walk: Walk, start: FloatArray, noise_db: float) -> FloatArray:
    found = least_squares(
        _residuals,
        start,
        jac=_jacobian,
        method="lm",
        x_scale=(10.0, 10.0, 3.0, 0.3),
        max_nfev=300,
        args=(walk, noise_db),
    )
    return np.asarray(found.x, float)


def _misfit_db(state: FloatArray, walk: Walk) -> FloatArray:
    """Model less level, shape (n,)."""
    loss_db = log_distance_db(state[0] - walk.x_m, state[1] - walk.y_m)
    return np.asarray(state[2] - state[3] * loss_db - walk.level_dbm, float)


def _residuals(state: FloatArray, walk: Walk, noise_db: float) -> FloatArray:
    """Misfit, and the priors as two more rows; shape (n + 2,)."""
    return np.concatenate(
        [_misfit_db(state, walk), _weight_db(noise_db) * (state[2:] - ours.LINEAR_PRIOR.mean)]
    )


def _jacobian(state: FloatArray, walk: Walk, noise_db: float) -> FloatArray:
    east_m, north_m = state[0] - walk.x_m, state[1] - walk.y_m
    squared = east_m**2 + north_m**2
    slope = np.where(
        squared > MIN_DISTANCE_M**2, -_C * state[3] / np.maximum(squared, MIN_DISTANCE_M**2), 0.0
    )
    rows = np.column_stack(
        [slope * east_m, slope * north_m, np.ones(len(walk)), -log_distance_db(east_m, north_m)]
    )
    weak = np.zeros((2, 4))
    weak[[0, 1], [2, 3]] = _weight_db(noise_db)
    return np.vstack([rows, weak])


def disc_of_observables(world: World) -> Answer:
    """The strongest reading, and the disc about it that `observables` alone holds for 95 %."""
    seen = observables(observations(world, world.walk).usable())
    seen = seen._replace(places=seen.places[0], weight=np.ones(1))
    x_m, y_m = seen.places.xy_m[:, 0].tolist()
    squares = np.stack([x_m + _RADII_M, np.full(len(_RADII_M), y_m), np.zeros(len(_RADII_M))])
    share = np.cumsum(np.exp(seen.log_density(squares)) * _RADII_M * np.gradient(_RADII_M))
    radius_m = float(_RADII_M[np.searchsorted(share, LEVEL * share[-1])])
    return Answer(x_m, y_m, region=Disc((x_m, y_m), radius_m))
