"""The loops over readings, compiled to machine code at the first call and kept on disk for the next
start.

`shadow_ekf.step` is compiled as it stands. The reference filter and the smoother are written for
arrays.
"""

from collections.abc import Callable
from hashlib import sha256
from math import log10
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable

from logger.core import shadow_ekf
from logger.core.arrays import FloatArray, IntArray
from logger.core.shadow_ekf import ShadowNoise, ShadowState


def compiled(function: Callable[..., Any]) -> Any:
    """The function in machine code, kept on disk for the next start where a cache may be
    written.
    """
    try:
        return njit(cache=True)(function)
    except RuntimeError:  # no place where a cache may be written
        return njit(function)


def _reference(
    x: FloatArray,
    p: FloatArray,
    q: float,
    r_db2: float,
    readings: tuple[FloatArray, FloatArray, FloatArray],
    rows: IntArray,
    innovation: FloatArray,
    kept: tuple[FloatArray, FloatArray],
) -> None:
    x_m, y_m, level_dbm = readings
    h, m = np.ones(4), np.empty(4)
    row = 0
    for i in range(len(level_dbm)):
        for j in range(4):
            p[j, j] += q
        dx, dy = x[0] - x_m[i], x[1] - y_m[i]
        d2 = max(dx * dx + dy * dy, 1.0)
        slope = -_C * x[3] / d2
        h[0], h[1], h[3] = slope * dx, slope * dy, -5.0 * log10(d2)
        for j in range(4):
            m[j] = p[j, 0] * h[0] + p[j, 1] * h[1] + p[j, 2] + p[j, 3] * h[3]
        s = h[0] * m[0] + h[1] * m[1] + m[2] + h[3] * m[3] + r_db2
        e = level_dbm[i] - (x[2] + x[3] * h[3])
        for j in range(4):
            gain = m[j] / s
            x[j] += gain * e
            for k in range(j, 4):
                p[j, k] -= gain * m[k]
                p[k, j] = p[j, k]
        innovation[0, i], innovation[1, i] = e, s
        if rows[row] == i:
            for j in range(4):
                kept[0][row, j] = x[j]
                for k in range(4):
                    kept[1][row, j, k] = p[j, k]
            row += 1


def _shadow(source: str) -> Callable[..., ShadowState]:
    step, given_rest = register_jitable(shadow_ekf.step), register_jitable(_given_rest)
    for called in (shadow_ekf.recall, shadow_ekf.beyond_limit):
        register_jitable(called)

    def loop(
        state: ShadowState,
        noise: ShadowNoise,
        readings: tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray],
        rows: IntArray,
        innovation: FloatArray,
        kept: tuple[FloatArray, FloatArray],
        given: FloatArray,
    ) -> ShadowState:
        assert source  # numba's cache looks at what a function closes over, not at what it calls
        x_m, y_m, sigma_m, level_dbm, limit = readings
        start = state
        row = 0
        for i in range(len(level_dbm)):
            state, e, variance = step(
                state, noise, x_m[i], y_m[i], sigma_m[i], level_dbm[i], limit[i]
            )
            innovation[0, i], innovation[1, i] = e, variance
            given_rest(state, start, given[i])
            if rows[row] == i:
                kept[0][row, 0], kept[0][row, 1], kept[0][row, 2] = (
                    state.x_m,
                    state.y_m,
                    state.p0_dbm,
                )
                kept[0][row, 3], kept[0][row, 4] = state.eta, state.shadow_db
                for j in range(15):
                    kept[1][row, j] = state.factors[j]
                row += 1
        return state

    return loop


def _given_rest(state: ShadowState, start: ShadowState, given: FloatArray) -> None:
    """a, b and v of s = a + b' (rest - rest at the start) + N(0, v); b U_rest is the row of s in
    U.
    """
    variance, _, _, _, _, bx, by, b0, be, xy, x0, xe, y0, ye, oe = state.factors
    by -= bx * xy
    b0 -= bx * x0 + by * y0
    be -= bx * xe + by * ye + b0 * oe
    east, north = state.x_m - start.x_m, state.y_m - start.y_m
    explained = (
        bx * east + by * north + b0 * (state.p0_dbm - start.p0_dbm) + be * (state.eta - start.eta)
    )
    given[0], given[1], given[2] = state.shadow_db - explained, bx, by
    given[3], given[4], given[5] = b0, be, variance


def _smooth(
    given: FloatArray, rho: FloatArray, q_db2: FloatArray, rows: IntArray, kept: FloatArray
) -> None:
    last = len(given) - 1
    now = np.empty(6)
    for j in range(6):
        now[j] = given[last, j]
    row = len(rows) - 1
    for k in range(last, -1, -1):
        if k < last:
            variance = given[k, 5]
            ahead = rho[k] * rho[k] * variance + q_db2[k]
            gain = rho[k] * variance / ahead if ahead > 0.0 else 0.0
            own = 1.0 - gain * rho[k]
            for j in range(5):
                now[j] = own * given[k, j] + gain * now[j]
            now[5] = own * variance + gain * gain * now[5]
        if rows[row] == k:
            for j in range(6):
                kept[row, j] = now[j]
            row -= 1


_C = 10.0 / np.log(10.0)

reference = compiled(_reference)
"""`ekf.step` for each reading, bit for bit; overwrites state `x` (4,) and `p` (4, 4).

Fills `innovation` (2, n) with innovations and variances, `kept` with x (m, 4) and P (m, 4, 4) after
readings `rows`. """

shadow = compiled(_shadow(sha256(Path(shadow_ekf.__file__).read_bytes()).hexdigest()))
"""`shadow_ekf.step` for each reading; returns the last state.

Fills `innovation` (2, n), `kept` with [x, y, P0, eta, s] (m, 5) and factors (m, 15) after readings
`rows`, and `given` (n, 6): see `rts.smooth`. """

smooth = compiled(_smooth)
"""Fills `kept` (m, 6) with the smoothed rows of `given`; `rho` and `q_db2` (n - 1,) lead from each
row to the next.
"""
