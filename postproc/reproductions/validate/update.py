"""Gain, state and covariance after the checklist's reading: -100 dBm where -104.5 dBm was
expected.
"""

import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from postproc.reproductions.validate.check import Check, Effort, ours, promised, wrong
from postproc.reproductions.validate.model import EXPECTED_DBM, STATION, USER
from postproc.reproductions.validate.walk import SPEC, circle, heard

_HEARD_DBM = -100.0
_ROUNDING = 1e-9


def checks(_: Effort) -> list[Check]:
    """What one reading does, and what fifty do to the covariance."""
    step = ekf.step(STATION, *USER, _HEARD_DBM)
    moved = np.subtract(step.state[:4], STATION[:4])
    return [*_gain(moved / step.innovation_db), *_state(step, moved), *_covariance(step)]


def _gain(k: FloatArray) -> list[Check]:
    topic = "gain"
    return [
        Check(
            topic,
            "K of the position is far above 0 at first (P = 1000 I)",
            f"K_x = K_y = {k[0]:+.2e} m/dB: the slope of 0.065 dB/m is weighed against eta's 21.5 dB",
            promised(bool(k[0] > 0.1)),
        ),
        Check(topic, "K of P0 is above 0", f"{k[2]:+.2e} dB/dB", ours(bool(k[2] > 0.0))),
        Check(
            topic,
            "K of eta is above 0",
            f"{k[3]:+.4f} /dB: dh/deta = -10 log10(d) is negative beyond 1 m, so a level above the expected lowers eta",
            wrong(bool(k[3] < 0.0)),
        ),
    ]


def _state(step: ekf.EkfStep, moved: FloatArray) -> list[Check]:
    topic = "state update"
    toward_m = float(moved[:2] @ np.subtract(USER, STATION[:2])) / float(np.hypot(100.0, 100.0))
    right = abs(step.innovation_db - (_HEARD_DBM - EXPECTED_DBM)) < _ROUNDING
    return [
        Check(
            topic,
            "innovation +4.53 dB",
            f"{step.innovation_db:+.3f} dB (rounding as above)",
            ours(right),
        ),
        Check(
            topic,
            "a positive innovation moves the station towards the user",
            f"towards the user by {1000.0 * toward_m:.1f} mm of 141 m",
            ours(toward_m > 0.0),
        ),
        Check(
            topic,
            "eta might decrease slightly",
            f"by {-moved[3]:.2f}: nearly all of the innovation goes there (against the sign claimed for its gain)",
            ours(bool(moved[3] < 0.0)),
        ),
    ]


def _covariance(step: ekf.EkfStep) -> list[Check]:
    topic = "covariance"
    before = ekf.covariance_matrix(STATION.p) + ekf.Q_PER_STEP * np.eye(4)
    after = ekf.covariance_matrix(step.state.p)
    less = np.linalg.eigvalsh(before - after)
    joseph = ekf.covariance_matrix(ekf.joseph_step(STATION, *USER, _HEARD_DBM).state.p)
    apart = float(np.max(np.abs(joseph - after)))
    walked = _walked()
    least = min(
        float(np.min(np.linalg.eigvalsh(ekf.covariance_matrix(state.p)))) for state in walked
    )
    radii_m = [ekf.drms_m(state.p) for state in walked]
    rise_m = max(float(np.max(np.diff(radii_m))), 0.0)
    off_m = float(np.hypot(*np.subtract(walked[-1][:2], SPEC[:2])))
    return [
        Check(
            topic,
            "P decreases with an update",
            f"P_pred - P has no negative eigenvalue; trace {np.trace(before):.0f} -> {np.trace(after):.0f}",
            ours(bool(less[0] > -_ROUNDING * less[-1])),
        ),
        Check(
            topic,
            "the Joseph form for stability",
            "differs from the plain one by less than 1e-9"
            if apart < 1e-9
            else f"differs by {apart:.1e}",
            ours(apart < 1e-9),
        ),
        Check(
            topic,
            "P stays symmetric and positive",
            "one triangle is kept; 50 readings on the circle leave every eigenvalue above 0"
            if least > 0.0
            else f"least eigenvalue {least:.1e}",
            ours(least > 0.0),
        ),
        Check(
            topic,
            "the error radius sqrt(Pxx + Pyy) decreases",
            f"{radii_m[0]:.1f} -> {radii_m[-1]:.1f} m in 50 readings, never up by more than Q; error {off_m:.0f} m",
            ours(rise_m <= ekf.Q_PER_STEP),
        ),
    ]


def _walked() -> list[ekf.EkfState]:
    """The filter's states along the circle, without noise."""
    x_m, y_m = circle(50)
    states = [ekf.start(float(x_m[0]), float(y_m[0]))]
    for reading in zip(x_m.tolist(), y_m.tolist(), heard(SPEC, x_m, y_m).tolist(), strict=True):
        states.append(ekf.step(states[-1], *reading).state)
    return states
