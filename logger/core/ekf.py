"""The reference EKF: the original specification's filter, started at the receiver.

It stays there with a small covariance (ARCHITECTURE.md, decision 5). The model is that of
`model.path_loss` without height and receiver error; H holds its derivatives by [x, y, P0, eta].

Four states and a scalar measurement are written out in plain floats, since arrays of this size are
slower (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, ch. 5
and 10).
"""

from math import sqrt
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.path_loss import level_gradient
from logger.core.places import Places

# all five values are the specification's
P0_START_DBM = -40.0
ETA_START = 3.0
VARIANCE_START = 1000.0
Q_PER_STEP = 1e-5
R_DB2 = 9.0

Covariance = tuple[float, float, float, float, float, float, float, float, float, float]
"""Upper triangle: xx, xy, x0, xe, yy, y0, ye, 00, 0e, ee."""


class EkfState(NamedTuple):
    """State [x (m), y (m), P0 (dBm), eta] and the upper triangle of its covariance."""

    x_m: float
    y_m: float
    p0_dbm: float
    eta: float
    p: Covariance


State = TypeVar("State")


class EkfStep(NamedTuple, Generic[State]):
    """A corrected state with the innovation (dB) and its variance (dB^2).

    Both are NaN for a reading at a limit or without a level.
    """

    state: State
    innovation_db: float
    innovation_var_db2: float


def start(place: Places) -> EkfState:
    """State before the first reading: at the receiver, P = 1000 I."""
    v = VARIANCE_START
    p = (v, 0.0, 0.0, 0.0, v, 0.0, 0.0, v, 0.0, v)
    return EkfState(place.x_m.item(), place.y_m.item(), P0_START_DBM, ETA_START, p)


def jacobian(
    state: EkfState, receiver_x_m: float, receiver_y_m: float
) -> tuple[float, float, float, float]:
    """Row H of the measurement model at a state."""
    dx, dy = state.x_m - receiver_x_m, state.y_m - receiver_y_m
    hx, hy, he, _ = level_gradient(dx, dy, state.eta, 0.0)
    return hx, hy, 1.0, he


def step(
    state: EkfState,
    receiver_x_m: float,
    receiver_y_m: float,
    level_dbm: float,
    q: float = Q_PER_STEP,
    r_db2: float = R_DB2,
) -> EkfStep[EkfState]:
    """Predict (P += q I, the transmitter stands still) and correct with one level.

    Only one triangle is computed, so P stays symmetric.
    """
    x, y, p0, eta, (xx, xy, x0, xe, yy, y0, ye, oo, oe, ee) = state
    hx, hy, _, he = jacobian(state, receiver_x_m, receiver_y_m)
    xx += q
    yy += q
    oo += q
    ee += q
    # m = P H'
    mx = xx * hx + xy * hy + x0 + xe * he
    my = xy * hx + yy * hy + y0 + ye * he
    m0 = x0 * hx + y0 * hy + oo + oe * he
    me = xe * hx + ye * hy + oe + ee * he
    s = hx * mx + hy * my + m0 + he * me + r_db2
    kx, ky, k0, ke = mx / s, my / s, m0 / s, me / s
    # P - K S K'
    covariance = (
        *(xx - kx * mx, xy - kx * my, x0 - kx * m0, xe - kx * me),
        *(yy - ky * my, y0 - ky * m0, ye - ky * me),
        *(oo - k0 * m0, oe - k0 * me),
        ee - ke * me,
    )
    e = level_dbm - (p0 + eta * he)
    return EkfStep(
        EkfState(x + kx * e, y + ky * e, p0 + k0 * e, eta + ke * e, covariance),
        e,
        s,
    )


def correct(
    state: EkfState, place: Places, level_dbm: float, *, joseph: bool = False
) -> EkfStep[EkfState]:
    """Predict and correct with a level at a place, by `joseph_step` or by `step`."""
    one_step = joseph_step if joseph else step
    return one_step(state, place.x_m.item(), place.y_m.item(), level_dbm)


def joseph_step(
    state: EkfState,
    receiver_x_m: float,
    receiver_y_m: float,
    level_dbm: float,
    q: float = Q_PER_STEP,
    r_db2: float = R_DB2,
) -> EkfStep[EkfState]:
    """The same step with P = (I - K H) P (I - K H)' + K r K', the Joseph form."""
    after = step(state, receiver_x_m, receiver_y_m, level_dbm, q, r_db2)
    h = np.array(jacobian(state, receiver_x_m, receiver_y_m))
    predicted = covariance_matrix(state.p) + q * np.eye(4)
    gain = predicted @ h / after.innovation_var_db2
    rest = np.eye(4) - np.outer(gain, h)
    p = rest @ predicted @ rest.T + r_db2 * np.outer(gain, gain)
    return after._replace(state=after.state._replace(p=upper_triangle(p)))


_ROW, _COLUMN = np.triu_indices(4)


def covariance_matrix(p: Covariance | FloatArray) -> FloatArray:
    """Full symmetric matrices (..., 4, 4) from upper triangles (..., 10)."""
    packed = np.asarray(p, float)
    matrix = np.empty((*packed.shape[:-1], 4, 4))
    matrix[..., _ROW, _COLUMN] = packed
    matrix[..., _COLUMN, _ROW] = packed
    return matrix


def upper_triangle(matrix: FloatArray) -> Covariance:
    """Upper triangle of a (4, 4) covariance, symmetrised first."""
    triangle: Covariance = tuple((0.5 * (matrix + matrix.T))[_ROW, _COLUMN].tolist())
    return triangle


def drms_m(p: Covariance) -> float:
    """Distance root mean square sqrt(Pxx + Pyy): 63 to 68 % of the truths lie within, not 95 %."""
    return sqrt(max(p[0] + p[4], 0.0))
