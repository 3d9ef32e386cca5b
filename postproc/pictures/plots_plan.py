"""The plan on paper: north up, metres east and north of the first fix."""

from math import hypot

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Ellipse, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from logger.core.ellipse import ellipse95
from postproc.pictures import colours
from postproc.pictures.picture import Box, Estimate, Picture, Rings, mode_label
from postproc.pictures.plots_style import empty, legend_below, rgb, thinned

_MOST_CORNERS = 5000


def draw_plan(figure: Figure | SubFigure, axes: Axes, picture: Picture) -> None:
    """The walk, the regions, and where each estimator puts the transmitter."""
    if picture.box is None:
        empty(axes, "no position fix")
        return
    _ground(axes, picture.box)
    _walk(figure, axes, picture)
    _posterior(axes, picture)
    for estimate in picture.estimates:
        if estimate.key != "rts":  # of a transmitter that stands still it is the EKF's last state
            _estimate(axes, estimate, picture.box)
    if picture.truth_m is not None:
        label = "truth (simulated)" + beyond(picture.box, *picture.truth_m)
        axes.plot(
            *picture.truth_m, "*", color=rgb(colours.TRUTH), markersize=13, label=label, zorder=9
        )
    legend_below(figure, axes)


def _ground(axes: Axes, box: Box) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(box.west, box.east)
    axes.set_ylim(box.south, box.north)
    axes.set_xlabel("east of the first fix (m)")
    axes.set_ylabel("north of the first fix (m)")
    axes.grid(visible=True)
    arrow = {"arrowstyle": "->", "color": rgb(colours.INK)}
    axes.annotate(
        "N",
        (0.04, 0.97),
        (0.04, 0.87),
        xycoords="axes fraction",
        ha="center",
        va="center",
        arrowprops=arrow,
    ).set_zorder(10)


def _walk(figure: Figure | SubFigure, axes: Axes, picture: Picture) -> None:
    """The track in grey, cut where the receiver was silent; readings in the colours of levels."""
    for strip in picture.strips_m:
        some = strip[thinned(len(strip), _MOST_CORNERS)]
        axes.plot(*some.T, color=rgb(colours.QUIET), linewidth=1, alpha=0.6, zorder=2)
    ink, paper = rgb(colours.INK), rgb(colours.PAPER)
    for end, marker, label in ((0, "o", "start of the walk"), (-1, "s", "end of the walk")):
        axes.plot(
            *picture.track_m[end],
            marker,
            color=paper,
            markeredgecolor=ink,
            markersize=5,
            label=label,
            zorder=5,
        )
    if len(picture.heard_m):
        weakest, strongest = picture.strength_dbm
        levels = axes.scatter(
            picture.heard_m[:, 0],
            picture.heard_m[:, 1],
            c=picture.heard_dbm,
            s=7,
            cmap=ListedColormap(colours.scale(256) / 255.0),
            vmin=weakest,
            vmax=strongest,
            linewidths=0,
            zorder=3,
            rasterized=True,
        )
        bar = figure.colorbar(
            levels, ax=axes, label="level (dBm)", extend="both", location="top", aspect=40
        )
        bar.locator = MaxNLocator(6, integer=True)
        bar.outline.set_visible(False)


def _posterior(axes: Axes, picture: Picture) -> None:
    """Regions of 95 % and 50 % of the probability, and the places in them."""
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is None or picture.box is None:
        return
    blue, white = rgb(colours.POSTERIOR), rgb(colours.PAPER)
    for name, rings, alpha in (("95 %", picture.region95, 0.12), ("50 %", picture.region50, 0.25)):
        if rings:
            outside = not all(
                picture.box.holds(*corner) for ring in rings for corner in ring.tolist()
            )
            label = f"{name} region" + (" (reaches beyond)" if outside else "")
            patch = PathPatch(
                _outline(rings), facecolor=(*blue, alpha), edgecolor=blue, label=label, zorder=4
            )
            axes.add_patch(patch)
    for i, mode in enumerate(posterior.modes):
        named = "likely places" if len(posterior.modes) > 1 else "likeliest place"
        east, north = picture.local(np.array([mode.x_m]), np.array([mode.y_m]))[0].tolist()
        legend = "_nolegend_" if i else named + beyond(picture.box, east, north)
        axes.plot(
            east,
            north,
            "o",
            color=blue,
            markeredgecolor=white,
            markersize=7,
            label=legend,
            zorder=8,
        )
        share = axes.annotate(
            mode_label(posterior, mode), (east, north), (7, 7), textcoords="offset points"
        )
        share.set(fontsize=9, fontweight="bold", zorder=9, annotation_clip=True)


def _outline(rings: Rings) -> Path:
    """Rings as one path; holes run the other way round and stay empty."""
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))


def _estimate(axes: Axes, estimate: Estimate, box: Box) -> None:
    """An estimator's last word with its 95 % ellipse."""
    east, north = float(estimate.x[0]), float(estimate.x[1])
    colour = rgb(estimate.colour)
    axes.plot(
        east,
        north,
        "x",
        color=colour,
        markersize=8,
        label=estimate.name + beyond(box, east, north),
        zorder=7,
    )
    found = ellipse95(estimate.p[0, 0], estimate.p[0, 1], estimate.p[1, 1])
    width, height = 2.0 * found.semi_major_m, 2.0 * found.semi_minor_m
    axes.add_patch(
        Ellipse(
            (east, north),
            width,
            height,
            angle=90.0 - found.azimuth_deg,
            fill=False,
            edgecolor=colour,
            zorder=6,
        )
    )


def beyond(box: Box, east: float, north: float) -> str:
    """A remark for what the picture does not reach."""
    if box.holds(east, north):
        return ""
    off_m = hypot(
        max(box.west - east, east - box.east, 0.0),
        max(box.south - north, north - box.north, 0.0),
    )
    return f" ({off_m:.0f} m beyond)" if off_m < 10_000.0 else " (far beyond)"
