"""The pictures of a cell."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import consistency
from postproc.pictures import colours
from postproc.pictures.picture import ETA, P0, Fit, Picture, fit_of
from postproc.pictures.plots import (
    DASHED,
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
from postproc.report import alt_text
from postproc.verification.verdicts import CellVerdict

WIDTH_INCH = 4.0
"""Narrow, so that texts have 11 pixels or more on a telephone of 390."""
_BESIDE_INCH = 0.85
_ABOVE_INCH = 1.5
"""Space for the labels beside a plan, and for those above and below it."""


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
        text = alt_text.plan(picture, claims)
        yield ReportFigure("plan", "Plan", _plan(picture, picture.box, claims), text)
    fit = fit_of(focus)
    if fit is not None:
        text = alt_text.distance(fit)
        yield ReportFigure("distance", "Level by distance", _distance(fit), text)
    if len(picture.survey.walks) > 1:
        return
    yield ReportFigure("levels", "Levels over time", _levels(picture), alt_text.levels(picture))
    if focus.posterior is not None and focus.ekf is not None and len(focus.ekf):
        text = alt_text.path_loss(picture)
        yield ReportFigure("path-loss", "Path loss over time", _path_loss(picture), text)
        yield from _consistency(picture.survey.clock, focus.ekf)


def overview(rows: Sequence[Levels | None], clock: Clock) -> ReportFigure | None:
    """Levels of all cells over time, a row each; None where no level was read."""
    strips = strips_of(rows, clock)
    if strips is None:
        return None
    figure = figure_of_size(2.0 * WIDTH_INCH, 1.3 + 0.2 * len(rows))
    draw_strips(figure, figure.subplots(), strips)
    title, text = "Levels of all cells over time", alt_text.strips(strips)
    return ReportFigure("overview", title, figure, text)


def _plan(picture: Picture, box: Box, claims: Sequence[CellVerdict]) -> Figure:
    figure = figure_of_size(WIDTH_INCH, WIDTH_INCH)
    axes = figure.subplots()
    for claim in claims:
        _draw_claim(axes, picture, box, claim)
    box = draw_plan(figure, axes, picture) or box
    # the plan is to scale, so the walk determines its height
    plan_inch = (WIDTH_INCH - _BESIDE_INCH) * box.height / box.width
    legends = (legend.get_window_extent().height / figure.dpi for legend in figure.legends)
    figure.set_size_inches(WIDTH_INCH, plan_inch + _ABOVE_INCH + sum(legends))
    return figure


def _draw_claim(axes: Axes, picture: Picture, box: Box, tested: CellVerdict) -> None:
    """A claimed position, with a circle of 2 sigma where it has one."""
    claim = tested.claim
    east_m, north_m = picture.survey.position_m(claim.lat_deg, claim.lon_deg).tolist()
    ink = rgb(colours.INK)
    marker = "X" if tested.verdict == "rejected" else "D"
    fill = colours.PAPER if tested.verdict == "cannot tell" else colours.INK
    label = f"claimed position: {tested.verdict}{outside_note(box, east_m, north_m)}"
    style = {"markeredgecolor": ink, "label": label, "zorder": 10}
    draw_marks(axes, east_m, north_m, marker, fill, 6, **style)
    radius_m = 2.0 * claim.sigma_m
    if radius_m > 0.0 and box.enlarge(radius_m).contains(east_m, north_m):
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
    text = alt_text.consistency(ekf, tested)
    yield ReportFigure("consistency", "Is the EKF consistent?", figure, text)
