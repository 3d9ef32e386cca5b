"""The checklist's five integration scenarios, through the live estimate as the device runs it.

A station at the origin with P0 = -30 dBm, eta = 3 (so that all levels are on the modem's scale), a
reading every two seconds, 3 dB of noise where nothing else is said.
"""

from statistics import median
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.pipeline import locate
from logger.core.types import LiveEstimate, Note
from postproc.reproductions.validate import convergence, live
from postproc.reproductions.validate.check import Check, Effort, ours, promised
from postproc.reproductions.validate.walk import Station, circle, heard, observations

STATION = Station(0.0, 0.0, -30.0, 3.0)
NOISE_DB, LOUD_NOISE_DB = 3.0, 5.0
COUNT = 100
STEP_M = 2.8
_AWAY_M = 100.0
_AROUND = 240


class Walked(NamedTuple):
    """A simulated walk, and what the live estimate said: the reference filter, and ours."""

    x_m: FloatArray
    y_m: FloatArray
    level_dbm: FloatArray
    reference: list[LiveEstimate]
    ours: list[LiveEstimate]


def checks(effort: Effort) -> list[Check]:
    """All five."""
    runs = effort.scenarios
    return [*_stationary(), *_circle(runs), *_line(runs), *_noise(runs), *_target()]


def _walked(x_m: FloatArray, y_m: FloatArray, run: int, noise_db: float = NOISE_DB) -> Walked:
    rng = np.random.default_rng([len(x_m), run])
    level_dbm = heard(STATION, x_m, y_m) + noise_db * rng.normal(size=len(x_m))
    said = live.followed(x_m, y_m, level_dbm[None])
    return Walked(
        x_m,
        y_m,
        level_dbm,
        live.of_stage(said, "reference-ekf"),
        live.of_stage(said, "locator", "ekf"),
    )


def _off_m(estimate: LiveEstimate) -> float:
    return float(np.hypot(*live.place_m(estimate)))


def _stationary() -> list[Check]:
    topic = "1 stationary user"
    walked = _walked(np.full(COUNT, 200.0), np.zeros(COUNT), 0)
    begun, last, late = walked.reference[0], walked.reference[-1], walked.reference[COUNT // 2 :]
    moved_m = float(
        np.max(np.hypot(*np.subtract([live.place_m(e) for e in late], live.place_m(last)).T))
    )
    p0_dbm, eta = [e.p0_dbm for e in late], [e.eta for e in late]
    spread_db = max(p0_dbm) - min(p0_dbm)
    return [
        Check(
            topic,
            "the position estimate remains stable",
            f"moves by {moved_m:.1f} m: it stays at the user, {_off_m(last):.0f} m from the station; "
            "cellwalk names no place from one spot",
            promised(moved_m < 1.0 and not walked.ours),
        ),
        Check(
            topic,
            "the error radius decreases, but not to zero",
            f"{live.radius_m(begun):.2f} -> {live.radius_m(last):.2f} m: from one spot nothing is learnt of the place",
            promised(live.radius_m(last) < 0.99 * live.radius_m(begun)),
        ),
        Check(
            topic,
            "parameter estimates stabilise",
            f"within {spread_db:.1f} dB and {max(eta) - min(eta):.2f}, on P0 = {last.p0_dbm:.0f} dBm (true: "
            f"{STATION.p0_dbm:.0f}): that is the level where the user stands",
            promised(spread_db < 2.0),
        ),
    ]


def _circle(runs: int) -> list[Check]:
    topic = "2 circle of 300 m"
    walks = [_walked(*circle(COUNT, 300.0, COUNT), run) for run in range(runs)]
    theirs_m, ours_m = _median_off_m(walks)
    shrunk_m = median(live.radius_m(walk.reference[-1]) for walk in walks)
    radius_m = median(live.radius_m(walk.ours[-1]) for walk in walks)
    return [
        Check(
            topic,
            "the position estimate converges to the centre",
            f"reference EKF {theirs_m:.0f} m off; cellwalk {ours_m:.0f} m off: any place far away fits as well",
            promised(theirs_m < 100.0),
            is_sampled=True,
        ),
        Check(
            topic,
            "the error radius decreases significantly",
            f"reference EKF 44.7 -> {shrunk_m:.1f} m, with {theirs_m:.0f} m of error; cellwalk says {radius_m:.0f} m",
            promised(shrunk_m > 0.5 * theirs_m),
            is_sampled=True,
        ),
    ]


def _line(runs: int) -> list[Check]:
    topic = "3 straight line"
    x_m, y_m = np.linspace(-200.0, 200.0, COUNT), np.full(COUNT, _AWAY_M)
    walks = [_walked(x_m, y_m, run) for run in range(runs)]
    across_m = median(abs(live.place_m(walk.reference[-1])[1] - _AWAY_M) for walk in walks)
    along, across = (
        median(getattr(walk.reference[-1], p) for walk in walks) ** 0.5 for p in ("p_xx", "p_yy")
    )
    again = [_line_and(walk, x_m, y_m, run) for run, walk in enumerate(walks)]
    crossing = [
        _line_and(walk, np.full(COUNT, -150.0), y_m + x_m, run) for run, walk in enumerate(walks)
    ]
    twin, still, one = (
        median(shares) for shares in ([_second(walk) for walk in walks], again, crossing)
    )
    return [
        Check(
            topic,
            "the estimate adjusts along the perpendicular",
            f"reference EKF leaves the line by {across_m:.1f} m of {_AWAY_M:.0f} m: it starts where no slope is across",
            promised(across_m > 0.5 * _AWAY_M),
            is_sampled=True,
        ),
        Check(
            topic,
            "the error is larger perpendicular to the motion",
            f"reference EKF: sigma {across:.1f} m across, {along:.1f} m along",
            promised(across > along),
            is_sampled=True,
        ),
        Check(
            topic,
            "several passes are needed",
            f"cellwalk gives the mirror image {twin:.2f} after one pass, {still:.2f} after the same line twice, "
            f"{one:.2f} after a second line at a right angle",
            promised(twin > 0.25 and still > 0.25 and one < 0.1),
            is_sampled=True,
        ),
    ]


def _line_and(walk: Walked, x_m: FloatArray, y_m: FloatArray, run: int) -> float:
    """Probability of the mirror image once a second line was walked too."""
    rng = np.random.default_rng([1, run])
    level_dbm = heard(STATION, x_m, y_m) + NOISE_DB * rng.normal(size=len(x_m))
    both = (
        np.concatenate(pair)
        for pair in ((walk.x_m, x_m), (walk.y_m, y_m), (walk.level_dbm, level_dbm))
    )
    return _mirrored(*both)


def _second(walk: Walked) -> float:
    return _mirrored(walk.x_m, walk.y_m, walk.level_dbm)


def _mirrored(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> float:
    """Probability of the side of the first line where the station is not."""
    cells = locate(observations(x_m, y_m, level_dbm)).squares
    beyond = cells.y_m > float(observations(x_m, y_m, level_dbm).y_m[0])
    return float(np.sum(cells.probability[beyond]))


def _noise(runs: int) -> list[Check]:
    topic = "4 noise of 5 dB"
    x_m, y_m = _square()
    quiet, loud = (
        [_walked(x_m, y_m, run, db) for run in range(runs)] for db in (NOISE_DB, LOUD_NOISE_DB)
    )
    theirs_m, ours_m = _median_off_m(loud)
    calm_m = _median_off_m(quiet)[1]
    radius_m = median(live.radius_m(walk.reference[-1]) for walk in loud)
    theirs = [convergence.filtered(STATION, walk.x_m, walk.y_m, walk.level_dbm) for walk in loud]
    found = [convergence.located(STATION, walk.x_m, walk.y_m, walk.level_dbm) for walk in loud]
    covered, covering = (
        sum(reached.covers for reached in theirs),
        sum(reached.covers for reached in found),
    )
    return [
        Check(
            topic,
            "the EKF smooths the noise",
            f"on a square around the station: reference EKF {theirs_m:.0f} m off, cellwalk {ours_m:.0f} m",
            promised(theirs_m < 50.0),
            is_sampled=True,
        ),
        Check(
            topic,
            "convergence is slower, but stable",
            f"cellwalk {calm_m:.0f} m off in 3 dB, {ours_m:.0f} m in 5 dB, after {_AROUND} readings",
            promised(calm_m <= ours_m < 100.0),
            is_sampled=True,
        ),
        Check(
            topic,
            "the error radius accounts for the uncertainty",
            f"reference EKF claims {radius_m:.1f} m, its 95 % ellipse holds {covered} of {runs} truths; "
            f"the 95 % region of cellwalk {covering} of {runs}",
            promised(covered >= 0.9 * runs),
            is_sampled=True,
        ),
    ]


def _square() -> tuple[FloatArray, FloatArray]:
    """Once around a block with the station inside, off its middle."""
    side_m = 0.25 * _AROUND * STEP_M
    walked_m, corners_m = STEP_M * np.arange(_AROUND), side_m * np.arange(5)
    x_m = np.interp(walked_m, corners_m, side_m * np.array([0.0, 1.0, 1.0, 0.0, 0.0]))
    y_m = np.interp(walked_m, corners_m, side_m * np.array([0.0, 0.0, 1.0, 1.0, 0.0]))
    return x_m - 0.3 * side_m, y_m - 0.4 * side_m


def _target() -> list[Check]:
    """One cell fades while another grows, 1 dB a reading, without noise."""
    topic = "5 target change"
    fades = -55.0 - np.arange(40.0)
    x_m, y_m = STEP_M * np.arange(40.0), np.zeros(40)
    said = live.followed(x_m, y_m, np.stack([fades, fades[::-1]]))
    notes = [note for note in said if isinstance(note, Note)]
    steps = live.of_stage(said, "reference-ekf")
    cells = [step.cell for step in steps]
    k = cells.index(cells[-1])
    at_user = abs(live.place_m(steps[k])[0] - x_m[k]) < 1e-6
    begun_anew = steps[k].n == 1 and at_user
    changes = [note for note in notes if note.code == "target-changed"]
    ahead_db = float(fades[::-1][k] - fades[k])
    return [
        Check(
            topic,
            "the strongest cell is the target",
            f"{cells[0]} first, {cells[-1]} when it is {ahead_db:.0f} dB stronger (hysteresis 6 dB), one change",
            ours(len(set(cells)) == 2 and len(changes) == 1 and ahead_db > 6.0),
        ),
        Check(
            topic,
            "the EKF is reset when the cell changes",
            "first step of the new target is number 1, at the user; cellwalk keeps an estimate of every cell, "
            "so nothing is lost",
            ours(begun_anew),
        ),
        Check(
            topic,
            "a change is clearly shown",
            f"recorded: {changes[0].text}" if changes else "-",
            ours(bool(changes)),
        ),
    ]


def _median_off_m(walks: list[Walked]) -> tuple[float, float]:
    """Median last error of the reference filter and of the live estimate."""
    return median(_off_m(walk.reference[-1]) for walk in walks), median(
        _off_m(walk.ours[-1]) for walk in walks
    )
