"""Printed levels: by distance, with the residuals of the model, and over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from logger.core.arrays import FloatArray
from postproc.pictures import colours
from postproc.pictures.fit import Fit
from postproc.pictures.picture import Picture
from postproc.pictures.plots_style import DASHED, MOST_VECTORS, draw_marks, draw_message, rgb

_MOST_LINE_POINTS = 10 * MOST_VECTORS
"""A line is one path of many corners: it may have more of them than there may be dots."""


def draw_distance(axes: Axes, fit: Fit | None) -> None:
    """Readings by their distance from the most likely position, and the path loss from there."""
    axes.set_title("level by distance from the most likely position")
    if fit is None:
        draw_message(axes, "no position to measure the distance from")
        return
    _draw_dots(axes, fit.distance_m, fit.level_dbm, fit)
    limits_m = np.array([fit.distance_m.min(), fit.distance_m.max()])
    model_dbm, blue = fit.model_dbm(limits_m), rgb(colours.POSTERIOR)
    label = f"{fit.p0_dbm:.0f} dBm - {fit.eta:.2f} x 10 lg(d / 1 m)"
    axes.plot(limits_m, model_dbm, color=blue, label=label)
    if np.isfinite(fit.sigma_db):
        label = f"± {fit.sigma_db:.1f} dB standard deviation"
        low, high = model_dbm - fit.sigma_db, model_dbm + fit.sigma_db
        axes.fill_between(limits_m, low, high, color=blue, alpha=0.18, linewidth=0, label=label)
    _scale_by_distance(axes)
    axes.set_ylabel("level (dBm)")


def draw_residuals(axes: Axes, fit: Fit) -> None:
    """Level minus model, with two standard deviations."""
    _draw_dots(axes, fit.distance_m, fit.residual_db, fit)
    blue = rgb(colours.POSTERIOR)
    axes.axhline(0.0, color=blue, linewidth=1.2)
    for limit_db in (-2.0 * fit.sigma_db, 2.0 * fit.sigma_db):
        axes.axhline(limit_db, color=blue, linewidth=0.8, linestyle=DASHED)
    _scale_by_distance(axes)
    axes.set_ylabel("residual (dB)")


def draw_levels(axes: Axes, picture: Picture, most_others: int = 12) -> None:
    """Levels of the cell over time, and behind it those of the other cells observed most often."""
    clock = picture.survey.clock
    axes.set_title("levels over time")
    by_cell = [levels for walk in picture.survey.walks for levels in walk.levels]
    if not by_cell:
        draw_message(axes, "no level was read")
        return
    name = picture.focus.cell if picture.focus else None
    others = [levels for levels in by_cell if levels.cell != name]
    for i, levels in enumerate(others[:most_others]):
        ink = colours.OTHERS[i % len(colours.OTHERS)]
        minutes = clock.minutes(levels.t_ns)
        draw_marks(axes, minutes, levels.level_dbm, ".", ink, 1.5, alpha=0.5, rasterized=True)
    for levels in by_cell:
        if levels.cell == name:
            minutes, many = clock.minutes(levels.t_ns), len(levels.t_ns) > _MOST_LINE_POINTS
            blue = rgb(colours.WALKER)
            (curve,) = axes.plot(minutes, levels.level_dbm, color=blue, linewidth=1)
            curve.set(label="this cell", rasterized=many)
    if shown := min(len(others), most_others):
        left_out = len(others) - shown
        label = f"{shown} other cells" + (f", {left_out} more not shown" if left_out else "")
        axes.plot([], [], ".", color=rgb(colours.OTHERS[0]), label=label)
    axes.set_xlabel(f"minutes since {clock.start_text() or 'the start (date unknown)'}")
    axes.set_ylabel("level (dBm)")


def _draw_dots(axes: Axes, distance_m: FloatArray, value: FloatArray, fit: Fit) -> None:
    """Readings, those at a limit of the modem's scale as triangles."""
    many = len(value) > MOST_VECTORS
    draw_marks(axes, distance_m, value, ".", colours.QUIET, 3, rasterized=many)
    censored = ~fit.uncensored
    if np.any(censored):
        label = f"{np.count_nonzero(censored)} at a limit of the modem's scale"
        draw_marks(axes, distance_m[censored], value[censored], "v", colours.BATCH, 3, label=label)


def _scale_by_distance(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("distance (m)")
