"""Initial state, expected level and Jacobian; the example is the checklist's.

Station at (1000, 2000), user at (1100, 2100), P0 = -40 dBm, eta = 3.
"""

from math import log, log10

import numpy as np

from logger.core import ekf
from logger.core.model.path_loss import log_distance_db
from postproc.reproductions.validate.check import Check, Effort, ours, wrong

STATION, USER = ekf.start(1000.0, 2000.0), (1100.0, 2100.0)
EXPECTED_DBM = STATION.p0_dbm - STATION.eta * float(
    log_distance_db(np.array(-100.0), np.array(-100.0))
)
_STEP = 1e-4
_DERIVED = STATION._replace(p0_dbm=-45.0, eta=2.5)


def checks(_: Effort) -> list[Check]:
    """What the filter starts from, and what it expects of a reading."""
    return [*_initial(), *_level(), *_jacobian(), _sign(), _example()]


def _initial() -> list[Check]:
    start = ekf.start(*USER)
    p = ekf.covariance_matrix(start.p)
    right = start[:4] == (*USER, -40.0, 3.0)
    diagonal = np.array_equal(p, 1000.0 * np.eye(4))
    noise = (ekf.Q_PER_STEP, ekf.R_DB2) == (1e-5, 9.0)
    state = f"[{start.x_m:.0f}, {start.y_m:.0f}, {start.p0_dbm:.1f}, {start.eta:.1f}] for a user at {USER}"
    topic = "initial state"
    return [
        Check(topic, "x = [user_x, user_y, -40, 3]", state, ours(right)),
        Check(
            topic,
            "P = diag(1000, 1000, 1000, 1000)",
            f"diagonal {np.diag(p).tolist()}",
            ours(diagonal),
        ),
        Check(
            topic,
            "Q = 1e-5 I a step, R = 9",
            f"Q = {ekf.Q_PER_STEP:g} I, R = {ekf.R_DB2:g}",
            ours(noise),
        ),
    ]


def _level() -> list[Check]:
    off_db = abs(EXPECTED_DBM + 104.53)
    measured = f"{EXPECTED_DBM:.3f} dBm; -104.53 comes of log10(141.42) = 2.15051 rounded to 2.151"
    at_start = ekf.jacobian(ekf.start(*USER), *USER)
    return [
        Check("level", "expected level -104.53 dBm", measured, ours(off_db < 0.02)),
        Check(
            "level",
            "a distance of zero is handled",
            f"clamped at 1 m: H = [{', '.join(f'{h + 0.0:g}' for h in at_start)}] at the start: no slope to leave by",
            ours(at_start == (0.0, 0.0, 1.0, 0.0)),
        ),
    ]


def _jacobian() -> list[Check]:
    h = ekf.jacobian(STATION, *USER)
    numeric = differences(STATION)
    worst = float(np.max(np.abs(np.subtract(h, numeric))))
    claimed = (0.0652, 0.0652, 1.0, -21.51)
    close = float(np.max(np.abs(np.subtract(h, claimed)))) < 0.006
    text = ", ".join(f"{value:.4f}" for value in h[:2])
    return [
        Check(
            "Jacobian",
            "H = [0.0652, 0.0652, 1, -21.51]",
            f"[{text}, {h[2]:.0f}, {h[3]:.3f}]: right but for a slip, 30 / (ln10 x 20000) is 0.000651",
            ours(close),
        ),
        Check(
            "Jacobian",
            "H agrees with numerical differentiation (h = 0.0001)",
            "to 1e-8" if worst < 1e-8 else f"to {worst:.1e}",
            ours(worst < 1e-8),
        ),
    ]


def _sign() -> Check:
    d2 = 2.0 * 100.0**2
    equivalent = 10.0 * STATION.eta / (log(10.0) * d2) * (STATION.x_m - USER[0])
    slope = differences(STATION)[0]
    measured = (
        f"that gives {equivalent:.4f} where the slope is {slope:+.4f}: the sign was lost, dh/dx = "
        "-(10 eta)/(ln10 d^2) (x_fbs - x_user); a filter with it runs away from the station"
    )
    right = np.isclose(ekf.jacobian(STATION, *USER)[0], slope) and np.isclose(equivalent, -slope)
    claim = 'derivation: "or equivalently" dh/dx = (10 eta)/(ln10 d^2) (x_fbs - x_user)'
    return Check("Jacobian", claim, measured, wrong(bool(right)))


def _example() -> Check:
    h = ekf.jacobian(_DERIVED, *USER)
    level_dbm = _DERIVED.p0_dbm + _DERIVED.eta * h[3]
    right = abs(level_dbm + 98.75) < 0.02 and abs(h[0] - 0.0543) < 1e-4
    measured = f"{level_dbm:.2f} dBm, H_x = {h[0]:+.4f}: the example has the right sign, against the formula above it"
    return Check(
        "Jacobian",
        "derivation, example: -98.75 dBm, H_x = 0.0543 (P0 -45, eta 2.5)",
        measured,
        ours(right),
    )


def differences(state: ekf.EkfState) -> list[float]:
    """Slope of the expected level by central differences of the model written out here, length
    4.
    """

    def level_dbm(x_m: float, y_m: float, p0_dbm: float, eta: float) -> float:
        return p0_dbm - 5.0 * eta * log10((x_m - USER[0]) ** 2 + (y_m - USER[1]) ** 2)

    at = np.array(state[:4])
    return [
        (level_dbm(*(at + step).tolist()) - level_dbm(*(at - step).tolist())) / (2.0 * _STEP)
        for step in _STEP * np.eye(4)
    ]
