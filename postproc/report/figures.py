"""The pictures of a cell, and what each shows in words and numbers."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from logger.core.arrays import FloatArray
from logger.core.certainty import area_text, metres
from logger.core.guidance.sentence import direction
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, Consistency, consistency
from postproc.pictures import colours
from postproc.pictures.picture import ETA, P0, Fit, Picture, fit_of, mode_labels
from postproc.pictures.plots import (
    DASHED,
    Strips,
    draw_autocorrelation,
    draw_distance,
    draw_levels,
    draw_marks,
    draw_nis,
    draw_parameter,
    draw_plan,
    draw_residuals,
    draw_strips,
    figure_of_size,
    legend_below,
    outside_note,
    rgb,
    strips_of,
)
from postproc.pictures.survey import Box, Clock, Levels
from postproc.summary import truth_of
from postproc.verification.claims import CellVerdict

WIDTH_INCH = 4.0
"""Narrow, so that texts have 11 pixels or more on a telephone of 390."""
_BESIDE_INCH = 0.85
_ABOVE_INCH = 1.5
"""Space for the labels beside a plan, and for those above and below it."""
_MOST_POSITIONS = 4
_FIX_ERROR_M = 5.0
"""Detours smaller than the error of a fix are not counted as walked."""


class ReportFigure(NamedTuple):
    """A figure, its name among those of a cell, its title, and its alternative text."""

    name: str
    title: str
    figure: Figure
    alt_text: str


def figures_of(picture: Picture, claims: Sequence[CellVerdict] = ()) -> Iterator[ReportFigure]:
    """All figures of the picture's cell; of several runs none over time, as each has its clock."""
    focus = picture.focus
    if focus is None:
        return
    if picture.box is not None:
        text = _plan_text(picture, claims)
        yield ReportFigure("plan", "Plan", _plan(picture, picture.box, claims), text)
    fit = fit_of(focus)
    if fit is not None:
        text = _distance_text(fit)
        yield ReportFigure("distance", "Level by distance", _distance(fit), text)
    if len(picture.survey.walks) > 1:
        return
    yield ReportFigure("levels", "Levels over time", _levels(picture), _levels_text(picture))
    if focus.posterior is not None and focus.ekf is not None and len(focus.ekf):
        text = _path_loss_text(picture)
        yield ReportFigure("path-loss", "Path loss over time", _path_loss(picture), text)
        yield from _consistency(picture.survey.clock, focus.ekf)


def overview(rows: Sequence[Levels | None], clock: Clock) -> ReportFigure | None:
    """Levels of all cells over time, a row each; None where no level was read."""
    strips = strips_of(rows, clock)
    if strips is None:
        return None
    figure = figure_of_size(2.0 * WIDTH_INCH, 1.3 + 0.2 * len(rows))
    draw_strips(figure, figure.subplots(), strips)
    title, text = "Levels of all cells over time", _strips_text(strips)
    return ReportFigure("overview", title, figure, text)


def _plan(picture: Picture, box: Box, claims: Sequence[CellVerdict]) -> Figure:
    figure = figure_of_size(WIDTH_INCH, WIDTH_INCH)
    axes = figure.subplots()
    for claim in claims:
        _draw_claim(axes, picture, box, claim)
    box = draw_plan(figure, axes, picture) or box
    # the plan is to scale, so the walk determines its height
    plan_inch = (WIDTH_INCH - _BESIDE_INCH) * box.height / box.width
    figure.set_size_inches(WIDTH_INCH, plan_inch + _ABOVE_INCH + legends_inch(figure))
    return figure


def legends_inch(figure: Figure) -> float:
    """Height of the legends below the axes."""
    heights = (legend.get_window_extent().height / figure.dpi for legend in figure.legends)
    return float(sum(heights))


def _draw_claim(axes: Axes, picture: Picture, box: Box, tested: CellVerdict) -> None:
    claim = tested.claim
    east_m, north_m = position_m = picture.survey.position_m(claim.at)
    ink = rgb(colours.INK)
    marker = "X" if tested.verdict == "rejected" else "D"
    fill = colours.PAPER if tested.verdict == "cannot tell" else colours.INK
    label = f"claimed position: {tested.verdict}{outside_note(box, position_m)}"
    style = {"markeredgecolor": ink, "label": label, "zorder": 10}
    draw_marks(axes, east_m, north_m, marker, fill, 6, **style)
    radius_m = 2.0 * claim.sigma_m
    if radius_m > 0.0 and box.enlarge(radius_m).contains(position_m):
        circle = Circle((east_m, north_m), radius_m, fill=False, edgecolor=ink, linestyle=DASHED)
        axes.add_patch(circle).set_zorder(5)


def _distance(fit: Fit) -> Figure:
    figure = figure_of_size(WIDTH_INCH, 4.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    draw_distance(above, fit)
    draw_residuals(below, fit)
    above.set(title="", xlabel="")
    legend_below(figure, above)
    return figure


def _levels(picture: Picture) -> Figure:
    figure = figure_of_size(WIDTH_INCH, 2.9)
    axes = figure.subplots()
    draw_levels(axes, picture, most_others=0)
    axes.set_title("")
    return figure


def _path_loss(picture: Picture) -> Figure:
    figure = figure_of_size(WIDTH_INCH, 4.2)
    above, below = figure.subplots(2, 1, sharex=True)
    draw_parameter(above, picture, P0)
    draw_parameter(below, picture, ETA)
    below.set_xlabel("minutes since the start")
    legend_below(figure, above, below)
    return figure


def _consistency(clock: Clock, ekf: FilterPath) -> Iterator[ReportFigure]:
    """NIS and autocorrelation of the innovations, where there are enough of them."""
    tested = ekf.consistency or consistency(ekf.innovation_db, ekf.innovation_var_db2)
    if not tested.autocorrelation:
        return
    figure = figure_of_size(WIDTH_INCH, 4.6)
    above, below = figure.subplots(2, 1)
    draw_nis(above, clock, ekf)
    draw_autocorrelation(below, tested)
    legend_below(figure, above, below)
    text = _consistency_text(ekf, tested)
    yield ReportFigure("consistency", "Is the EKF consistent?", figure, text)


def _plan_text(picture: Picture, claims: Sequence[CellVerdict] = ()) -> str:
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


def _distance_text(fit: Fit) -> str:
    near_m, far_m = float(fit.distance_m.min()), float(fit.distance_m.max())
    high_dbm, low_dbm = fit.model_dbm(np.array([near_m, far_m])).tolist()
    residuals_db = np.abs(fit.residual_db[fit.uncensored])
    beyond = float(np.mean(residuals_db > 2.0 * fit.sigma_db)) if len(residuals_db) else 0.0
    text = (
        f"{len(fit.level_dbm)} readings at distances of {metres(near_m)} to {metres(far_m)} from "
        f"the most likely position. The model falls from {high_dbm:.0f} to {low_dbm:.0f} dBm. The "
        f"residuals have a root mean square of {fit.sigma_db:.1f} dB; {100.0 * beyond:.1f} % "
        "exceed twice that (4.6 % of a normal distribution would)."
    )
    n_censored = int(np.count_nonzero(~fit.uncensored))
    if n_censored:
        text += f" {n_censored} are at a limit of the modem's scale and count as bounds."
    return text


def _levels_text(picture: Picture) -> str:
    name = picture.focus.cell if picture.focus else None
    by_cell = picture.survey.levels
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


def _path_loss_text(picture: Picture) -> str:
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


def _consistency_text(filtered: FilterPath, tested: Consistency) -> str:
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


def _strips_text(strips: Strips) -> str:
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
    modes = posterior.likely_modes[:_MOST_POSITIONS]
    shares = mode_labels(posterior)[:_MOST_POSITIONS]
    for share, position_m in zip(shares, picture.survey.modes_m(modes), strict=True):
        subject = f"A position with {share}" if share else "The most likely position"
        sentences.append(f"{subject} is {_from_start(picture, position_m)}.")
    return sentences


def _claims(picture: Picture, claims: Sequence[CellVerdict]) -> list[str]:
    sentences = []
    for tested in claims:
        position_m = picture.survey.position_m(tested.claim.at)
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
