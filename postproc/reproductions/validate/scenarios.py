"""The checklist's five integration scenarios, through the live estimate as the device runs it.

A station at the origin with P0 = -30 dBm, eta = 3 (so that all levels are on the modem's scale), a
reading every two seconds, 3 dB of noise where nothing else is stated.
"""

from statistics import median
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.pipeline import locate
from logger.core.types import LiveEstimate, Note
from postproc.reproductions.validate import live
from postproc.reproductions.validate.check import Check, Effort, Line, checks_of, ours, theirs
from postproc.reproductions.validate.convergence import run_locator, run_reference
from postproc.reproductions.validate.walk import (
    Station,
    circle,
    noisy_level_dbm,
    observations,
)

STATION = Station(0.0, 0.0, -30.0, 3.0)
NOISE_DB, LOUD_NOISE_DB = 3.0, 5.0
COUNT = 100
STEP_M = 2.8  # of a walker in two seconds
_AWAY_M = 100.0  # of the straight line from the station
_AROUND = 240  # readings once around a block


class SimulatedWalk(NamedTuple):
    """A simulated walk and the live estimates: the reference filter's, and ours."""

    x_m: FloatArray
    y_m: FloatArray
    level_dbm: FloatArray
    reference: list[LiveEstimate]
    ours: list[LiveEstimate]


def checks(effort: Effort) -> list[Check]:
    """All five."""
    runs = effort.scenarios
    return [*stationary(), *_circle(runs), *_line(runs), *_noise(runs), *target_change()]


def _walk(x_m: FloatArray, y_m: FloatArray, run: int, noise_db: float = NOISE_DB) -> SimulatedWalk:
    level_dbm = noisy_level_dbm(STATION, x_m, y_m, [len(x_m), run], noise_db)
    outputs = live.track(x_m, y_m, level_dbm[None])
    reference = live.of_stage(outputs, "reference-ekf")
    return SimulatedWalk(x_m, y_m, level_dbm, reference, live.of_stage(outputs, "locator", "ekf"))


def _error_m(estimate: LiveEstimate) -> float:
    return float(np.hypot(*live.position_m(estimate)))


def _median_errors_m(walks: list[SimulatedWalk]) -> tuple[float, float]:
    """Median last error of the reference filter and of the live estimate."""
    reference_m = median(_error_m(walk.reference[-1]) for walk in walks)
    return reference_m, median(_error_m(walk.ours[-1]) for walk in walks)


def stationary() -> list[Check]:
    """A user who stays 200 m from the station."""
    walk = _walk(np.full(COUNT, 200.0), np.zeros(COUNT), 0)
    first, last, late = walk.reference[0], walk.reference[-1], walk.reference[COUNT // 2 :]
    positions_m = np.array([live.position_m(estimate) for estimate in late])
    moved_m = float(np.max(np.hypot(*(positions_m - positions_m[-1]).T)))
    spread_db, spread_eta = np.ptp([(e.p0_dbm, e.eta) for e in late], axis=0).tolist()
    return checks_of(
        "1 stationary user",
        Line(
            "the position estimate remains stable",
            f"moves by {moved_m:.1f} m: it stays at the user, {_error_m(last):.0f} m from the "
            "station; cellwalk gives no position from one point",
            theirs(moved_m < 1.0 and not walk.ours),
        ),
        Line(
            "the error radius decreases, but not to zero",
            f"{live.radius_m(first):.2f} -> {live.radius_m(last):.2f} m: "
            "readings from one point hold no information on the position",
            theirs(live.radius_m(last) < 0.99 * live.radius_m(first)),
        ),
        Line(
            "parameter estimates stabilise",
            f"within {spread_db:.1f} dB and {spread_eta:.2f}, on P0 = {last.p0_dbm:.0f} dBm (true: "
            f"{STATION.p0_dbm:.0f}): that is the level where the user stands",
            theirs(spread_db < 2.0),
        ),
    )


def _circle(runs: int) -> list[Check]:
    walks = [_walk(*circle(COUNT, 300.0, COUNT), run) for run in range(runs)]
    reference_m, ours_m = _median_errors_m(walks)
    claimed_m = median(live.radius_m(walk.reference[-1]) for walk in walks)
    radius_m = median(live.radius_m(walk.ours[-1]) for walk in walks)
    return checks_of(
        "2 circle of 300 m",
        Line(
            "the position estimate converges to the centre",
            f"reference EKF {reference_m:.0f} m off; cellwalk {ours_m:.0f} m off: "
            "any far position fits as well",
            theirs(reference_m < 100.0),
        ),
        Line(
            "the error radius decreases significantly",
            f"reference EKF 44.7 -> {claimed_m:.1f} m, with {reference_m:.0f} m of error; "
            f"cellwalk claims {radius_m:.0f} m",
            theirs(claimed_m > 0.5 * reference_m),
        ),
        is_sampled=True,
    )


def _line(runs: int) -> list[Check]:
    x_m, y_m = np.linspace(-200.0, 200.0, COUNT), np.full(COUNT, _AWAY_M)
    walks = [_walk(x_m, y_m, run) for run in range(runs)]
    left_m = median(abs(live.position_m(walk.reference[-1])[1] - _AWAY_M) for walk in walks)
    along, across = (
        median(getattr(walk.reference[-1], p) for walk in walks) ** 0.5 for p in ("p_xx", "p_yy")
    )
    once = median(mirror_probability(walk.x_m, walk.y_m, walk.level_dbm) for walk in walks)
    twice = median(_with_line(walk, x_m, y_m, run) for run, walk in enumerate(walks))
    crossing_m = np.full(COUNT, -150.0), y_m + x_m
    crossed = median(_with_line(walk, *crossing_m, run) for run, walk in enumerate(walks))
    return checks_of(
        "3 straight line",
        Line(
            "the estimate adjusts along the perpendicular",
            f"reference EKF leaves the line by {left_m:.1f} m of {_AWAY_M:.0f} m: "
            "it starts where no slope is across",
            theirs(left_m > 0.5 * _AWAY_M),
        ),
        Line(
            "the error is larger perpendicular to the motion",
            f"reference EKF: sigma {across:.1f} m across, {along:.1f} m along",
            theirs(across > along),
        ),
        Line(
            "several passes are needed",
            f"cellwalk gives the mirror image {once:.2f} after one pass, {twice:.2f} after the "
            f"same line twice, {crossed:.2f} after a second line at a right angle",
            theirs(once > 0.25 and twice > 0.25 and crossed < 0.1),
        ),
        is_sampled=True,
    )


def _with_line(walk: SimulatedWalk, x_m: FloatArray, y_m: FloatArray, run: int) -> float:
    """Probability of the mirror image after a second line."""
    line = x_m, y_m, noisy_level_dbm(STATION, x_m, y_m, [1, run], NOISE_DB)
    return mirror_probability(*(np.append(*pair) for pair in zip(walk[:3], line, strict=True)))


def mirror_probability(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> float:
    """Probability of the side of the first line where the station is not."""
    obs = observations(x_m, y_m, level_dbm)
    squares = locate(obs).squares
    return float(np.sum(squares.probability[squares.y_m > float(obs.y_m[0])]))


def _noise(runs: int) -> list[Check]:
    x_m, y_m = around_block()
    quiet, loud = (
        [_walk(x_m, y_m, run, noise_db) for run in range(runs)]
        for noise_db in (NOISE_DB, LOUD_NOISE_DB)
    )
    (_, quiet_m), (reference_m, ours_m) = _median_errors_m(quiet), _median_errors_m(loud)
    claimed_m = median(live.radius_m(walk.reference[-1]) for walk in loud)
    covered, ours_covered = (
        sum(run(STATION, *walk[:3]).covers for walk in loud) for run in (run_reference, run_locator)
    )
    return checks_of(
        "4 noise of 5 dB",
        Line(
            "the EKF smooths the noise",
            f"on a square around the station: reference EKF {reference_m:.0f} m off, "
            f"cellwalk {ours_m:.0f} m",
            theirs(reference_m < 50.0),
        ),
        Line(
            "convergence is slower, but stable",
            f"cellwalk {quiet_m:.0f} m off in 3 dB, {ours_m:.0f} m in 5 dB, "
            f"after {_AROUND} readings",
            theirs(quiet_m <= ours_m < 100.0),
        ),
        Line(
            "the error radius accounts for the uncertainty",
            f"reference EKF claims {claimed_m:.1f} m, its 95 % ellipse holds {covered} of {runs} "
            f"truths; the 95 % region of cellwalk {ours_covered} of {runs}",
            theirs(covered >= 0.9 * runs),
        ),
        is_sampled=True,
    )


def around_block() -> tuple[FloatArray, FloatArray]:
    """Once around a block with the station inside, off its middle: x and y, shape (n,)."""
    side_m = 0.25 * _AROUND * STEP_M
    way_m, corners_m = STEP_M * np.arange(_AROUND), side_m * np.arange(5)
    x_m = np.interp(way_m, corners_m, side_m * np.array([0.0, 1.0, 1.0, 0.0, 0.0]))
    y_m = np.interp(way_m, corners_m, side_m * np.array([0.0, 0.0, 1.0, 1.0, 0.0]))
    return x_m - 0.3 * side_m, y_m - 0.4 * side_m


def target_change() -> list[Check]:
    """One cell fades while another grows, 1 dB a reading, without noise."""
    falling_dbm = -55.0 - np.arange(40.0)
    rising_dbm = falling_dbm[::-1]
    x_m, y_m = STEP_M * np.arange(40.0), np.zeros(40)
    outputs = live.track(x_m, y_m, np.stack([falling_dbm, rising_dbm]))
    changes = [o for o in outputs if isinstance(o, Note) and o.code == "target-changed"]
    steps = live.of_stage(outputs, "reference-ekf")
    cells = [step.cell for step in steps]
    k = cells.index(cells[-1])
    is_at_user = abs(live.position_m(steps[k])[0] - x_m[k]) < 1e-6
    ahead_db = float(rising_dbm[k] - falling_dbm[k])
    return checks_of(
        "5 target change",
        Line(
            "the strongest cell is the target",
            f"{cells[0]} first, {cells[-1]} when it is {ahead_db:.0f} dB stronger "
            "(hysteresis 6 dB), one change",
            ours(len(set(cells)) == 2 and len(changes) == 1 and ahead_db > 6.0),
        ),
        Line(
            "the EKF is reset when the cell changes",
            "first step of the new target is number 1, at the user; "
            "cellwalk keeps an estimate of every cell, so nothing is lost",
            ours(steps[k].n == 1 and is_at_user),
        ),
        Line(
            "a change is clearly shown",
            f"recorded: {changes[0].text}" if changes else "-",
            ours(bool(changes)),
        ),
    )
