"""The checklist's table: 50 readings on a circle of 500 m around the station, 3 dB, P0 = -45 dBm,
eta = 2.5.

Beside its claims stand the reference EKF, our locator and the Cramer-Rao bound with the locator's
priors on P0 and eta. The bound is local: it knows nothing of places far away that fit as well, and
around a circle there are many.
"""

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
from postproc.reproductions.validate import bound
from postproc.reproductions.validate.check import Check, Effort, promised
from postproc.reproductions.validate.walk import (
    ORIGIN_M,
    SPEC,
    Station,
    circle,
    heard,
    observations,
)

TOPIC = "convergence"
NOISE_DB = 3.0


class Claim(NamedTuple):
    """Errors promised after some readings."""

    readings: int
    place_m: float
    p0_db: float
    eta: float
    radius_m: float


CLAIMS = (
    Claim(10, 200.0, 5.0, 0.5, 300.0),
    Claim(20, 100.0, 3.0, 0.3, 150.0),
    Claim(50, 50.0, 1.0, 0.1, 80.0),
)


class Reached(NamedTuple):
    """Errors of place, P0 and eta, the radius claimed, whether the 95 % region holds the truth, and
    the verdict.
    """

    place_m: float
    p0_db: float
    eta: float
    radius_m: float
    covers: bool
    verdict: str


def checks(effort: Effort) -> list[Check]:
    """The whole table."""
    return [
        *(check for claim in CLAIMS for check in _row(claim, effort.circles)),
        _undetermined(),
        _below_the_scale(),
    ]


def _row(claim: Claim, runs: int) -> list[Check]:
    x_m, y_m = circle(claim.readings)
    by_filter, by_us = [], []
    for run in range(runs):
        rng = np.random.default_rng([claim.readings, run])
        level_dbm = heard(SPEC, x_m, y_m) + NOISE_DB * rng.normal(size=claim.readings)
        by_filter.append(filtered(SPEC, x_m, y_m, level_dbm))
        by_us.append(located(SPEC, x_m, y_m, level_dbm))
    prior = Prior()
    precision = np.array([prior.p0_sigma_db, prior.eta_sigma]) ** -2.0
    least = bound.covariance(bound.slopes(SPEC, x_m, y_m), NOISE_DB**2, precision)
    least_m = bound.median_error_m(least[:2, :2])
    theirs, found = _median(by_filter), _median(by_us)
    told = sorted({reached.verdict for reached in by_us})
    where = f"after {claim.readings} readings"
    beyond = ", which the claim is beyond" if claim.place_m < least_m else ""
    return [
        Check(
            TOPIC,
            f"{where}: position error ~{claim.place_m:.0f} m",
            f"reference EKF {theirs.place_m:.0f} m, cellwalk {found.place_m:.0f} m ({', '.join(told)}), "
            f"Cramer-Rao bound {least_m:.0f} m{beyond}",
            promised(theirs.place_m <= claim.place_m),
            is_sampled=True,
        ),
        Check(
            TOPIC,
            f"{where}: P0 error ~{claim.p0_db:.0f} dB, eta error ~{claim.eta:.1f}",
            f"reference EKF {theirs.p0_db:.0f} dB and {theirs.eta:.1f}, "
            f"cellwalk {found.p0_db:.0f} dB and {found.eta:.1f}; sigma of the bound {np.sqrt(least[2, 2]):.0f} dB and "
            f"{np.sqrt(least[3, 3]):.1f}, nearly all of it prior",
            promised(theirs.p0_db <= claim.p0_db and theirs.eta <= claim.eta),
            is_sampled=True,
        ),
        Check(
            TOPIC,
            f"{where}: error radius ~{claim.radius_m:.0f} m",
            f"reference EKF claims {theirs.radius_m:.0f} m, its 95 % ellipse holds {_share(by_filter)} of the truths; "
            f"95 % radius of cellwalk {found.radius_m:.0f} m, its region holds {_share(by_us)}",
            promised(any(reached.covers for reached in by_filter)),
            is_sampled=True,
        ),
    ]


def filtered(station: Station, x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> Reached:
    """The reference EKF along a walk, started at the first place."""
    state = ekf.start(float(x_m[0]), float(y_m[0]))
    for reading in zip(x_m.tolist(), y_m.tolist(), level_dbm.tolist(), strict=True):
        state = ekf.step(state, *reading).state
    off = np.subtract(state[:4], station)
    plane = ekf.covariance_matrix(state.p)[:2, :2]
    covers = bool(off[:2] @ np.linalg.solve(plane, off[:2]) <= CHI2_95_2DOF)
    return Reached(
        float(np.hypot(*off[:2])),
        abs(float(off[2])),
        abs(float(off[3])),
        ekf.drms_m(state.p),
        covers,
        "",
    )


def located(station: Station, x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> Reached:
    """Our locator on a walk."""
    obs = observations(x_m, y_m, level_dbm)
    found = locate(obs)
    off_m = np.hypot(found.x_m - ORIGIN_M[0] - station.x_m, found.y_m - ORIGIN_M[1] - station.y_m)
    return Reached(
        float(off_m),
        abs(found.p0_dbm - station.p0_dbm),
        abs(found.eta - station.eta),
        found.r95_m,
        holds(found, station.x_m + ORIGIN_M[0], station.y_m + ORIGIN_M[1]),
        assess(found, obs).verdict,
    )


def holds(found: Posterior, x_m: float, y_m: float) -> bool:
    """Whether the 95 % region holds a place."""
    cells, chosen = found.squares, highest_density(found.squares)
    off_m = np.maximum(np.abs(cells.x_m[chosen] - x_m), np.abs(cells.y_m[chosen] - y_m))
    return bool(np.any(off_m <= 0.5 * cells.size_m[chosen]))


def _undetermined() -> Check:
    g = bound.slopes(SPEC, *circle(50))
    rank = int(np.linalg.matrix_rank(g))
    return Check(
        TOPIC,
        "parameters are well estimated on a circle around the station",
        f"the slopes of 50 readings have rank {rank} of 4: at one distance P0 and eta appear as P0 - 27 eta only, "
        "so without a prior their errors have no bound",
        promised(rank == 4),
    )


def _below_the_scale() -> Check:
    level_dbm = float(heard(SPEC, *circle(1))[0])
    return Check(
        TOPIC,
        "P0 = -45 dBm, eta = 2.5, 500 m: a GSM modem can measure it",
        f"the level there is {level_dbm:.1f} dBm, below the end of the scale (-110 dBm); simulated without that end",
        promised(level_dbm > -110.0),
    )


def _median(found: list[Reached]) -> Reached:
    """Medians over runs."""
    middle = np.median([reached[:4] for reached in found], axis=0)
    place_m, p0_db, eta, radius_m = middle.tolist()
    return Reached(place_m, p0_db, eta, radius_m, covers=False, verdict="")


def _share(found: list[Reached]) -> str:
    return f"{sum(reached.covers for reached in found)} of {len(found)}"
