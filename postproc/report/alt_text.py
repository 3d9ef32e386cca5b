"""What each picture of a cell shows, in words: for those who do not see it, and for those who want
to be sure.
"""

from collections.abc import Sequence
from math import hypot

import numpy as np
import shapely

from logger.core.arrays import FloatArray
from logger.core.locator.rivals import share_text
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, Consistency
from postproc.json_text import Json
from postproc.pictures.fit import Fit
from postproc.pictures.picture import Picture
from postproc.pictures.plots_filter import ETA, P0, Parameter, of_posterior
from postproc.pictures.strips import Strips
from postproc.report.wording import area_text, direction, metres
from postproc.verification.run_claims import CellVerdict

_MOST_PLACES = 4
_JITTER_M = 5.0


def plan(picture: Picture, found: Json, claims: Sequence[CellVerdict] = ()) -> str:
    """Walk, levels, region, places and claims; `found` is the cell's part of `results.summary`."""
    if picture.box is None:
        return "There is no plan: the run has no position fix."
    walked_m = sum(_length_m(strip) for strip in picture.strips_m)
    wide_m, high_m = np.ptp(picture.track_m, axis=0).tolist()
    told = [
        f"The walk of {metres(walked_m)} spans {metres(wide_m)} from west to east and {metres(high_m)} to the north."
    ]
    if len(picture.heard_m):
        weakest, strongest = float(np.min(picture.heard_dbm)), float(np.max(picture.heard_dbm))
        at = picture.heard_m[int(np.argmax(picture.heard_dbm))]
        told.append(
            f"Levels along it run from {weakest:.0f} to {strongest:.0f} dBm, the strongest {_from_start(picture, at)}."
        )
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is not None:
        told.append(f"The 95 % region covers {area_text(found['region95']['area_m2'])}.")
        for mode in posterior.modes[:_MOST_PLACES]:
            at = picture.local(np.array([mode.x_m]), np.array([mode.y_m]))[0]
            which = (
                f"A place with {share_text(mode.probability)}"
                if len(posterior.modes) > 1
                else "The likeliest place"
            )
            told.append(f"{which} lies {_from_start(picture, at)}.")
    told += [_claim(picture, one) for one in claims] + _truth(found)
    return " ".join(told)


def distance(fit: Fit) -> str:
    """How well the model fits."""
    near_m, far_m = float(fit.distance_m.min()), float(fit.distance_m.max())
    high, low = fit.model_dbm(np.array([near_m, far_m])).tolist()
    off = np.abs(fit.residual_db[fit.within])
    beyond = float(np.mean(off > 2.0 * fit.scatter_db)) if len(off) else 0.0
    told = (
        f"{len(fit.level_dbm)} readings between {metres(near_m)} and {metres(far_m)} from the strongest place. The "
        f"model falls from {high:.0f} to {low:.0f} dBm, the readings scatter by {fit.scatter_db:.1f} dB about it, and "
        f"{beyond:.1%} of them are more than twice that off (4.6 % would be, were they normal)."
    )
    n_at_end = int(np.count_nonzero(~fit.within))
    return told + (
        f" {n_at_end} lie at the end of the modem's scale and count as bounds." if n_at_end else ""
    )


def levels(picture: Picture) -> str:
    """Range and peak of the cell's levels, and how many others there are."""
    name = picture.focus.cell if picture.focus else None
    mine = next((one for one in picture.levels if one.cell == name), None)
    others = len(picture.levels) - (mine is not None)
    beside = (
        f" {others} other cell{'s were' if others != 1 else ' was'} heard beside it."
        if others
        else ""
    )
    if mine is None or not len(mine.t_ns):
        return f"No level of this cell was read.{beside}"
    minutes = picture.clock.minutes(mine.t_ns)
    peak = int(np.argmax(mine.level_dbm))
    return (
        f"{len(mine.t_ns)} levels of this cell from minute {minutes[0]:.0f} to minute {minutes[-1]:.0f}, between "
        f"{np.min(mine.level_dbm):.0f} and {np.max(mine.level_dbm):.0f} dBm, the strongest at minute "
        f"{minutes[peak]:.0f}.{beside}"
    )


def path_loss(picture: Picture) -> str:
    """What the posterior says of P0 and eta, and how the EKF came there."""
    focus = picture.focus
    if focus is None or focus.posterior is None:
        return "Nothing is known of the path loss."
    whole = [
        _with_sigma(*of_posterior(focus.posterior, parameter), parameter) for parameter in (P0, ETA)
    ]
    told = [f"After the whole walk {' and '.join(whole)} (± one sigma; the bands show two)."]
    if focus.ekf is not None and len(focus.ekf):
        first, last = picture.clock.minutes(focus.ekf.t_ns[[0, -1]]).tolist()
        told.append(
            f"The EKF starts at minute {first:.0f} with {_state(focus.ekf, 0)} and ends at minute {last:.0f} with "
            f"{_state(focus.ekf, -1)}."
        )
    return " ".join(told)


def consistency(filtered: FilterPath, seen: Consistency) -> str:
    """Whether the filter knows its errors."""
    nis = filtered.nis[np.isfinite(filtered.innovation_db)]
    above = float(np.mean(nis > NIS_95)) if len(nis) else 0.0
    low, high = seen.nis_bounds
    judged = "this one does" if low <= seen.mean_nis <= high else "this one does not"
    lags = np.abs(seen.autocorrelation)
    outside = int(np.count_nonzero(lags > seen.white_bound))
    return (
        f"The mean NIS of {seen.n - seen.n_at_limit} innovations is {seen.mean_nis:.2f}. That of an honest filter with "
        f"white innovations lies between {low:.2f} and {high:.2f}: {judged}. {above:.1%} are above the 95 % bound. Of "
        f"{len(lags)} lags {outside} leave the band of white noise; {0.05 * len(lags):.0f} would by chance."
    )


def strips(found: Strips) -> str:
    """How many cells were heard for most of the walk, and which one strongest."""
    share = np.mean(np.isfinite(found.level_dbm), axis=1)
    row, column = np.unravel_index(np.nanargmax(found.level_dbm), found.level_dbm.shape)
    minute = (column + 0.5) / found.level_dbm.shape[1] * found.minutes
    return (
        f"{len(share)} cells over {found.minutes:.0f} minutes; {np.count_nonzero(share > 0.5)} of them were heard for "
        f"more than half of the time. The strongest is cell {row + 1} at minute {minute:.0f} with about "
        f"{found.level_dbm[row, column]:.0f} dBm. Gaps are blank."
    )


def _from_start(picture: Picture, at_m: FloatArray) -> str:
    """Where a place lies, seen from the start of the walk."""
    east_m, north_m = (at_m - picture.track_m[0]).tolist()
    away_m = hypot(east_m, north_m)
    return (
        f"{metres(away_m)} {direction(east_m, north_m)} of the start"
        if away_m >= 1.0
        else "at the start"
    )


def _length_m(strip_m: FloatArray) -> float:
    """Way along fixes, without the to and fro of their errors."""
    if len(strip_m) < 2:
        return 0.0
    return float(shapely.LineString(strip_m).simplify(_JITTER_M, preserve_topology=False).length)


def _claim(picture: Picture, one: CellVerdict) -> str:
    if picture.track is None:
        return ""
    x_m, y_m = picture.track.utm.to_xy(one.claim.lat_deg, one.claim.lon_deg)
    at = picture.local(np.array([x_m]), np.array([y_m]))[0]
    return f"A claimed place ({one.verdict}) lies {_from_start(picture, at)}."


def _truth(found: Json) -> list[str]:
    truth = found["truth"]
    if truth is None or truth["error_m"] is None:
        return []
    inside = "inside" if truth["inside_region95"] else "outside"
    return [
        f"The true place of this simulation is {metres(truth['error_m'])} from the best one, {inside} the region."
    ]


def _state(filtered: FilterPath, row: int) -> str:
    sigma = np.sqrt(np.maximum(np.diagonal(filtered.p[row]), 0.0))
    of = (_with_sigma(float(filtered.x[row, p.row]), float(sigma[p.row]), p) for p in (P0, ETA))
    return " and ".join(of)


def _with_sigma(mean: float, sigma: float, parameter: Parameter) -> str:
    digits = 1 if parameter is P0 else 2
    unit = f" {parameter.unit}" if parameter.unit else ""
    return f"{parameter.name} {mean:.{digits}f} ± {sigma:.{digits}f}{unit}"
