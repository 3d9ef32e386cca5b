"""Gain, state and covariance after the checklist's reading: -100 dBm, expected -104.5 dBm."""

import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.places import Places
from postproc.reproductions.validate.check import (
    Check,
    Effort,
    Line,
    checks_of,
    ours,
    theirs,
    wrong,
)
from postproc.reproductions.validate.model import EXPECTED_DBM, STATION, USER
from postproc.reproductions.validate.walk import SPEC, circle, true_level_dbm

_LEVEL_DBM = -100.0
_ROUNDING = 1e-9


def checks(_: Effort) -> list[Check]:
    """What one reading does, and what fifty do to the covariance."""
    step = ekf.step(STATION, *USER, _LEVEL_DBM)
    shift = np.subtract(step.state[:4], STATION[:4])
    return [
        *checks_of("gain", *_gain(shift / step.innovation_db)),
        *checks_of("state update", *_state(step, shift)),
        *checks_of("covariance", *_one_update(step), *_fifty_updates()),
    ]


def _gain(k: FloatArray) -> list[Line]:
    return [
        Line(
            "K of the position is far above 0 at first (P = 1000 I)",
            f"K_x = K_y = {k[0]:+.2e} m/dB: "
            "the slope of 0.065 dB/m is weighed against eta's 21.5 dB",
            theirs(bool(k[0] > 0.1)),
        ),
        Line("K of P0 is above 0", f"{k[2]:+.2e} dB/dB", ours(bool(k[2] > 0.0))),
        Line(
            "K of eta is above 0",
            f"{k[3]:+.4f} /dB: dh/deta = -10 log10(d) is negative beyond 1 m, "
            "so a level above the expected lowers eta",
            wrong(bool(k[3] < 0.0)),
        ),
    ]


def _state(step: ekf.EkfStep, shift: FloatArray) -> list[Line]:
    towards_user = np.subtract(USER, STATION[:2])
    towards_m = float(shift[:2] @ towards_user) / float(np.hypot(*towards_user))
    right = abs(step.innovation_db - (_LEVEL_DBM - EXPECTED_DBM)) < _ROUNDING
    return [
        Line(
            "innovation +4.53 dB", f"{step.innovation_db:+.3f} dB (rounding as above)", ours(right)
        ),
        Line(
            "a positive innovation moves the station towards the user",
            f"towards the user by {1000.0 * towards_m:.1f} mm of 141 m",
            ours(towards_m > 0.0),
        ),
        Line(
            "eta might decrease slightly",
            f"by {-shift[3]:.2f}: nearly all of the innovation goes there "
            "(against the sign claimed for its gain)",
            ours(bool(shift[3] < 0.0)),
        ),
    ]


def _one_update(step: ekf.EkfStep) -> list[Line]:
    before = ekf.covariance_matrix(STATION.p) + ekf.Q_PER_STEP * np.eye(4)
    after = ekf.covariance_matrix(step.state.p)
    decrease = np.linalg.eigvalsh(before - after)
    joseph = ekf.covariance_matrix(ekf.joseph_step(STATION, *USER, _LEVEL_DBM).state.p)
    apart = float(np.max(np.abs(joseph - after)))
    difference = "differs from the plain one by less than 1e-9"
    if apart >= _ROUNDING:
        difference = f"differs by {apart:.1e}"
    return [
        Line(
            "P decreases with an update",
            "P_pred - P has no negative eigenvalue; "
            f"trace {np.trace(before):.0f} -> {np.trace(after):.0f}",
            ours(bool(decrease[0] > -_ROUNDING * decrease[-1])),
        ),
        Line("the Joseph form for stability", difference, ours(apart < _ROUNDING)),
    ]


def _fifty_updates() -> list[Line]:
    path = _noiseless_path()
    covariances = np.array([ekf.covariance_matrix(state.p) for state in path])
    least = float(np.min(np.linalg.eigvalsh(covariances)))
    radii_m = [ekf.drms_m(state.p) for state in path]
    rise_m = float(np.max(np.diff(radii_m)))
    error_m = float(np.hypot(*np.subtract(path[-1][:2], SPEC[:2])))
    positive = (
        "only one triangle is stored; 50 readings on the circle leave every eigenvalue above 0"
    )
    return [
        Line(
            "P stays symmetric and positive",
            positive if least > 0.0 else f"least eigenvalue {least:.1e}",
            ours(least > 0.0),
        ),
        Line(
            "the error radius sqrt(Pxx + Pyy) decreases",
            f"{radii_m[0]:.1f} -> {radii_m[-1]:.1f} m in 50 readings, never up by more than Q; "
            f"error {error_m:.0f} m",
            ours(rise_m <= ekf.Q_PER_STEP),
        ),
    ]


def _noiseless_path() -> list[ekf.EkfState]:
    """The filter's states along the circle, without noise."""
    x_m, y_m = circle(50)
    states = [ekf.start(Places.of(x_m[0], y_m[0]))]
    levels_dbm = true_level_dbm(SPEC, x_m, y_m).tolist()
    for reading in zip(x_m.tolist(), y_m.tolist(), levels_dbm, strict=True):
        states.append(ekf.step(states[-1], *reading).state)
    return states
