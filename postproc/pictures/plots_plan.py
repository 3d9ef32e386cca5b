"""The printed plan: north up, metres east and north of the first fix."""

from math import hypot

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Ellipse, PathPatch
from matplotlib.path import Path

from postproc.pictures import colours
from postproc.pictures.estimates import Estimate, legend_of
from postproc.pictures.geometry import Box, evenly_spaced, round_step
from postproc.pictures.picture import Picture, mode_label
from postproc.pictures.plots_style import (
    draw_marks,
    draw_message,
    legend_below,
    level_bar,
    level_colours,
    rgb,
)
from postproc.result import RTS

_MOST_CORNERS = 5000
"""Of a strip of the track: more cannot be distinguished on paper."""
_SCALE_PARTS = 5
"""The scale bar is the shortest round length of which at most this many fit on the plan."""
_FAR_M = 10_000.0
"""Distances beyond this are not printed in metres."""


def draw_plan(figure: Figure | SubFigure, axes: Axes, picture: Picture) -> None:
    """The walk, the regions, and the transmitter's position by each estimator."""
    if picture.box is None:
        draw_message(axes, "no position fix")
        return
    draw_ground(axes, picture.box)
    draw_walks(figure, axes, picture)
    _draw_posterior(axes, picture, picture.box)
    for estimate in picture.estimates:
        if estimate.estimator != RTS:  # of a transmitter at rest it is the EKF's last state
            _draw_estimate(axes, estimate, picture.box)
    if picture.truth_m is not None:
        label = "truth (simulated)" + outside_note(picture.box, *picture.truth_m)
        draw_marks(axes, *picture.truth_m, "*", colours.TRUTH, 13, label=label, zorder=9)
    legend_below(figure, axes)


def outside_note(box: Box, east_m: float, north_m: float) -> str:
    """Remark in a legend on a position outside the plan; empty for one inside."""
    if box.contains(east_m, north_m):
        return ""
    distance_m = hypot(
        max(box.west - east_m, east_m - box.east, 0.0),
        max(box.south - north_m, north_m - box.north, 0.0),
    )
    return f" ({distance_m:.0f} m outside)" if distance_m < _FAR_M else " (far outside)"


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
    label = axes.annotate(f"{length_m:.0f} m", middle, (0, 4), textcoords="offset points")
    label.set(ha="center", fontsize=9, zorder=10)


def draw_walks(figure: Figure | SubFigure, axes: Axes, picture: Picture) -> None:
    """The tracks in grey, cut where there was no fix, and the readings coloured by their level."""
    grey, ink = rgb(colours.QUIET), rgb(colours.INK)
    for walk in picture.survey.walks:
        for strip in walk.strips_m:
            corners = strip[evenly_spaced(len(strip), _MOST_CORNERS)]
            axes.plot(*corners.T, color=grey, linewidth=1, alpha=0.6, zorder=2)
        for which, row, marker in (("start", 0, "o"), ("end", -1, "s")):
            if len(walk.track_m):
                x_m, y_m = walk.track_m[row]
                style = {"markeredgecolor": ink, "label": f"{which} of the walk", "zorder": 5}
                draw_marks(axes, x_m, y_m, marker, colours.PAPER, 5, **style)
    if len(picture.readings_m):
        levels = axes.scatter(
            picture.readings_m[:, 0],
            picture.readings_m[:, 1],
            c=picture.level_dbm,
            s=7,
            linewidths=0,
            zorder=3,
            rasterized=True,
            **level_colours(picture.level_range_dbm),
        )
        level_bar(figure, axes, levels, 6, location="top", aspect=40)


def _draw_posterior(axes: Axes, picture: Picture, box: Box) -> None:
    """Regions of 95 % and 50 % of the probability, and the modes of the posterior."""
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is None:
        return
    blue, white = rgb(colours.POSTERIOR), rgb(colours.PAPER)
    for name, alpha in (("95", 0.12), ("50", 0.25)):
        if rings := picture.regions[name]:
            inside = all(box.contains(*corner) for ring in rings for corner in ring.tolist())
            label = f"{name} % region" + ("" if inside else " (extends outside)")
            # holes run the other way round and stay empty
            path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            style = {"facecolor": (*blue, alpha), "edgecolor": blue, "zorder": 4}
            axes.add_patch(PathPatch(path, label=label, **style))
    several = len(posterior.modes) > 1
    name = "likely positions" if several else "most likely position"
    positions_m = picture.survey.modes_m(posterior.modes)
    for i, (mode, (east_m, north_m)) in enumerate(
        zip(posterior.modes, positions_m.tolist(), strict=True)
    ):
        label = "_nolegend_" if i else name + outside_note(box, east_m, north_m)
        style = {"markeredgecolor": white, "label": label, "zorder": 8}
        draw_marks(axes, east_m, north_m, "o", colours.POSTERIOR, 7, **style)
        text = mode_label(posterior, mode)
        share = axes.annotate(text, (east_m, north_m), (7, 7), textcoords="offset points")
        share.set(fontsize=9, fontweight="bold", zorder=9, annotation_clip=True)


def _draw_estimate(axes: Axes, estimate: Estimate, box: Box) -> None:
    """Final position of an estimator with its 95 % ellipse."""
    east_m, north_m = estimate.x[:2].tolist()
    name, colour = legend_of(estimate.estimator)
    label = name + outside_note(box, east_m, north_m)
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
