"""The pictures of a cell."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from postproc.estimators.metrics import consistency
from postproc.json_text import Json
from postproc.pictures import colours
from postproc.pictures.fit import fit_of
from postproc.pictures.picture import Clock, Levels, Picture
from postproc.pictures.plots_filter import ETA, P0, draw_autocorrelation, draw_nis, draw_parameter
from postproc.pictures.plots_levels import draw_distance, draw_levels, draw_residuals
from postproc.pictures.plots_plan import beyond, draw_plan
from postproc.pictures.plots_style import figure_of_size, legend_below, rgb
from postproc.pictures.strips import draw_strips, strips_of
from postproc.report import alt_text
from postproc.verification.run_claims import CellVerdict

_WIDE_INCH = 4.6
"""Narrow, so that its words can be read on a telephone too."""
_BESIDE_INCH = 0.85
_ABOVE_INCH = 1.5
"""Room for the words beside a plan, and for those above and below it."""


class Drawn(NamedTuple):
    """A picture, its name among those of a cell, its title, and what is seen on it."""

    name: str
    title: str
    figure: Figure
    seen: str


def pictures_of(
    picture: Picture, found: Json, claims: Sequence[CellVerdict] = (), *, over_time: bool = True
) -> Iterator[Drawn]:
    """What there is to see of the cell looked at; `found` is its part of `results.summary`,
    `claims` those about it.
    """
    focus = picture.focus
    if focus is None:
        return
    if picture.box is not None:
        yield Drawn("plan", "Plan", _plan(picture, claims), alt_text.plan(picture, found, claims))
    fit = fit_of(focus)
    if fit is not None:
        figure = figure_of_size(_WIDE_INCH, 4.6)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        draw_distance(above, fit)
        draw_residuals(below, fit)
        above.set(title="", xlabel="")
        legend_below(figure, above)
        yield Drawn("distance", "Level by distance", figure, alt_text.distance(fit))
    if over_time:
        yield _levels(picture)
        yield from _filters(picture)


def overview(rows: Sequence[Levels | None], clock: Clock) -> Drawn | None:
    """Levels of all cells over time, a row each; None where no level was read."""
    found = strips_of(rows, clock)
    if found is None:
        return None
    figure = figure_of_size(2.0 * _WIDE_INCH, 1.3 + 0.2 * len(rows))
    draw_strips(figure, figure.subplots(), found)
    return Drawn("overview", "Which cell was heard when", figure, alt_text.strips(found))


def _plan(picture: Picture, claims: Sequence[CellVerdict]) -> Figure:
    figure = figure_of_size(_WIDE_INCH, _WIDE_INCH)
    axes = figure.subplots()
    _claims(axes, picture, claims)
    draw_plan(figure, axes, picture)
    if picture.box is not None:  # to scale, so that its shape follows from that of the walk
        plan_inch = (_WIDE_INCH - _BESIDE_INCH) * picture.box.height / picture.box.width
        legends_inch = (
            sum(legend.get_window_extent().height for legend in figure.legends) / figure.dpi
        )
        figure.set_size_inches(_WIDE_INCH, plan_inch + _ABOVE_INCH + legends_inch)
    return figure


def _claims(axes: Axes, picture: Picture, claims: Sequence[CellVerdict]) -> None:
    """Claimed places, with 2 sigma where they have one."""
    for one in claims:
        if picture.track is None or picture.box is None:
            return
        x_m, y_m = picture.track.utm.to_xy(one.claim.lat_deg, one.claim.lon_deg)
        east, north = picture.local(np.array([x_m]), np.array([y_m]))[0].tolist()
        ink, fill = (
            rgb(colours.INK),
            rgb(colours.PAPER if one.verdict == "cannot tell" else colours.INK),
        )
        label = f"claimed place: {one.verdict}{beyond(picture.box, east, north)}"
        marker = "X" if one.verdict == "rejected" else "D"
        axes.plot(
            east,
            north,
            marker,
            color=fill,
            markeredgecolor=ink,
            markersize=6,
            label=label,
            zorder=10,
        )
        radius_m = 2.0 * one.claim.sigma_m
        if radius_m > 0.0 and picture.box.wider(radius_m).holds(east, north):
            axes.add_patch(
                Circle(
                    (east, north),
                    radius_m,
                    fill=False,
                    edgecolor=ink,
                    linestyle=(0, (4, 3)),
                    zorder=5,
                )
            )


def _levels(picture: Picture) -> Drawn:
    figure = figure_of_size(_WIDE_INCH, 2.9)
    axes = figure.subplots()
    draw_levels(axes, picture, most_others=0)
    axes.set_title("")
    return Drawn("levels", "Levels over time", figure, alt_text.levels(picture))


def _filters(picture: Picture) -> Iterator[Drawn]:
    """Path loss as the EKF learned it, and whether that is to be trusted."""
    focus = picture.focus
    if focus is None or focus.posterior is None or focus.ekf is None or not len(focus.ekf):
        return
    figure = figure_of_size(_WIDE_INCH, 4.2)
    above, below = figure.subplots(2, 1, sharex=True)
    draw_parameter(above, picture, P0)
    draw_parameter(below, picture, ETA)
    below.set_xlabel("minutes since the start")
    legend_below(figure, above, below)
    yield Drawn("path-loss", "Path loss as it was learned", figure, alt_text.path_loss(picture))
    told = focus.ekf.consistency or consistency(
        focus.ekf.innovation_db, focus.ekf.innovation_var_db2
    )
    if told.autocorrelation:
        figure = figure_of_size(_WIDE_INCH, 4.6)
        above, below = figure.subplots(2, 1)
        draw_nis(above, picture, focus.ekf)
        draw_autocorrelation(below, told)
        legend_below(figure, above, below)
        yield Drawn(
            "consistency",
            "Does the EKF know its errors?",
            figure,
            alt_text.consistency(focus.ekf, told),
        )
