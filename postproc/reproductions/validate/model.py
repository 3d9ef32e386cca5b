"""Initial state, expected level and Jacobian: what the filter is before it reads anything."""

import numpy as np

from logger.core import ekf
from logger.core.model import path_loss
from logger.core.places import Places
from postproc.reproductions.validate.check import Check, Effort, Line, checks_of, ours, wrong

STATION, USER = ekf.start(Places.of(1000.0, 2000.0)), (1100.0, 2100.0)
_STEP = 1e-4  # the checklist's, for numerical differentiation
_DERIVED = STATION._replace(p0_dbm=-45.0, eta=2.5)  # the example of the derivation


def _level_dbm(x_m: float, y_m: float, p0_dbm: float, eta: float) -> float:
    distance_db = path_loss.log_distance_db(x_m - USER[0], y_m - USER[1])
    return float(path_loss.level_dbm(p0_dbm, eta, distance_db))


EXPECTED_DBM = _level_dbm(*STATION[:4])


def checks(_: Effort) -> list[Check]:
    """What the filter starts from, and what it expects of a reading."""
    return [
        *checks_of("initial state", *_initial()),
        *checks_of("level", *_level()),
        *checks_of("Jacobian", *_jacobian(), _sign(), _example()),
    ]


def _initial() -> list[Line]:
    start = ekf.start(Places.of(*USER))
    p = ekf.covariance_matrix(start.p)
    state = f"[{start.x_m:.0f}, {start.y_m:.0f}, {start.p0_dbm:.1f}, {start.eta:.1f}]"
    return [
        Line(
            "x = [user_x, user_y, -40, 3]",
            f"{state} for a user at {USER}",
            ours(start[:4] == (*USER, -40.0, 3.0)),
        ),
        Line(
            "P = diag(1000, 1000, 1000, 1000)",
            f"diagonal {np.diag(p).tolist()}",
            ours(np.array_equal(p, 1000.0 * np.eye(4))),
        ),
        Line(
            "Q = 1e-5 I a step, R = 9",
            f"Q = {ekf.Q_PER_STEP:g} I, R = {ekf.R_DB2:g}",
            ours((ekf.Q_PER_STEP, ekf.R_DB2) == (1e-5, 9.0)),
        ),
    ]


def _level() -> list[Line]:
    at_start = ekf.jacobian(ekf.start(Places.of(*USER)), *USER)
    row = ", ".join(f"{h + 0.0:g}" for h in at_start)
    return [
        Line(
            "expected level -104.53 dBm",
            f"{EXPECTED_DBM:.3f} dBm; "
            "-104.53 follows from log10(141.42) = 2.15051 rounded to 2.151",
            ours(abs(EXPECTED_DBM + 104.53) < 0.02),
        ),
        Line(
            "a distance of zero is handled",
            f"clamped at 1 m: H = [{row}] at the start, which has no slope for the position",
            ours(at_start == (0.0, 0.0, 1.0, 0.0)),
        ),
    ]


def _jacobian() -> list[Line]:
    h = ekf.jacobian(STATION, *USER)
    worst = float(np.max(np.abs(np.subtract(h, differences(STATION)))))
    claimed = (0.0652, 0.0652, 1.0, -21.51)
    close = float(np.max(np.abs(np.subtract(h, claimed)))) < 0.006
    return [
        Line(
            "H = [0.0652, 0.0652, 1, -21.51]",
            f"[{h[0]:.4f}, {h[1]:.4f}, {h[2]:.0f}, {h[3]:.3f}]: right but for a slip, "
            "30 / (ln10 x 20000) is 0.000651",
            ours(close),
        ),
        Line(
            "H agrees with numerical differentiation (h = 0.0001)",
            "to 1e-8" if worst < 1e-8 else f"to {worst:.1e}",
            ours(worst < 1e-8),
        ),
    ]


def _sign() -> Line:
    d2 = 2.0 * 100.0**2
    equivalent = path_loss.DB_PER_E_FOLD * STATION.eta / d2 * (STATION.x_m - USER[0])
    slope = differences(STATION)[0]
    right = np.isclose(ekf.jacobian(STATION, *USER)[0], slope) and np.isclose(equivalent, -slope)
    return Line(
        'derivation: "or equivalently" dh/dx = (10 eta)/(ln10 d^2) (x_fbs - x_user)',
        f"that gives {equivalent:.4f} where the slope is {slope:+.4f}: the sign was lost, dh/dx = "
        "-(10 eta)/(ln10 d^2) (x_fbs - x_user); a filter with it diverges from the station",
        wrong(bool(right)),
    )


def _example() -> Line:
    h = ekf.jacobian(_DERIVED, *USER)
    level_dbm = _level_dbm(*_DERIVED[:4])
    return Line(
        "derivation, example: -98.75 dBm, H_x = 0.0543 (P0 -45, eta 2.5)",
        f"{level_dbm:.2f} dBm, H_x = {h[0]:+.4f}: "
        "the example has the right sign, against the formula above it",
        ours(abs(level_dbm + 98.75) < 0.02 and abs(h[0] - 0.0543) < 1e-4),
    )


def differences(state: ekf.EkfState) -> list[float]:
    """Slope of the expected level by central differences, length 4."""
    centre = np.array(state[:4])
    return [
        (_level_dbm(*(centre + step)) - _level_dbm(*(centre - step))) / (2.0 * _STEP)
        for step in _STEP * np.eye(4)
    ]
