"""The checklist's table: 50 readings on a circle of 500 m around the station.

3 dB of noise, P0 = -45 dBm, eta = 2.5. Beside its claims stand the reference EKF, our locator and
the Cramer-Rao bound with the locator's priors on P0 and eta. The bound is local: it takes no
account of far positions that fit as well, and around a circle there are many.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.ellipse import CHI2_95_2DOF
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import highest_density
from logger.core.locator.verdict import assess
from logger.core.model.prior import Prior
from logger.core.places import Places
from postproc.reproductions.validate import bound
from postproc.reproductions.validate.check import Check, Effort, Line, checks_of, theirs
from postproc.reproductions.validate.walk import (
    ORIGIN_M,
    SPEC,
    Station,
    circle,
    noisy_level_dbm,
    observations,
    true_level_dbm,
)

NOISE_DB = 3.0


class Claim(NamedTuple):
    """Errors promised after some readings."""

    readings: int
    position_m: float
    p0_db: float
    eta: float
    radius_m: float


CLAIMS = (
    Claim(10, 200.0, 5.0, 0.5, 300.0),
    Claim(20, 100.0, 3.0, 0.3, 150.0),
    Claim(50, 50.0, 1.0, 0.1, 80.0),
)


class Outcome(NamedTuple):
    """Errors of position, P0 and eta, and the claimed radius.

    `covers` is whether the 95 % region holds the truth.
    """

    position_m: float
    p0_db: float
    eta: float
    radius_m: float
    covers: bool
    verdict: str


Estimator = Callable[[Station, FloatArray, FloatArray, FloatArray], Outcome]


def checks(effort: Effort) -> list[Check]:
    """All lines of the table."""
    rows = [line for claim in CLAIMS for line in compare(claim, effort.circles)]
    return [
        *checks_of("convergence", *rows, is_sampled=True),
        *checks_of("convergence", observability(), _below_the_scale()),
    ]


def compare(claim: Claim, runs: int) -> list[Line]:
    """One row of the table: position, P0 and eta, and error radius."""
    x_m, y_m = circle(claim.readings)
    levels_dbm = [
        noisy_level_dbm(SPEC, x_m, y_m, [claim.readings, run], NOISE_DB) for run in range(runs)
    ]
    reference, by_reference = _medians(run_reference, x_m, y_m, levels_dbm)
    cellwalk, by_cellwalk = _medians(run_locator, x_m, y_m, levels_dbm)
    prior = Prior()
    precision = np.array([prior.p0_sigma_db, prior.eta_sigma]) ** -2.0
    least = bound.covariance(bound.slopes(SPEC, x_m, y_m), NOISE_DB**2, precision)
    least_m = bound.median_error_m(least[:2, :2])
    verdicts = ", ".join(sorted({outcome.verdict for outcome in by_cellwalk}))
    beyond = ", which the claim is beyond" if claim.position_m < least_m else ""
    after = f"after {claim.readings} readings"
    return [
        Line(
            f"{after}: position error ~{claim.position_m:.0f} m",
            f"reference EKF {reference.position_m:.0f} m, "
            f"cellwalk {cellwalk.position_m:.0f} m ({verdicts}), "
            f"Cramer-Rao bound {least_m:.0f} m{beyond}",
            theirs(reference.position_m <= claim.position_m),
        ),
        Line(
            f"{after}: P0 error ~{claim.p0_db:.0f} dB, eta error ~{claim.eta:.1f}",
            f"reference EKF {reference.p0_db:.0f} dB and {reference.eta:.1f}, "
            f"cellwalk {cellwalk.p0_db:.0f} dB and {cellwalk.eta:.1f}; "
            f"sigma of the bound {np.sqrt(least[2, 2]):.0f} dB and {np.sqrt(least[3, 3]):.1f}, "
            "nearly all of it prior",
            theirs(reference.p0_db <= claim.p0_db and reference.eta <= claim.eta),
        ),
        Line(
            f"{after}: error radius ~{claim.radius_m:.0f} m",
            f"reference EKF claims {reference.radius_m:.0f} m, its 95 % ellipse holds "
            f"{_coverage(by_reference)} of the truths; 95 % radius of cellwalk "
            f"{cellwalk.radius_m:.0f} m, its region holds {_coverage(by_cellwalk)}",
            theirs(any(outcome.covers for outcome in by_reference)),
        ),
    ]


def _medians(
    estimate: Estimator, x_m: FloatArray, y_m: FloatArray, levels_dbm: list[FloatArray]
) -> tuple[Outcome, list[Outcome]]:
    """Medians over the runs, and the outcome of each."""
    outcomes = [estimate(SPEC, x_m, y_m, level_dbm) for level_dbm in levels_dbm]
    position_m, p0_db, eta, radius_m = np.median([o[:4] for o in outcomes], axis=0).tolist()
    return Outcome(position_m, p0_db, eta, radius_m, covers=False, verdict=""), outcomes


def run_reference(
    station: Station, x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray
) -> Outcome:
    """The reference EKF along a walk, started at the first point."""
    state = ekf.start(Places.of(x_m[0], y_m[0]))
    for reading in zip(x_m.tolist(), y_m.tolist(), level_dbm.tolist(), strict=True):
        state = ekf.step(state, *reading).state
    error = np.subtract(state[:4], station)
    plane = ekf.covariance_matrix(state.p)[:2, :2]
    covers = bool(error[:2] @ np.linalg.solve(plane, error[:2]) <= CHI2_95_2DOF)
    return _outcome(error, ekf.drms_m(state.p), covers, "")


def run_locator(
    station: Station, x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray
) -> Outcome:
    """Our locator on a walk."""
    obs = observations(x_m, y_m, level_dbm)
    posterior = locate(obs)
    true_x_m, true_y_m = station.x_m + ORIGIN_M[0], station.y_m + ORIGIN_M[1]
    estimate = posterior.x_m, posterior.y_m, posterior.p0_dbm, posterior.eta
    error = np.subtract(estimate, (true_x_m, true_y_m, station.p0_dbm, station.eta))
    covers = _covers(posterior, true_x_m, true_y_m)
    return _outcome(error, posterior.r95_m, covers, assess(posterior, obs).verdict)


def _outcome(error: FloatArray, radius_m: float, covers: bool, status: str) -> Outcome:
    p0_db, eta = np.abs(error[2:]).tolist()
    return Outcome(float(np.hypot(*error[:2])), p0_db, eta, radius_m, covers, status)


def _covers(posterior: Posterior, x_m: float, y_m: float) -> bool:
    """Whether the 95 % region holds a position."""
    squares, region = posterior.squares, highest_density(posterior.squares)
    off_m = np.maximum(np.abs(squares.x_m[region] - x_m), np.abs(squares.y_m[region] - y_m))
    return bool(np.any(off_m <= 0.5 * squares.size_m[region]))


def observability() -> Line:
    """Rank of the slopes on the circle."""
    rank = int(np.linalg.matrix_rank(bound.slopes(SPEC, *circle(50))))
    return Line(
        "parameters are well estimated on a circle around the station",
        f"the slopes of 50 readings have rank {rank} of 4: at one distance P0 and eta appear as "
        "P0 - 27 eta only, so without a prior their errors have no bound",
        theirs(rank == 4),
    )


def _below_the_scale() -> Line:
    level_dbm = float(true_level_dbm(SPEC, *circle(1))[0])
    return Line(
        "P0 = -45 dBm, eta = 2.5, 500 m: a GSM modem can measure it",
        f"the level there is {level_dbm:.1f} dBm, below the censoring limit of -110 dBm; "
        "simulated without that limit",
        theirs(level_dbm > -110.0),
    )


def _coverage(outcomes: list[Outcome]) -> str:
    return f"{sum(outcome.covers for outcome in outcomes)} of {len(outcomes)}"
