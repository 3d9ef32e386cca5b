"""Loops over readings, in machine code where these are many and numba is installed.

The first argument of each loop is the number of its rows. The steps are `ekf.step` and
`shadow_ekf.step` themselves, so the device and the desk run the same filters.
"""

import sys
from collections.abc import Callable

from logger.core import ekf, shadow_ekf
from logger.core.arrays import FloatArray, IntArray
from logger.core.ekf import EkfState
from logger.core.model import path_loss
from logger.core.shadow_ekf import ShadowNoise, ShadowState
from postproc.estimators.machine_code import Loop


def _reference_loop(source: str) -> Callable[..., EkfState]:
    step = ekf.step

    def loop(
        state: EkfState,
        readings: tuple[FloatArray, FloatArray, FloatArray],
        rows: IntArray,
        innovation: FloatArray,
        states: FloatArray,
        triangles: FloatArray,
    ) -> EkfState:
        assert source
        x_m, y_m, level_dbm = readings
        row = 0
        for i in range(len(level_dbm)):
            state, innovation[0, i], innovation[1, i] = step(state, x_m[i], y_m[i], level_dbm[i])
            if rows[row] == i:
                states[row] = state.x_m, state.y_m, state.p0_dbm, state.eta
                triangles[row] = state.p
                row += 1
        return state

    return loop


def _shadow_loop(source: str) -> Callable[..., ShadowState]:
    step, shadowing_given_rest = shadow_ekf.step, _shadowing_given_rest

    def loop(
        state: ShadowState,
        noise: ShadowNoise,
        readings: tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray],
        rows: IntArray,
        innovation: FloatArray,
        states: FloatArray,
        factors: FloatArray,
        conditionals: FloatArray,
    ) -> ShadowState:
        assert source
        x_m, y_m, sigma_m, level_dbm, limit = readings
        start = state
        row = 0
        for i in range(len(level_dbm)):
            state, innovation[0, i], innovation[1, i] = step(
                state, noise, x_m[i], y_m[i], sigma_m[i], level_dbm[i], limit[i]
            )
            conditionals[i] = shadowing_given_rest(state, start)
            if rows[row] == i:
                states[row] = state.x_m, state.y_m, state.p0_dbm, state.eta, state.shadow_db
                factors[row] = state.factors
                row += 1
        return state

    return loop


def _shadowing_given_rest(state: ShadowState, start: ShadowState) -> tuple[float, ...]:
    """a, b and v of s = a + b' (rest - rest at the start) + N(0, v).

    b solves b U_rest = row s of U.
    """
    v, _, _, _, _, bx, by, b0, be, xy, x0, xe, y0, ye, oe = state.factors
    by -= bx * xy
    b0 -= bx * x0 + by * y0
    be -= bx * xe + by * ye + b0 * oe
    of_position = bx * (state.x_m - start.x_m) + by * (state.y_m - start.y_m)
    of_power = b0 * (state.p0_dbm - start.p0_dbm) + be * (state.eta - start.eta)
    return state.shadow_db - of_position - of_power, bx, by, b0, be, v


def _smooth(
    conditionals: FloatArray,
    rho: FloatArray,
    q_db2: FloatArray,
    rows: IntArray,
    smoothed: FloatArray,
) -> None:
    last = len(conditionals) - 1
    following = conditionals[last].copy()
    row = len(rows) - 1
    for k in range(last, -1, -1):
        if k < last:
            variance = conditionals[k, 5]
            predicted = rho[k] * rho[k] * variance + q_db2[k]
            gain = rho[k] * variance / predicted if predicted > 0.0 else 0.0
            rest = 1.0 - gain * rho[k]
            for j in range(5):
                following[j] = rest * conditionals[k, j] + gain * following[j]
            following[5] = rest * variance + gain * gain * following[5]
        if rows[row] == k:
            smoothed[row] = following
            row -= 1


_MODEL = path_loss, ("level_gradient",)
_EKF = ekf, ("jacobian", "step")
_SHADOW_EKF = (
    shadow_ekf,
    ("shadow_correlation", "_move", "_bierman", "_shift", "_beyond_limit", "step"),
)
_HERE = sys.modules[__name__], ("_shadowing_given_rest",)

reference = Loop(_reference_loop, _MODEL, _EKF)
"""`ekf.step` for each reading, bit for bit; returns the last state.

Fills `innovation` (2, n) with innovations and variances, and after the readings `rows` fills
`states` (m, 4) and `triangles` (m, 10) of the covariance. """

shadow = Loop(_shadow_loop, _MODEL, _SHADOW_EKF, _HERE)
"""`shadow_ekf.step` for each reading; returns the last state.

Fills `innovation` (2, n), after the readings `rows` `states` [x, y, P0, eta, s] (m, 5) and
`factors` (m, 15), and `conditionals` (n, 6): see `rts.smooth`. """

smooth = Loop(lambda _: _smooth)
"""Fills `smoothed` (m, 6) with rows of the smoothed `conditionals`.

`rho` and `q_db2` (n - 1,) lead from each row to the next. """
