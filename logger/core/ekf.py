"""The reference EKF: one filter started at the receiver, as the original specification wants it.

It is kept because it is the reference, not because it works: started at the receiver it stays there
and says so with confidence (docs in ARCHITECTURE.md). Model, with d = |(x, y) - receiver| clamped
to 1 m, dx = x - receiver_x:

    z = P0 - 10 eta log10(d)
    H = [-10 eta dx / (ln10 d^2), -10 eta dy / (ln10 d^2), 1, -10 log10(d)]

Written out in plain floats: four states and a scalar measurement are far below the size where numpy
pays (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, ch. 5
and 10).
"""

from math import log, log10, sqrt
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray

P0_START_DBM = -40.0
ETA_START = 3.0
VARIANCE_START = 1000.0
Q_PER_STEP = 1e-5
R_DB2 = 9.0

_C = 10.0 / log(10.0)
_RANGE_CLAMP_M2 = 1.0

Covariance = tuple[float, float, float, float, float, float, float, float, float, float]
"""Upper triangle: xx, xy, x0, xe, yy, y0, ye, 00, 0e, ee."""


class EkfState(NamedTuple):
    """State [x (m), y (m), P0 (dBm), eta] and the upper triangle of its covariance."""

    x_m: float
    y_m: float
    p0_dbm: float
    eta: float
    p: Covariance


class EkfStep(NamedTuple):
    """A corrected state with the innovation (dB) and its variance (dB^2)."""

    state: EkfState
    innovation_db: float
    innovation_var_db2: float


def start(receiver_x_m: float, receiver_y_m: float) -> EkfState:
    """State before the first reading: at the receiver, P = 1000 I."""
    v = VARIANCE_START
    return EkfState(
        receiver_x_m,
        receiver_y_m,
        P0_START_DBM,
        ETA_START,
        (v, 0.0, 0.0, 0.0, v, 0.0, 0.0, v, 0.0, v),
    )


def jacobian(
    state: EkfState, receiver_x_m: float, receiver_y_m: float
) -> tuple[float, float, float, float]:
    """Row H of the measurement model at a state."""
    dx = state.x_m - receiver_x_m
    dy = state.y_m - receiver_y_m
    d2 = max(dx * dx + dy * dy, _RANGE_CLAMP_M2)
    slope = -_C * state.eta / d2
    return slope * dx, slope * dy, 1.0, -5.0 * log10(d2)


def step(
    state: EkfState,
    receiver_x_m: float,
    receiver_y_m: float,
    rssi_dbm: float,
    *,
    q: float = Q_PER_STEP,
    r_db2: float = R_DB2,
    joseph: bool = False,
) -> EkfStep:
    """Predict (P += q I, the transmitter stands still) and correct with one level.

    `joseph` takes P = (I - K H) P (I - K H)' + K r K' in place of P - K S K'; both are symmetric by
    construction, since only one triangle is computed or kept.
    """
    x, y, p0, eta, (xx, xy, x0, xe, yy, y0, ye, oo, oe, ee) = state
    xx += q
    yy += q
    oo += q
    ee += q
    dx = x - receiver_x_m
    dy = y - receiver_y_m
    d2 = dx * dx + dy * dy
    d2 = max(d2, _RANGE_CLAMP_M2)
    slope = -_C * eta / d2
    hx = slope * dx
    hy = slope * dy
    he = -5.0 * log10(d2)
    # P H'
    mx = xx * hx + xy * hy + x0 + xe * he
    my = xy * hx + yy * hy + y0 + ye * he
    m0 = x0 * hx + y0 * hy + oo + oe * he
    me = xe * hx + ye * hy + oe + ee * he
    s = hx * mx + hy * my + m0 + he * me + r_db2
    innovation = rssi_dbm - (p0 + eta * he)
    kx, ky, k0, ke = mx / s, my / s, m0 / s, me / s
    if joseph:
        predicted = (xx, xy, x0, xe, yy, y0, ye, oo, oe, ee)
        covariance = _joseph(predicted, (hx, hy, 1.0, he), (kx, ky, k0, ke), r_db2)
    else:
        covariance = (
            xx - kx * mx,
            xy - kx * my,
            x0 - kx * m0,
            xe - kx * me,
            yy - ky * my,
            y0 - ky * m0,
            ye - ky * me,
            oo - k0 * m0,
            oe - k0 * me,
            ee - ke * me,
        )
    corrected = EkfState(
        x + kx * innovation,
        y + ky * innovation,
        p0 + k0 * innovation,
        eta + ke * innovation,
        covariance,
    )
    return EkfStep(corrected, innovation, s)


_UPPER = np.triu_indices(4)


def covariance_matrix(p: Covariance) -> FloatArray:
    """Full symmetric matrix, shape (4, 4)."""
    matrix = np.zeros((4, 4))
    matrix[_UPPER] = p
    return matrix + np.triu(matrix, 1).T


def upper_triangle(matrix: FloatArray) -> Covariance:
    """Upper triangle of a (4, 4) covariance, symmetrised first."""
    xx, xy, x0, xe, yy, y0, ye, oo, oe, ee = (0.5 * (matrix + matrix.T))[_UPPER].tolist()
    return xx, xy, x0, xe, yy, y0, ye, oo, oe, ee


def drms_m(p: Covariance) -> float:
    """Distance root mean square sqrt(Pxx + Pyy): holds 63 to 68 % of the truths, not 95 %."""
    return sqrt(max(p[0] + p[4], 0.0))


def _joseph(
    p: Covariance,
    h: tuple[float, float, float, float],
    k: tuple[float, float, float, float],
    r_db2: float,
) -> Covariance:
    gain = np.array(k)
    a = np.eye(4) - np.outer(gain, h)
    return upper_triangle(a @ covariance_matrix(p) @ a.T + r_db2 * np.outer(gain, gain))
