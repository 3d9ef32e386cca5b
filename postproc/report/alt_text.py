"""Alternative texts: what each picture of a cell shows, in words and numbers."""

from collections.abc import Sequence

import numpy as np
import shapely

from logger.core.arrays import FloatArray
from logger.core.ellipse import metres
from logger.core.guidance.sentence import direction
from logger.core.rivals import area_text, share_text
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, Consistency
from postproc.pictures.picture import ETA, P0, Fit, Picture
from postproc.pictures.plots import Strips
from postproc.summary import truth_of
from postproc.verification.verdicts import CellVerdict

_MOST_POSITIONS = 4
_FIX_ERROR_M = 5.0
"""Detours smaller than the error of a fix are not counted as walked."""


def plan(picture: Picture, claims: Sequence[CellVerdict] = ()) -> str:
    """Walk, levels, region, positions and claims."""
    if picture.box is None:
        return "There is no plan: the run has no position fix."
    survey = picture.survey
    walked_m = sum(_length_m(strip) for walk in survey.walks for strip in walk.strips_m)
    width_m, height_m = np.ptp(survey.track_m, axis=0).tolist()
    sentences = [
        f"The walk is {metres(walked_m)} long.",
        f"It spans {metres(width_m)} from west to east, {metres(height_m)} from south to north.",
    ]
    if len(picture.readings_m):
        weakest, strongest = float(picture.level_dbm.min()), float(picture.level_dbm.max())
        peak_m = picture.readings_m[int(np.argmax(picture.level_dbm))]
        sentences.append(
            f"Levels along it range from {weakest:.0f} to {strongest:.0f} dBm; the highest is "
            f"{_from_start(picture, peak_m)}."
        )
    sentences += _posterior(picture) + _claims(picture, claims) + _truth(picture)
    return " ".join(sentences)


def distance(fit: Fit) -> str:
    """How well the model fits."""
    near_m, far_m = float(fit.distance_m.min()), float(fit.distance_m.max())
    high_dbm, low_dbm = fit.model_dbm(np.array([near_m, far_m])).tolist()
    residuals_db = np.abs(fit.residual_db[fit.uncensored])
    beyond = float(np.mean(residuals_db > 2.0 * fit.sigma_db)) if len(residuals_db) else 0.0
    text = (
        f"{len(fit.level_dbm)} readings at distances of {metres(near_m)} to {metres(far_m)} from "
        f"the most likely position. The model falls from {high_dbm:.0f} to {low_dbm:.0f} dBm. The "
        f"residuals have a standard deviation of {fit.sigma_db:.1f} dB; {100.0 * beyond:.1f} % "
        "exceed twice that (4.6 % of a normal distribution would)."
    )
    n_censored = int(np.count_nonzero(~fit.uncensored))
    if n_censored:
        text += f" {n_censored} are at a limit of the modem's scale and count as bounds."
    return text


def levels(picture: Picture) -> str:
    """Range and peak of the cell's levels, and the number of other cells."""
    name = picture.focus.cell if picture.focus else None
    by_cell = [levels for walk in picture.survey.walks for levels in walk.levels]
    own = next((levels for levels in by_cell if levels.cell == name), None)
    n_others = len(by_cell) - (own is not None)
    others = ""
    if n_others:
        others = f" {n_others} other cell{'s were' if n_others != 1 else ' was'} observed as well."
    if own is None or not len(own.t_ns):
        return f"No level of this cell was read.{others}"
    minutes = picture.survey.clock.minutes(own.t_ns)
    peak = int(np.argmax(own.level_dbm))
    return (
        f"{len(own.t_ns)} levels of this cell from minute {minutes[0]:.0f} to minute "
        f"{minutes[-1]:.0f}, between {own.level_dbm.min():.0f} and {own.level_dbm.max():.0f} dBm; "
        f"the highest is at minute {minutes[peak]:.0f}.{others}"
    )


def path_loss(picture: Picture) -> str:
    """P0 and eta of the posterior, and of the EKF at its start and end."""
    focus = picture.focus
    if focus is None or focus.posterior is None:
        return "Nothing is known about the path loss."
    values = [
        f"{parameter.name} {parameter.text(*parameter.of_posterior(focus.posterior))}"
        for parameter in (P0, ETA)
    ]
    text = f"After the walk {' and '.join(values)} (± one sigma; the bands show two)."
    if focus.ekf is not None and len(focus.ekf):
        first, last = picture.survey.clock.minutes(focus.ekf.t_ns[[0, -1]]).tolist()
        text += (
            f" The EKF starts at minute {first:.0f} with {_state(focus.ekf, 0)} and ends at minute "
            f"{last:.0f} with {_state(focus.ekf, -1)}."
        )
    return text


def consistency(filtered: FilterPath, tested: Consistency) -> str:
    """Whether the errors of the filter agree with its covariances."""
    nis = filtered.nis[np.isfinite(filtered.innovation_db)]
    above = float(np.mean(nis > NIS_95)) if len(nis) else 0.0
    low, high = tested.nis_bounds
    side = "inside" if low <= tested.mean_nis <= high else "outside"
    lags = np.abs(tested.autocorrelation)
    n_outside = int(np.count_nonzero(lags > tested.white_bound))
    return (
        f"The mean NIS of {tested.n - tested.n_at_limit} innovations is {tested.mean_nis:.2f}, "
        f"{side} the interval of a consistent filter, {low:.2f} to {high:.2f}. "
        f"{100.0 * above:.1f} % of the values exceed the 95 % bound. {n_outside} of {len(lags)} "
        f"lags are outside the band of white noise, where chance puts {0.05 * len(lags):.0f}."
    )


def strips(strips: Strips) -> str:
    """How many cells were received for most of the walk, and which one strongest."""
    level_dbm = strips.level_dbm
    share = np.mean(np.isfinite(level_dbm), axis=1)
    row, column = np.unravel_index(np.nanargmax(level_dbm), level_dbm.shape)
    minute = (column + 0.5) / level_dbm.shape[1] * strips.minutes
    return (
        f"{len(share)} cells over {strips.minutes:.0f} minutes; {np.count_nonzero(share > 0.5)} of "
        f"them were received for more than half of the time. The strongest is cell {row + 1} at "
        f"minute {minute:.0f} with about {level_dbm[row, column]:.0f} dBm. Gaps are blank."
    )


def _posterior(picture: Picture) -> list[str]:
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is None:
        return []
    sentences = [f"The 95 % region covers {area_text(posterior.region_area_m2)}."]
    modes = posterior.modes[:_MOST_POSITIONS]
    for mode, position_m in zip(modes, picture.survey.modes_m(modes), strict=True):
        several = len(posterior.modes) > 1
        share = f"A position with {share_text(mode.probability)}"
        subject = share if several else "The most likely position"
        sentences.append(f"{subject} is {_from_start(picture, position_m)}.")
    return sentences


def _claims(picture: Picture, claims: Sequence[CellVerdict]) -> list[str]:
    sentences = []
    for tested in claims:
        position_m = picture.survey.position_m(tested.claim.lat_deg, tested.claim.lon_deg)
        where = _from_start(picture, position_m)
        sentences.append(f"A claimed position ({tested.verdict}) is {where}.")
    return sentences


def _truth(picture: Picture) -> list[str]:
    runs = [walk.run for walk in picture.survey.walks]
    truth = truth_of(picture.focus, runs) if picture.focus else None
    if truth is None or truth.error_m is None:
        return []
    side = "inside" if truth.inside_region95 else "outside"
    text = f"The true position in this simulation is {metres(truth.error_m)} from the best one"
    return [f"{text}, {side} the region."]


def _from_start(picture: Picture, position_m: FloatArray) -> str:
    """Distance and direction from the start of the walk."""
    start_m = picture.survey.track_m[0]
    distance_m = float(np.linalg.norm(position_m - start_m))
    if distance_m < 1.0:
        return "at the start"
    return f"{metres(distance_m)} {direction(position_m - start_m)} of the start"


def _length_m(strip_m: FloatArray) -> float:
    """Length along fixes, without the noise of their errors."""
    if len(strip_m) < 2:
        return 0.0
    line = shapely.LineString(strip_m).simplify(_FIX_ERROR_M, preserve_topology=False)
    return float(line.length)


def _state(filtered: FilterPath, row: int) -> str:
    return " and ".join(
        f"{parameter.name} " + parameter.text(*parameter.of_state(filtered.x[row], filtered.p[row]))
        for parameter in (P0, ETA)
    )
