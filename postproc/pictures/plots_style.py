"""What all printed pictures have in common."""

from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from postproc.pictures import colours
from postproc.pictures.colours import Colour

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
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
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
    figure.legend(
        handles=list(artists.values()),
        labels=list(artists),
        loc="outside lower left",
        ncols=columns,
    )


def draw_marks(
    axes: Axes, x: Any, y: Any, marker: str, colour: Colour, size: float, **style: Any
) -> None:
    """Marks at positions, of a size in points; `style` as for `Axes.plot`."""
    axes.plot(x, y, marker, color=rgb(colour), markersize=size, **style)


def level_colours(level_range_dbm: tuple[float, float]) -> dict[str, Any]:
    """Arguments of matplotlib that colour values as levels between two limits."""
    low_dbm, high_dbm = level_range_dbm
    cmap = ListedColormap(colours.level_scale(256) / 255.0)
    return {"cmap": cmap, "vmin": low_dbm, "vmax": high_dbm}


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
