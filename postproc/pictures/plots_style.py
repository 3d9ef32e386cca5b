"""What all printed pictures have in common."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from logger.core.arrays import IntArray
from postproc.pictures import colours
from postproc.pictures.colours import Colour

MOST_VECTORS = 400
"""More dots or corners than this are drawn as pixels, whose number is bounded."""
PIXELS_PER_INCH = 150

_APART_INCH = 0.09
_LETTERS_PER_INCH = 12.5
_LETTERS_OF_A_KEY = 5.0


def rgb(colour: Colour) -> tuple[float, float, float]:
    """A colour in the units of matplotlib."""
    red, green, blue = colour
    return red / 255.0, green / 255.0, blue / 255.0


def verbatim(text: str) -> str:
    """Text in which a dollar sign is no formula and a control character is none."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text).replace(
        "$", r"\$"
    )


STYLE: Any = {
    "font.size": 10.0,
    "text.color": rgb(colours.INK),
    "axes.edgecolor": rgb(colours.MUTED),
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
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
    "legend.frameon": False,
    "svg.hashsalt": "cellwalk",
}
"""Settings of matplotlib; with the salt the same picture has the same bytes."""


def figure_of_size(width_inch: float, height_inch: float) -> Figure:
    """An empty figure, without a screen."""
    return Figure(
        figsize=(width_inch, height_inch), layout=ConstrainedLayoutEngine(h_pad=_APART_INCH)
    )


def legend_below(figure: Figure | SubFigure, *axes: Axes) -> None:
    """One legend under the whole figure, each name once; in two columns where these are wide enough
    for every name.
    """
    named: dict[str, Artist] = {}
    for handles, labels in (one.get_legend_handles_labels() for one in axes):
        named |= zip(labels, handles, strict=True)
    if named:
        room = figure.bbox.width / figure.dpi * _LETTERS_PER_INCH / 2.0 - _LETTERS_OF_A_KEY
        columns = 2 if max(map(len, named)) <= room else 1
        figure.legend(
            handles=list(named.values()),
            labels=list(named),
            loc="outside lower left",
            ncols=columns,
        )


def empty(axes: Axes, why: str) -> None:
    """Say why there is nothing to see."""
    axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes)
    axes.set_axis_off()


def thinned(count: int, most: int) -> IntArray:
    """At most so many of `count` rows, evenly, the first and the last among them."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).astype(np.int64))
