"""Recursive methods: the reference EKF of this project, and EKF and UKF of filterpy.

The state is [x, y, P0, eta] of a static transmitter. The filters of filterpy know the true noise
and start at the receiver's first position with standard deviations of 200 m, 30 dB and 0.9.
"""

from collections.abc import Callable
from math import log

import numpy as np
from filterpy.kalman import (  # type: ignore[import-untyped]
    ExtendedKalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)

from logger.core import ekf as reference_ekf
from logger.core.arrays import FloatArray
from logger.core.model.path_loss import MIN_DISTANCE_M
from logger.core.places import Places

from . import ours
from .answer import Answer, gaussian
from .world import Walk, World

_C = 10.0 / log(10.0)
_START_SIGMA_M = 200.0


def reference(world: World) -> Answer:
    """The specification's EKF."""
    state = reference_ekf.start(Places.of(float(world.walk.x_m[0]), float(world.walk.y_m[0])))
    for reading in _readings(world.walk):
        state = reference_ekf.step(state, *reading).state
    return gaussian(np.array(state[:4]), reference_ekf.covariance_matrix(state.p))


def extended_kalman_filter(world: World) -> Answer:
    """EKF of filterpy."""
    ekf = ExtendedKalmanFilter(dim_x=4, dim_z=1)
    mean, ekf.P = _start(world.walk)
    ekf.x, ekf.Q, ekf.R = mean[:, None], np.zeros((4, 4)), np.array([[world.noise_db**2]])
    for x_m, y_m, level_dbm in _readings(world.walk):
        ekf.update(np.array([[level_dbm]]), _slope, _level, args=(x_m, y_m), hx_args=(x_m, y_m))
    return gaussian(ekf.x[:, 0], ekf.P)


def unscented_kalman_filter(world: World) -> Answer:
    """UKF of filterpy, sigma points of van der Merwe (alpha 0.1, beta 2, kappa -1)."""
    points = MerweScaledSigmaPoints(4, alpha=0.1, beta=2.0, kappa=-1.0)
    ukf = UnscentedKalmanFilter(4, 1, dt=1.0, hx=_level_of_points, fx=_stands_still, points=points)
    ukf.x, ukf.P = _start(world.walk)
    ukf.Q, ukf.R = np.zeros((4, 4)), np.array([[world.noise_db**2]])
    for x_m, y_m, level_dbm in _readings(world.walk):
        ukf.predict()
        ukf.update(np.array([level_dbm]), x_m=x_m, y_m=y_m)
    return gaussian(ukf.x, ukf.P)


def _start(walk: Walk) -> tuple[FloatArray, FloatArray]:
    prior = ours.LINEAR_PRIOR
    variance = np.concatenate([np.full(2, _START_SIGMA_M**2), 1.0 / prior.precision])
    return np.array([walk.x_m[0], walk.y_m[0], *prior.mean]), np.diag(variance)


def _readings(walk: Walk) -> list[tuple[float, float, float]]:
    return list(zip(walk.x_m.tolist(), walk.y_m.tolist(), walk.level_dbm.tolist(), strict=True))


def _stands_still(state: FloatArray, _: float) -> FloatArray:
    return state


def _squared_m2(state: FloatArray, x_m: float, y_m: float) -> float:
    return float(max((state[0] - x_m) ** 2 + (state[1] - y_m) ** 2, MIN_DISTANCE_M**2))


def _level_of_points(state: FloatArray, x_m: float, y_m: float) -> FloatArray:
    return np.array([state[2] - 5.0 * state[3] * np.log10(_squared_m2(state, x_m, y_m))])


def _level(state: FloatArray, x_m: float, y_m: float) -> FloatArray:
    return _level_of_points(state[:, 0], x_m, y_m)[:, None]


def _slope(state: FloatArray, x_m: float, y_m: float) -> FloatArray:
    x, y, _, eta = state[:, 0]
    squared = _squared_m2(state[:, 0], x_m, y_m)
    return np.array(
        [
            [
                -_C * eta * (x - x_m) / squared,
                -_C * eta * (y - y_m) / squared,
                1.0,
                -5.0 * np.log10(squared),
            ]
        ]
    )


FILTERS: dict[str, Callable[[World], Answer]] = {
    "reference EKF": reference,
    "filterpy EKF": extended_kalman_filter,
    "filterpy UKF": unscented_kalman_filter,
}
