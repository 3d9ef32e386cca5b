"""The specification, checked: each item of its checklist as an executed check with its figure.

What takes a walk is in `specification_walks`. The claims are those of "EKF Implementation
Validation" and "Mathematical Derivations" of github.com/shinnosuke1023/cell-finder
(android/ekf_validation.md, MATHEMATICAL_DERIVATIONS.md).
"""

import sys
import tracemalloc
from collections.abc import Callable
from math import hypot
from statistics import median
from time import thread_time
from typing import NamedTuple

import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.errors import GeoError
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.model import path_loss
from logger.core.places import Places, Utm, zone_of
from postproc.reproductions.checks import Check, ours, theirs, under, wrong
from postproc.reproductions.specification_walks import (
    SPEC,
    Effort,
    Station,
    circle,
    convergence_checks,
    noisy_level_dbm,
    records,
    scenario_checks,
    true_level_dbm,
)

_UTM_ROUNDING_M = 0.06  # of the true coordinates, which have one decimal
_EXACT_DEG = 1e-9  # 0.1 mm


class Example(NamedTuple):
    """Claimed and true UTM coordinates; the true ones by PROJ's Transverse Mercator, to 0.1 m."""

    name: str
    lat_deg: float
    lon_deg: float
    zone: int
    claimed_m: tuple[float, float]
    true_m: tuple[float, float]


EXAMPLES = (
    Example("Tokyo Station", 35.6812, 139.7671, 54, (387773.0, 3950374.0), (388433.4, 3949290.0)),
    Example(
        "Sydney Opera House", -33.8568, 151.2153, -56, (334873.0, 6252264.0), (334900.6, 6252288.8)
    ),
)


def _utm_checks(_: Effort) -> list[Check]:
    examples = [line for example in EXAMPLES for line in _place_example(example)]
    return under("UTM", *examples, _edge(), _poles())


def _place_example(example: Example) -> list[Check]:
    name, claimed_m = example.name, example.claimed_m
    zone = zone_of(example.lat_deg, example.lon_deg)
    utm = Utm(zone)
    x_m, y_m = utm.to_xy(example.lat_deg, example.lon_deg)
    error_m = max(abs(x_m - example.true_m[0]), abs(y_m - example.true_m[1]))
    off_m = hypot(x_m - claimed_m[0], y_m - claimed_m[1])
    lat_deg, lon_deg = utm.to_latlon(x_m, y_m)
    back_deg = max(abs(lat_deg - example.lat_deg), abs(lon_deg - example.lon_deg))
    agrees = back_deg < _EXACT_DEG
    return [
        Check(
            f"{name} is in zone {_zone(example.zone)}",
            f"zone {_zone(zone)}",
            ours(zone == example.zone),
        ),
        Check(
            f"{name} is at about ({claimed_m[0]:.0f}, {claimed_m[1]:.0f})",
            f"{x_m:.1f} E, {y_m:.1f} N: the claim is {_distance(off_m)} off",
            wrong(error_m < _UTM_ROUNDING_M),
        ),
        Check(
            f"{name}: forward and inverse agree",
            "to 1e-9 deg (0.1 mm)" if agrees else f"to {back_deg:.1e} deg",
            ours(agrees),
        ),
    ]


def _zone(zone: int) -> str:
    return f"{abs(zone)}{'N' if zone > 0 else 'S'}"


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:.2f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _edge() -> Check:
    west, east = (Utm(54).to_xy(35.0, 144.0 + side)[0] for side in (-_EXACT_DEG, _EXACT_DEG))
    step_m = abs(east - west)
    measured = "the zone of the first fix is kept: no step"
    if step_m >= 1e-3:
        measured = f"a step of {step_m:.3f} m"
    return Check("a walk across the edge of a zone is continuous", measured, ours(step_m < 1e-3))


def _poles() -> Check:
    claim = "edge cases (poles) are handled"
    try:
        zone_of(89.0, 0.0)
    except GeoError:
        return Check(claim, "refused beyond 84 deg, where UTM ends", theirs(True))
    return Check(claim, "89 deg was given a zone", "fails")


_STATION, _USER = ekf.start(Places.of(1000.0, 2000.0)), (1100.0, 2100.0)
_STEP = 1e-4  # the checklist's, for numerical differentiation
_DERIVED = _STATION._replace(p0_dbm=-45.0, eta=2.5)  # the example of the derivation


def _level_dbm(x_m: float, y_m: float, p0_dbm: float, eta: float) -> float:
    distance_db = path_loss.log_distance_db(x_m - _USER[0], y_m - _USER[1])
    return float(path_loss.level_dbm(p0_dbm, eta, distance_db))


_EXPECTED_DBM = _level_dbm(*_STATION[:4])


def _model_checks(_: Effort) -> list[Check]:
    return [
        *under("initial state", *_initial()),
        *under("level", *_level()),
        *under("Jacobian", *_jacobian(), _sign(), _example()),
    ]


def _initial() -> list[Check]:
    start = ekf.start(Places.of(*_USER))
    p = ekf.covariance_matrix(start.p)
    state = f"[{start.x_m:.0f}, {start.y_m:.0f}, {start.p0_dbm:.1f}, {start.eta:.1f}]"
    return [
        Check(
            "x = [user_x, user_y, -40, 3]",
            f"{state} for a user at {_USER}",
            ours(start[:4] == (*_USER, -40.0, 3.0)),
        ),
        Check(
            "P = diag(1000, 1000, 1000, 1000)",
            f"diagonal {np.diag(p).tolist()}",
            ours(np.array_equal(p, 1000.0 * np.eye(4))),
        ),
        Check(
            "Q = 1e-5 I a step, R = 9",
            f"Q = {ekf.Q_PER_STEP:g} I, R = {ekf.R_DB2:g}",
            ours((ekf.Q_PER_STEP, ekf.R_DB2) == (1e-5, 9.0)),
        ),
    ]


def _level() -> list[Check]:
    at_start = ekf.jacobian(ekf.start(Places.of(*_USER)), *_USER)
    row = ", ".join(f"{h + 0.0:g}" for h in at_start)
    return [
        Check(
            "expected level -104.53 dBm",
            f"{_EXPECTED_DBM:.3f} dBm; "
            "-104.53 follows from log10(141.42) = 2.15051 rounded to 2.151",
            ours(abs(_EXPECTED_DBM + 104.53) < 0.02),
        ),
        Check(
            "a distance of zero is handled",
            f"clamped at 1 m: H = [{row}] at the start, which has no slope for the position",
            ours(at_start == (0.0, 0.0, 1.0, 0.0)),
        ),
    ]


def _jacobian() -> list[Check]:
    h = ekf.jacobian(_STATION, *_USER)
    worst = float(np.max(np.abs(np.subtract(h, differences(_STATION)))))
    claimed = (0.0652, 0.0652, 1.0, -21.51)
    close = float(np.max(np.abs(np.subtract(h, claimed)))) < 0.006
    return [
        Check(
            "H = [0.0652, 0.0652, 1, -21.51]",
            f"[{h[0]:.4f}, {h[1]:.4f}, {h[2]:.0f}, {h[3]:.3f}]: right but for a slip, "
            "30 / (ln10 x 20000) is 0.000651",
            ours(close),
        ),
        Check(
            "H agrees with numerical differentiation (h = 0.0001)",
            "to 1e-8" if worst < 1e-8 else f"to {worst:.1e}",
            ours(worst < 1e-8),
        ),
    ]


def _sign() -> Check:
    d2 = 2.0 * 100.0**2
    equivalent = path_loss.DB_PER_E_FOLD * _STATION.eta / d2 * (_STATION.x_m - _USER[0])
    slope = differences(_STATION)[0]
    right = np.isclose(ekf.jacobian(_STATION, *_USER)[0], slope) and np.isclose(equivalent, -slope)
    return Check(
        'derivation: "or equivalently" dh/dx = (10 eta)/(ln10 d^2) (x_fbs - x_user)',
        f"that gives {equivalent:.4f} where the slope is {slope:+.4f}: the sign was lost, dh/dx = "
        "-(10 eta)/(ln10 d^2) (x_fbs - x_user); a filter with it diverges from the station",
        wrong(bool(right)),
    )


def _example() -> Check:
    h = ekf.jacobian(_DERIVED, *_USER)
    level_dbm = _level_dbm(*_DERIVED[:4])
    return Check(
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


_LEVEL_DBM = -100.0
_ROUNDING = 1e-9


def _update_checks(_: Effort) -> list[Check]:
    step = ekf.step(_STATION, *_USER, _LEVEL_DBM)
    shift = np.subtract(step.state[:4], _STATION[:4])
    return [
        *under("gain", *_gain(shift / step.innovation_db)),
        *under("state update", *_state(step, shift)),
        *under("covariance", *_one_update(step), *_fifty_updates()),
    ]


def _gain(k: FloatArray) -> list[Check]:
    return [
        Check(
            "K of the position is far above 0 at first (P = 1000 I)",
            f"K_x = K_y = {k[0]:+.2e} m/dB: "
            "the slope of 0.065 dB/m is weighed against eta's 21.5 dB",
            theirs(bool(k[0] > 0.1)),
        ),
        Check("K of P0 is above 0", f"{k[2]:+.2e} dB/dB", ours(bool(k[2] > 0.0))),
        Check(
            "K of eta is above 0",
            f"{k[3]:+.4f} /dB: dh/deta = -10 log10(d) is negative beyond 1 m, "
            "so a level above the expected lowers eta",
            wrong(bool(k[3] < 0.0)),
        ),
    ]


def _state(step: ekf.EkfStep[ekf.EkfState], shift: FloatArray) -> list[Check]:
    towards_user = np.subtract(_USER, _STATION[:2])
    towards_m = float(shift[:2] @ towards_user) / float(np.hypot(*towards_user))
    right = abs(step.innovation_db - (_LEVEL_DBM - _EXPECTED_DBM)) < _ROUNDING
    return [
        Check(
            "innovation +4.53 dB", f"{step.innovation_db:+.3f} dB (rounding as above)", ours(right)
        ),
        Check(
            "a positive innovation moves the station towards the user",
            f"towards the user by {1000.0 * towards_m:.1f} mm of 141 m",
            ours(towards_m > 0.0),
        ),
        Check(
            "eta might decrease slightly",
            f"by {-shift[3]:.2f}: nearly all of the innovation goes there "
            "(against the sign claimed for its gain)",
            ours(bool(shift[3] < 0.0)),
        ),
    ]


def _one_update(step: ekf.EkfStep[ekf.EkfState]) -> list[Check]:
    before = ekf.covariance_matrix(_STATION.p) + ekf.Q_PER_STEP * np.eye(4)
    after = ekf.covariance_matrix(step.state.p)
    decrease = np.linalg.eigvalsh(before - after)
    joseph = ekf.covariance_matrix(ekf.joseph_step(_STATION, *_USER, _LEVEL_DBM).state.p)
    apart = float(np.max(np.abs(joseph - after)))
    difference = "differs from the plain one by less than 1e-9"
    if apart >= _ROUNDING:
        difference = f"differs by {apart:.1e}"
    return [
        Check(
            "P decreases with an update",
            "P_pred - P has no negative eigenvalue; "
            f"trace {np.trace(before):.0f} -> {np.trace(after):.0f}",
            ours(bool(decrease[0] > -_ROUNDING * decrease[-1])),
        ),
        Check("the Joseph form for stability", difference, ours(apart < _ROUNDING)),
    ]


def _fifty_updates() -> list[Check]:
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
        Check(
            "P stays symmetric and positive",
            positive if least > 0.0 else f"least eigenvalue {least:.1e}",
            ours(least > 0.0),
        ),
        Check(
            "the error radius sqrt(Pxx + Pyy) decreases",
            f"{radii_m[0]:.1f} -> {radii_m[-1]:.1f} m in 50 readings, never up by more than Q; "
            f"error {error_m:.0f} m",
            ours(rise_m <= ekf.Q_PER_STEP),
        ),
    ]


def _noiseless_path() -> list[ekf.EkfState]:
    at = circle(50)
    states, levels_dbm = [ekf.start(at[0])], true_level_dbm(SPEC, at).tolist()
    for reading in zip(at.x_m.tolist(), at.y_m.tolist(), levels_dbm, strict=True):
        states.append(ekf.step(states[-1], *reading).state)
    return states


MOST_BYTES, MOST_STEP_MS, MOST_CYCLE_MS = 5_000, 1.0, 20.0  # the checklist's
_CELLS = 7  # a modem reports at most six neighbours
_STEP_M = 2.8


def _cost_checks(effort: Effort) -> list[Check]:
    state_bytes = _bytes(ekf.start(Places.of(0.0, 0.0)))
    step_ms, cycles_ms = _step_ms(50 * effort.timed), _cycles_ms(effort.timed)
    return under(
        "cost",
        Check(
            "an EKF takes less than 5 KB",
            f"{state_bytes} bytes as Python objects (14 doubles are 112); "
            f"our locator of a cell, which is no EKF, {_locator_mb():.1f} MB",
            theirs(state_bytes < MOST_BYTES),
        ),
        Check(
            "matrix operations take 1 ms a step",
            f"{1000.0 * step_ms:.1f} us",
            theirs(step_ms < MOST_STEP_MS),
        ),
        Check(
            "a cycle takes less than 20 ms",
            f"median {median(cycles_ms):.1f} ms for a fix and a scan of {_CELLS} cells, each with "
            f"its own locator; the longest of {len(cycles_ms)} {max(cycles_ms):.0f} ms, with a "
            "search of the positions",
            theirs(median(cycles_ms) < MOST_CYCLE_MS),
        ),
    )


def _bytes(value: object) -> int:
    """Size of a tuple with all that is in it."""
    parts = value if isinstance(value, tuple) else ()
    return sys.getsizeof(value) + sum(_bytes(part) for part in parts)


def _locator_mb() -> float:
    """Memory of one cell's locator after its first search."""
    at = Places.of(_STEP_M * np.arange(30.0), np.zeros(30))
    level_dbm = true_level_dbm(Station(40.0, 60.0, -30.0, 3.0), at)
    tracemalloc.start()
    tracker = LiveTracker(LiveSettings())
    for number, record in records(at, level_dbm[None]):
        tracker.feed(number, record)
    size_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return size_bytes / 1e6


def _step_ms(steps: int) -> float:
    state = ekf.start(Places.of(0.0, 0.0))
    begin_s = thread_time()
    for k in range(steps):
        state = ekf.step(state, 3.0 * k, 1.0 * k, -80.0).state
    return 1000.0 * (thread_time() - begin_s) / steps


def _cycles_ms(count: int) -> list[float]:
    x_m = _STEP_M * np.arange(count, dtype=float)
    at = Places.of(x_m, 40.0 * np.sin(x_m / 140.0))
    positions = np.random.default_rng(0).uniform(-200.0, 200.0, (_CELLS, 2)).tolist()
    stations = [Station(x, y, -30.0, 3.0) for x, y in positions]
    level_dbm = [noisy_level_dbm(s, at, [k], 3.0) for k, s in enumerate(stations)]
    tracker = LiveTracker(LiveSettings())
    spent_ms = []
    for number, record in records(at, np.array(level_dbm)):
        begin_s = thread_time()
        tracker.feed(number, record)
        spent_ms.append(1000.0 * (thread_time() - begin_s))
    cycles_ms: list[float] = np.sum(np.reshape(spent_ms, (count, 2)), axis=1).tolist()
    return cycles_ms


GROUPS: tuple[Callable[[Effort], list[Check]], ...] = (
    _utm_checks,
    _model_checks,
    _update_checks,
    convergence_checks,
    scenario_checks,
    _cost_checks,
)
"""All checks in the checklist's order."""
THOROUGH = Effort(circles=9, scenarios=5, timed=200)
QUICK = Effort(circles=1, scenarios=1, timed=30)
