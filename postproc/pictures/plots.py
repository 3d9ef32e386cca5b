"""A run as a printed page: the plan, level against distance, levels over time."""

from pathlib import Path

from logger.core.errors import ConfigError

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise ConfigError("pictures need matplotlib: install cellwalk[post]") from error

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.ticker import LogLocator, NullFormatter

from logger.core.pathloss import log_distance_db
from logger.core.timebase import utc_text
from postproc.estimators.batch import fit_linear
from postproc.pictures import colours
from postproc.pictures.picture import Levels, Picture, headline, picture_of
from postproc.pictures.plots_plan import draw_plan, rgb, verbatim
from postproc.smooth import Smoothed
from postproc.whole_file import whole_file

_DPI = 150
_SIZE_INCH = (11.7, 8.3)
_MOST_CELLS = 12


def draw_run(smoothed: Smoothed, path: Path) -> None:
    """One page for the focus cell, format by the suffix (.png, .svg, .pdf); raises `RunFileError` or `ConfigError`."""
    kind = path.suffix[1:].lower() or "png"
    figure = figure_of(smoothed)
    known = figure.canvas.get_supported_filetypes()
    if kind not in known:
        raise ConfigError(f"{path}: a picture ends in {', '.join('.' + name for name in sorted(known))}")
    with whole_file(path) as part:
        figure.savefig(part, format=kind, dpi=_DPI)


def figure_of(smoothed: Smoothed) -> Figure:
    """The page as a figure, drawn without a screen."""
    picture = picture_of(smoothed)
    figure = Figure(figsize=_SIZE_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(_title(picture), fontsize=11, ha="left", x=0.01)
    axes = figure.subplot_mosaic([["plan", "distance"], ["plan", "time"]], width_ratios=[1.25, 1.0])
    draw_plan(figure, axes["plan"], picture)
    _level_by_distance(axes["distance"], picture)
    _levels_over_time(axes["time"], picture)
    return figure


def _title(picture: Picture) -> str:
    """Cell, run and verdict; what is simulated says so."""
    run, focus = picture.run, picture.focus
    simulated = "SIMULATED run" if run.meta.truth else "run"
    cell = f"Cell {focus.cell}, {focus.n} readings" if focus else "No cell"
    lines = [f"{cell} - {simulated} {run.path.name}"]
    lines += [headline(focus)] if focus else []
    if focus is not None and focus.posterior is not None and focus.verdict == "cannot tell":
        lines.append(f"the 95 % radius around the likeliest place is {focus.posterior.r95_m:.0f} m")
    lines += picture.smoothed.warnings
    return verbatim("\n".join(part for line in lines for part in textwrap.wrap(line, 150)))


def _level_by_distance(axes: Axes, picture: Picture) -> None:
    """Readings against the distance from the best place, and the path loss that fits them there."""
    axes.set_title("level by distance from the best place", fontsize=9)
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is None or not len(picture.heard_dbm):
        _empty(axes, "no place to measure the distance from")
        return
    offset = picture.heard_m - picture.local(np.array([posterior.x_m]), np.array([posterior.y_m]))
    away_db = log_distance_db(offset[:, 0], offset[:, 1])
    axes.semilogx(10.0 ** (0.1 * away_db), picture.heard_dbm, ".", color=rgb(colours.QUIET), markersize=3)
    (p0_dbm, eta), _ = fit_linear(away_db, picture.heard_dbm)
    scatter_db = float(np.std(picture.heard_dbm - p0_dbm + eta * away_db))
    ends_db = np.array([away_db.min(), away_db.max()])
    ends_m, model = 10.0 ** (0.1 * ends_db), p0_dbm - eta * ends_db
    blue, label = rgb(colours.POSTERIOR), f"{p0_dbm:.0f} dBm - {eta:.2f} x 10 lg(d / 1 m), scatter {scatter_db:.1f} dB"
    axes.plot(ends_m, model, color=blue, label=label)
    axes.fill_between(ends_m, model - scatter_db, model + scatter_db, color=blue, alpha=0.15, linewidth=0)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("distance (m)")
    axes.set_ylabel("level (dBm)")
    axes.grid(visible=True, which="both", alpha=0.25)
    _legend_below(axes)


def _levels_over_time(axes: Axes, picture: Picture) -> None:
    """Levels of the cells heard most, the focus in front."""
    timebase = picture.clock.timebase
    started = utc_text(timebase.utc_ns(picture.clock.started_ns)) if timebase else "the start (date unknown)"
    axes.set_title("levels over time", fontsize=9)
    if not picture.levels:
        _empty(axes, "no level was read")
        return
    name = picture.focus.cell if picture.focus else None
    others = [levels for levels in picture.levels if levels.cell != name][:_MOST_CELLS]
    for i, levels in enumerate(others):
        colour = rgb(colours.OTHERS[i % len(colours.OTHERS)])
        axes.plot(_minutes(picture, levels), levels.level_dbm, ".", color=colour, markersize=1.5, alpha=0.6)
    for levels in picture.levels:
        if levels.cell == name:
            label = verbatim(f"cell {name}")
            axes.plot(_minutes(picture, levels), levels.level_dbm, color=rgb(colours.WALKER), linewidth=1, label=label)
    if others:
        left_out = len(picture.levels) - len(others) - any(levels.cell == name for levels in picture.levels)
        label = f"{len(others)} other cells" + (f", {left_out} more left out" if left_out else "")
        axes.plot([], [], ".", color=rgb(colours.OTHERS[0]), label=label)
    axes.set_xlabel(f"minutes since {started}")
    axes.set_ylabel("level (dBm)")
    axes.grid(visible=True, alpha=0.25)
    _legend_below(axes)


def _minutes(picture: Picture, levels: Levels) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(picture.clock.elapsed_ns(levels.t_ns) / 60e9, float)


def _legend_below(axes: Axes) -> None:
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, fontsize=8, frameon=False)


def _empty(axes: Axes, why: str) -> None:
    axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes)
    axes.set_axis_off()
