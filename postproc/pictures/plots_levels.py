"""Levels on paper: by distance, with what the model leaves over, and over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from logger.core.arrays import FloatArray
from logger.core.utc import utc_text
from postproc.pictures import colours
from postproc.pictures.fit import Fit
from postproc.pictures.picture import Picture
from postproc.pictures.plots_style import MOST_VECTORS, empty, rgb


def draw_distance(axes: Axes, fit: Fit | None) -> None:
    """Readings against the distance from the strongest place, and the path loss that holds
    there.
    """
    axes.set_title("level by distance from the strongest place")
    if fit is None:
        empty(axes, "no place to measure the distance from")
        return
    _dots(axes, fit.distance_m, fit.level_dbm, fit)
    ends_m = np.array([fit.distance_m.min(), fit.distance_m.max()])
    model, blue = fit.model_dbm(ends_m), rgb(colours.POSTERIOR)
    label = f"{fit.p0_dbm:.0f} dBm - {fit.eta:.2f} x 10 lg(d / 1 m)"
    axes.plot(ends_m, model, color=blue, label=label)
    if np.isfinite(fit.scatter_db):
        band = f"scatter {fit.scatter_db:.1f} dB"
        low, high = model - fit.scatter_db, model + fit.scatter_db
        axes.fill_between(ends_m, low, high, color=blue, alpha=0.18, linewidth=0, label=band)
    _by_distance(axes)
    axes.set_ylabel("level (dBm)")


def draw_residuals(axes: Axes, fit: Fit) -> None:
    """What the model leaves over."""
    _dots(axes, fit.distance_m, fit.residual_db, fit)
    axes.axhline(0.0, color=rgb(colours.POSTERIOR), linewidth=1.2)
    for side in (-2.0, 2.0):
        axes.axhline(
            side * fit.scatter_db,
            color=rgb(colours.POSTERIOR),
            linewidth=0.8,
            linestyle=(0, (4, 3)),
        )
    _by_distance(axes)
    axes.set_ylabel("residual (dB)")


def draw_levels(axes: Axes, picture: Picture, most_others: int = 12) -> None:
    """Levels of the focus, and behind it those of the other cells heard most."""
    timebase = picture.clock.timebase
    started = (
        utc_text(timebase.utc_ns(picture.clock.started_ns))
        if timebase
        else "the start (date unknown)"
    )
    axes.set_title("levels over time")
    if not picture.levels:
        empty(axes, "no level was read")
        return
    name = picture.focus.cell if picture.focus else None
    others = [levels for levels in picture.levels if levels.cell != name][:most_others]
    for i, levels in enumerate(others):
        colour = rgb(colours.OTHERS[i % len(colours.OTHERS)])
        minutes = picture.clock.minutes(levels.t_ns)
        axes.plot(
            minutes, levels.level_dbm, ".", color=colour, markersize=1.5, alpha=0.5, rasterized=True
        )
    for levels in picture.levels:
        if levels.cell == name:
            many = len(levels.t_ns) > 10 * MOST_VECTORS
            minutes = picture.clock.minutes(levels.t_ns)
            axes.plot(
                minutes,
                levels.level_dbm,
                color=rgb(colours.WALKER),
                linewidth=1,
                label="this cell",
                rasterized=many,
            )
    if others:
        left_out = (
            len(picture.levels)
            - len(others)
            - any(levels.cell == name for levels in picture.levels)
        )
        label = f"{len(others)} other cells" + (f", {left_out} more left out" if left_out else "")
        axes.plot([], [], ".", color=rgb(colours.OTHERS[0]), label=label)
    axes.set_xlabel(f"minutes since {started}")
    axes.set_ylabel("level (dBm)")
    axes.grid(visible=True)


def _dots(axes: Axes, distance_m: FloatArray, value: FloatArray, fit: Fit) -> None:
    many = len(value) > MOST_VECTORS
    axes.plot(distance_m, value, ".", color=rgb(colours.QUIET), markersize=3, rasterized=many)
    if not np.all(fit.within):
        at_end = ~fit.within
        label = f"{np.count_nonzero(at_end)} at the end of the modem's scale"
        axes.plot(
            distance_m[at_end],
            value[at_end],
            "v",
            color=rgb(colours.BATCH),
            markersize=3,
            label=label,
        )


def _by_distance(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("distance (m)")
    axes.grid(visible=True)
