"""A run as a printed page: the plan, level against distance, levels over time."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Ellipse, PathPatch, Rectangle
from matplotlib.path import Path as Outline
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from logger.core.arrays import FloatArray
from logger.core.certainty import metres
from postproc.atomic_write import kind_of, whole_file
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, Consistency
from postproc.notebook_plan import length_text, round_step
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import (
    Fit,
    Parameter,
    Picture,
    Rings,
    colour_range_dbm,
    fit_of,
    focus_of,
    headline,
    legend_of,
    mode_labels,
    picture_of,
)
from postproc.pictures.survey import (
    Box,
    Clock,
    Inset,
    Levels,
    Survey,
    evenly_spaced,
    survey_of,
    with_inset,
)
from postproc.result import RTS, Estimate, Result

MOST_VECTORS = 400
"""More dots or corners than this are drawn as pixels, whose number is bounded."""
PIXELS_PER_INCH = 150
DASHED: Any = (0, (4, 3))

_PADDING_INCH = 0.09
_LETTERS_PER_INCH = 12.5
_LETTERS_OF_A_SYMBOL = 5.0
"""Widths in a legend at its font size: average letters per inch, and the symbol before a name."""


def rgb(colour: Colour) -> tuple[float, float, float]:
    """A colour in the units of matplotlib."""
    red, green, blue = colour
    return red / 255.0, green / 255.0, blue / 255.0


def verbatim(text: str) -> str:
    """Text without formulas (dollar signs) and control characters."""
    printable = (c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return "".join(printable).replace("$", r"\$")


SMALLEST_POINTS = 9.5
STYLE: Any = {
    "font.size": 10.0,
    "text.color": rgb(colours.INK),
    "axes.edgecolor": rgb(colours.MUTED),
    "axes.grid": True,
    "axes.labelcolor": rgb(colours.INK),
    "axes.titlecolor": rgb(colours.INK),
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": rgb(colours.GRID),
    "grid.linewidth": 0.6,
    "xtick.color": rgb(colours.MUTED),
    "ytick.color": rgb(colours.MUTED),
    "xtick.labelcolor": rgb(colours.INK),
    "ytick.labelcolor": rgb(colours.INK),
    "xtick.labelsize": SMALLEST_POINTS,
    "ytick.labelsize": SMALLEST_POINTS,
    "legend.fontsize": SMALLEST_POINTS,
    "legend.frameon": False,
    "svg.hashsalt": "cellwalk",
}
"""Settings of matplotlib; with the salt the same picture has the same bytes."""


def figure_of_size(width_inch: float, height_inch: float) -> Figure:
    """An empty figure, without a screen."""
    layout = ConstrainedLayoutEngine(h_pad=_PADDING_INCH)
    return Figure(figsize=(width_inch, height_inch), layout=layout)


def legend_below(figure: Figure | SubFigure, *axes: Axes) -> None:
    """One legend below the figure, each name once, in two columns where every name fits."""
    artists: dict[str, Artist] = {}
    for handles, labels in (part.get_legend_handles_labels() for part in axes):
        artists |= zip(labels, handles, strict=True)
    if not artists:
        return
    width_inch = figure.bbox.width / figure.dpi
    most_letters = width_inch * _LETTERS_PER_INCH / 2.0 - _LETTERS_OF_A_SYMBOL
    columns = 2 if max(map(len, artists)) <= most_letters else 1
    letters = int(width_inch * _LETTERS_PER_INCH - 2.0 * _LETTERS_OF_A_SYMBOL)  # of wide ones
    figure.legend(
        handles=list(artists.values()),
        labels=[textwrap.fill(name, letters) for name in artists],
        loc="outside lower left",
        ncols=columns,
    )


def draw_marks(
    axes: Axes, x: Any, y: Any, marker: str, colour: Colour, size: float, **style: Any
) -> None:
    """Marks at positions, of a size in points; `style` as for `Axes.plot`."""
    axes.plot(x, y, marker, color=rgb(colour), markersize=size, **style)


_LEVEL_COLOURS = ListedColormap(colours.level_scale(256) / 255.0)


def level_bar(
    figure: Figure | SubFigure, axes: Axes, mappable: ScalarMappable, ticks: int, **place: Any
) -> None:
    """The colour scale of levels beside a plot."""
    bar = figure.colorbar(mappable, ax=axes, label="level (dBm)", extend="both", **place)
    bar.locator = MaxNLocator(ticks, integer=True)
    bar.outline.set_visible(False)


def draw_message(axes: Axes, text: str) -> None:
    """State why there is nothing to show."""
    axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes)
    axes.set_axis_off()


_MOST_INTERVALS = 240
"""More would be narrower than a pixel on a telephone."""


class Strips(NamedTuple):
    """Mean level of each cell in each interval, shape (cells, intervals); NaN without a reading."""

    level_dbm: FloatArray
    minutes: float


def strips_of(rows: Sequence[Levels | None], clock: Clock) -> Strips | None:
    """Mean levels of cells over equal intervals from the start to the last reading.

    None without a reading.
    """
    minutes = [np.empty(0) if row is None else clock.minutes(row.t_ns) for row in rows]
    end = max((float(times.max()) for times in minutes if len(times)), default=0.0)
    if end <= 0.0:
        return None
    # two readings of the cell read most often fit in an interval: a gap then is a real silence
    most_readings = max(map(len, minutes))
    count = int(np.clip(most_readings // 2, 1, _MOST_INTERVALS))
    level_dbm = np.full((len(rows), count), np.nan)
    for i, (row, times) in enumerate(zip(rows, minutes, strict=True)):
        if row is not None:
            interval = np.clip((times / end * count).astype(np.int64), 0, count - 1)
            n_readings = np.bincount(interval, minlength=count)
            has_reading = n_readings > 0
            sums = np.bincount(interval, row.level_dbm, count)
            level_dbm[i, has_reading] = sums[has_reading] / n_readings[has_reading]
    return Strips(level_dbm, end)


def draw_strips(figure: Figure, axes: Axes, strips: Strips) -> None:
    """One row for each cell, numbered from 1 at the top."""
    low_dbm, high_dbm = colour_range_dbm(strips.level_dbm)
    image = axes.imshow(
        strips.level_dbm,
        aspect="auto",
        interpolation="nearest",
        extent=(0.0, strips.minutes, len(strips.level_dbm) + 0.5, 0.5),
        cmap=_LEVEL_COLOURS,
        vmin=low_dbm,
        vmax=high_dbm,
    )
    level_bar(figure, axes, image, 4, aspect=12)
    axes.grid(visible=False)
    axes.yaxis.set_major_locator(MaxNLocator(10, integer=True, min_n_ticks=1))
    axes.set_xlabel("minutes since the start")
    axes.set_ylabel("cell no.")


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
    by_cell = picture.survey.levels
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


_LEAST_NIS = 1e-4
"""Smaller values are drawn here: a logarithmic axis has no zero."""


def draw_parameter(axes: Axes, picture: Picture, parameter: Parameter) -> None:
    """P0 or eta of the EKF over time, and of the posterior after the walk, with 2 sigma."""
    focus = picture.focus
    if focus is None or focus.posterior is None:
        return
    mean, sigma = parameter.of_posterior(focus.posterior)
    blue, orange = rgb(colours.POSTERIOR), rgb(colours.EKF)
    axes.axhspan(mean - 2.0 * sigma, mean + 2.0 * sigma, color=blue, alpha=0.13, linewidth=0)
    axes.axhline(mean, color=blue, linewidth=1.2, label="posterior after the walk, ± 2 sigma")
    if focus.ekf is not None:
        shown = evenly_spaced(len(focus.ekf), MOST_VECTORS)
        minutes = picture.survey.clock.minutes(focus.ekf.t_ns[shown])
        value, sigmas = parameter.of_states(focus.ekf.x[shown], focus.ekf.p[shown])
        low, high = value - 2.0 * sigmas, value + 2.0 * sigmas
        axes.fill_between(minutes, low, high, color=orange, alpha=0.22, linewidth=0)
        axes.plot(minutes, value, color=orange, linewidth=1.2, label="EKF, ± 2 sigma")
    axes.set_ylabel(f"{parameter.name} ({parameter.unit})" if parameter.unit else parameter.name)


def draw_nis(axes: Axes, clock: Clock, filtered: FilterPath) -> None:
    """Normalised innovations squared: 95 % of a consistent filter's are below the line."""
    axes.set_title("normalised innovations squared (NIS)")
    with np.errstate(divide="ignore", invalid="ignore"):
        nis = filtered.nis
    finite = np.isfinite(nis)
    minutes, values = clock.minutes(filtered.t_ns[finite]), np.maximum(nis[finite], _LEAST_NIS)
    many = len(values) > MOST_VECTORS
    axes.plot(minutes, values, ".", color=rgb(colours.EKF), markersize=3, rasterized=many)
    green, label = rgb(colours.BOUNDS[0]), f"95 % bound, {NIS_95:g}"
    axes.axhline(NIS_95, color=green, linewidth=1.2, linestyle=DASHED, label=label)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("minutes since the start")
    axes.set_ylabel("NIS")


def draw_autocorrelation(axes: Axes, consistency: Consistency) -> None:
    """Autocorrelation of the innovations: white noise stays within the band at 95 % of the lags."""
    axes.set_title("autocorrelation of the innovations")
    values, bound = consistency.autocorrelation, consistency.white_bound
    green, label = rgb(colours.BOUNDS[0]), "95 % of white noise"
    axes.axhspan(-bound, bound, color=green, alpha=0.2, linewidth=0, label=label)
    lags = np.arange(1, len(values) + 1)
    axes.vlines(lags, 0.0, values, color=rgb(colours.EKF), linewidth=2.5)
    axes.axhline(0.0, color=rgb(colours.MUTED), linewidth=0.8)
    largest = max(map(abs, values), default=0.0)
    limit = min(1.1 * max(largest, 2.0 * bound, 0.2), 1.1)
    axes.set_ylim(-limit, limit)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("lag (readings)")


_MOST_CORNERS = 5000
"""Of a strip of the track: more cannot be distinguished on paper."""
_SCALE_PARTS = 5
"""The scale bar is the shortest round length of which at most this many fit on the plan."""
_STREET_POINTS = 5.0
_FAR_M = 10_000.0
"""Distances beyond this are not printed in metres."""


def draw_plan(figure: Figure | SubFigure, axes: Axes, picture: Picture) -> Box | None:
    """The walk, the regions, and the transmitter's position by each estimator.

    Returns what the plan shows, with room for an inset that enlarges a small answer; None without a
    fix.
    """
    if picture.box is None:
        draw_message(axes, "no position fix")
        return None
    answer_m = np.vstack(picture.regions["95"]) if picture.regions else None
    box, inset = with_inset(picture.box, answer_m, picture.survey.track_m)
    draw_ground(axes, box)
    draw_walks(figure, axes, picture)
    _draw_posterior(axes, picture, box)
    for estimate in picture.estimates:
        if estimate.estimator != RTS:  # of a transmitter at rest it is the EKF's last state
            _draw_estimate(axes, estimate, box)
    _draw_truth(axes, picture, box)
    if inset is not None:
        enlarged = draw_inset(axes, inset, picture)
        draw_readings(enlarged, picture)
        _draw_posterior(enlarged, picture, inset[0])
        _draw_truth(enlarged, picture, inset[0])
    legend_below(figure, axes)
    return box


def _draw_truth(axes: Axes, picture: Picture, box: Box) -> None:
    if picture.truth_m is not None:
        label = "truth (simulated)" + outside_note(box, picture.truth_m)
        east_m, north_m = picture.truth_m
        draw_marks(axes, east_m, north_m, "*", colours.TRUTH, 13, label=label, zorder=9)


def draw_inset(axes: Axes, inset: Inset, picture: Picture) -> Axes:
    """Axes in a frame on the plan, with the streets and the tracks, and what they enlarge."""
    (shown, frame), ink = inset, rgb(colours.INK)
    where = (frame.west, frame.south, frame.width, frame.height)
    enlarged = axes.inset_axes(where, transform=axes.transData, zorder=11)
    enlarged.set_xlim(shown.west, shown.east)
    enlarged.set_ylim(shown.south, shown.north)
    enlarged.set(xticks=[], yticks=[], facecolor=rgb(colours.PAPER))
    enlarged.spines[:].set(visible=True, color=ink, linewidth=1.0)
    draw_streets(enlarged, picture.survey)
    _draw_tracks(enlarged, picture)
    _draw_scale_bar(enlarged, shown)
    corner = (shown.west, shown.south)
    square = Rectangle(corner, shown.width, shown.height, fill=False, edgecolor=ink, linewidth=0.8)
    axes.add_patch(square).set_zorder(6)
    ends = ([frame.west, shown.west], [frame.east, shown.east])
    north = frame.north if frame.north < shown.south else frame.south
    edge = shown.south if frame.north < shown.south else shown.north
    for ends_x in ends:
        axes.plot(ends_x, [north, edge], color=ink, linewidth=0.5, alpha=0.6, zorder=6)
    return enlarged


def draw_streets(axes: Axes, survey: Survey) -> None:
    """The streets of a simulated world as far as the axes show them, labelled as such."""
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    style: dict[str, Any] = {"color": rgb(colours.GRID), "linewidth": _STREET_POINTS}
    style |= {"solid_capstyle": "butt", "zorder": 1}
    for i, street_m in enumerate(survey.streets_m):
        seen = shapely.clip_by_rect(shapely.LineString(street_m), west, south, east, north)
        label = "_nolegend_" if i else "streets of the simulation"
        axes.plot(*shapely.get_coordinates(seen).T, label=label, **style)
        axes.grid(visible=False)


def outside_note(box: Box, position_m: FloatArray) -> str:
    """Remark in a legend on a position (2,) outside the plan; empty for one inside."""
    if box.contains(position_m):
        return ""
    distance_m = float(np.hypot(*(position_m - np.clip(position_m, *box.corners_m))))
    return f", {metres(distance_m) if distance_m < _FAR_M else 'far'} outside the plan"


def draw_ground(axes: Axes, box: Box) -> None:
    """Axes to scale in metres, an arrow to the north and a scale bar."""
    axes.set_aspect("equal")
    axes.set_xlim(box.west, box.east)
    axes.set_ylim(box.south, box.north)
    axes.set_xlabel("east of the first fix (m)")
    axes.set_ylabel("north of the first fix (m)")
    arrow = {"arrowstyle": "->", "color": rgb(colours.INK)}
    north = axes.annotate(
        "N", (0.04, 0.97), (0.04, 0.87), xycoords="axes fraction", arrowprops=arrow
    )
    north.set(ha="center", va="center", zorder=10)
    _draw_scale_bar(axes, box)


def _draw_scale_bar(axes: Axes, box: Box) -> None:
    length_m = round_step(box.size, _SCALE_PARTS)
    west, south = box.east - 0.03 * box.width - length_m, box.south + 0.03 * box.height
    ends = [west, west + length_m], [south, south]
    axes.plot(*ends, color=rgb(colours.INK), linewidth=2.5, solid_capstyle="butt", zorder=10)
    middle = (west + length_m / 2, south)
    label = axes.annotate(length_text(length_m), middle, (0, 4), textcoords="offset points")
    label.set(ha="center", fontsize=SMALLEST_POINTS, zorder=10)


def draw_walks(figure: Figure | SubFigure, axes: Axes, picture: Picture) -> None:
    """The tracks on their streets, their ends, and the readings coloured by their level."""
    draw_streets(axes, picture.survey)
    _draw_tracks(axes, picture)
    ink = rgb(colours.INK)
    for walk in picture.survey.walks:
        for which, row, marker in (("start", 0, "o"), ("end", -1, "s")):
            if len(walk.track_m):
                x_m, y_m = walk.track_m[row]
                style = {"markeredgecolor": ink, "label": f"{which} of the walk", "zorder": 5}
                draw_marks(axes, x_m, y_m, marker, colours.PAPER, 5, **style)
    if len(picture.readings_m):
        levels = draw_readings(axes, picture)
        level_bar(figure, axes, levels, 6, location="top", aspect=40)


def _draw_tracks(axes: Axes, picture: Picture) -> None:
    for walk in picture.survey.walks:
        for strip in walk.strips_m:
            corners = strip[evenly_spaced(len(strip), _MOST_CORNERS)]
            grey = rgb(colours.QUIET)
            axes.plot(*corners.T, color=grey, linewidth=1, alpha=0.6, zorder=2)


def draw_readings(axes: Axes, picture: Picture) -> ScalarMappable:
    """Readings as dots in the colours of their levels."""
    low_dbm, high_dbm = picture.level_range_dbm
    return axes.scatter(
        picture.readings_m[:, 0],
        picture.readings_m[:, 1],
        c=picture.level_dbm,
        s=7,
        linewidths=0,
        zorder=3,
        rasterized=True,
        cmap=_LEVEL_COLOURS,
        vmin=low_dbm,
        vmax=high_dbm,
    )


SIGNS = {"suspicious": "x", "unusual": "_"}
"""Marker in the mark of a cell of each word: its meaning does not hang on a colour."""
_MARKS = {"suspicious": ("o", 14.0), "unusual": ("D", 10.0)}


def draw_cell_mark(
    axes: Axes, position_m: FloatArray, word: str, colour: Colour, **style: Any
) -> None:
    """Where a cell is, in a shape and with the sign of its word; a dot without one."""
    marker, size = _MARKS.get(word, ("o", 7.0))
    east_m, north_m = position_m
    style |= {"markeredgecolor": rgb(colours.PAPER), "zorder": 8}
    draw_marks(axes, east_m, north_m, marker, colour, size, **style)
    if sign := SIGNS.get(word):
        within = {"markeredgewidth": 2.0, "zorder": 8.5}
        draw_marks(axes, east_m, north_m, sign, colours.PAPER, 0.45 * size, **within)


def draw_rings(axes: Axes, rings: Rings, colour: Colour, alpha: float, **style: Any) -> None:
    """A region by its outlines."""
    # holes run the other way round and stay empty
    path = Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings))
    ink = rgb(colour)
    style |= {"facecolor": (*ink, alpha), "edgecolor": ink, "zorder": 4}
    axes.add_patch(PathPatch(path, **style))


def _draw_posterior(axes: Axes, picture: Picture, box: Box) -> None:
    focus = picture.focus
    posterior = focus.posterior if focus else None
    if focus is None or posterior is None:
        return
    word = picture.survey.word(focus.cell)
    colour = colours.word_colour(word) if word in SIGNS else colours.POSTERIOR
    for name, alpha in (("95", 0.12), ("50", 0.25)):
        if rings := picture.regions[name]:
            inside = np.all(box.contains(np.vstack(rings)))
            label = f"{name} % region" + ("" if inside else " (extends outside)")
            draw_rings(axes, rings, colour, alpha, label=label)
    several = len(posterior.likely_modes) > 1
    name = "likely positions" if several else "most likely position"
    name += f": {word}" if word in SIGNS else ""
    positions_m = picture.survey.modes_m(posterior.likely_modes)
    for i, (text, position_m) in enumerate(zip(mode_labels(posterior), positions_m, strict=True)):
        label = "_nolegend_" if i else name + outside_note(box, position_m)
        draw_cell_mark(axes, position_m, word, colour, label=label)
        share = axes.annotate(text, position_m, (7, 7), textcoords="offset points")
        share.set(fontweight="bold", zorder=9, annotation_clip=True)


def _draw_estimate(axes: Axes, estimate: Estimate, box: Box) -> None:
    position_m = estimate.x[:2]
    name, colour = legend_of(estimate.estimator)
    label = name + outside_note(box, position_m)
    east_m, north_m = position_m
    draw_marks(axes, east_m, north_m, "x", colour, 8, label=label, zorder=7)
    ellipse = estimate.ellipse
    axes.add_patch(
        Ellipse(
            (east_m, north_m),
            2.0 * ellipse.semi_major_m,
            2.0 * ellipse.semi_minor_m,
            angle=90.0 - ellipse.azimuth_deg,
            fill=False,
            edgecolor=rgb(colour),
            zorder=6,
        )
    )


_SIZE_INCH = (11.7, 8.3)
"""A4, landscape."""
_TITLE_LETTERS = 150
"""As many as fit on a line of the title."""
_WITHOUT_DATE: dict[str, dict[str, None]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata to leave out, so that the same picture has the same bytes."""


def draw_run(result: Result, path: Path) -> None:
    """One page for the focus cell, format by the suffix (.png, .svg, .pdf).

    Raises `RunFileError` or `ConfigError`.
    """
    save_figure(figure_of(result), path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure, format by the suffix; raises `RunFileError` or `ConfigError`."""
    kind = kind_of(path)
    FigureCanvasAgg(figure)
    metadata = _WITHOUT_DATE.get(kind)  # some formats take none, not even an empty one
    with whole_file(path) as part, mpl.rc_context(STYLE):
        figure.savefig(part, format=kind, dpi=PIXELS_PER_INCH, metadata=metadata)


def figure_of(result: Result) -> Figure:
    """The page as a figure, drawn without a screen."""
    picture = picture_of(survey_of(result), focus_of(result))
    with mpl.rc_context(STYLE):
        figure = figure_of_size(*_SIZE_INCH)
        figure.suptitle(_title(picture), fontsize=11, ha="left", x=0.01)
        sides = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
        left, right = figure.add_subfigure(sides[0]), figure.add_subfigure(sides[1])
        draw_plan(left, left.subplots(), picture)
        distance, time = right.subplots(2, 1)
        draw_distance(distance, fit_of(picture.focus) if picture.focus else None)
        draw_levels(time, picture)
        legend_below(right, distance, time)
    return figure


def _title(picture: Picture) -> str:
    survey, focus = picture.survey, picture.focus
    cell = f"Cell {focus.cell}, {focus.n} readings" if focus else "No cell"
    kind = "SIMULATED run" if survey.is_simulated else "run"
    files = ", ".join(walk.run.name for walk in survey.walks)
    lines = [f"{cell} - {kind} {files}"]
    word = survey.word(focus.cell) if focus else ""
    lines += [f"{word}; {headline(focus)}" if word else headline(focus)] if focus else []
    if focus is not None and focus.place is not None and focus.verdict == "cannot tell":
        lines.append(focus.place.radii("the best position"))
    lines += survey.warnings
    wrapped = (part for line in lines for part in textwrap.wrap(line, _TITLE_LETTERS))
    return "\n".join(map(verbatim, wrapped))
