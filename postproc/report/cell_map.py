"""One plan of all cells: the walks, each position that is known, and a picture of the ground."""

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from logger.core.arrays import FloatArray
from logger.core.locator.rivals import relevant_modes, share_text
from postproc.basemap.reading import Basemap, read_basemap
from postproc.cell_work import Attempts
from postproc.pictures import colours
from postproc.pictures.picture import Rings, picture_of, regions_of
from postproc.pictures.plots import (
    draw_ground,
    draw_marks,
    draw_walks,
    figure_of_size,
    legend_below,
    rgb,
)
from postproc.pictures.survey import Survey, plan_box
from postproc.report.figures import ReportFigure
from postproc.result import CellResult

_WIDTH_INCH, _BESIDE_INCH, _ABOVE_INCH = 4.6, 0.8, 1.0
"""As narrow as the pictures of a cell, for a telephone."""
_TALLEST_INCH = 6.0
"""A walk from north to south leaves room for others on a sheet of paper."""
_MOST_PIXELS = 1200
"""Along the longer side of the ground: a street has several pixels on paper."""
_OPACITY = 0.75
_POSITIONED = ("located", "ambiguous")


class _Place(NamedTuple):
    """A cell with a position: its number in the table, its positions (n, 2) and its region."""

    number: int
    result: CellResult
    positions_m: FloatArray
    shares: tuple[str, ...]
    outline: Rings


def cell_map(
    survey: Survey,
    cells: Sequence[CellResult],
    basemap: FilePath | None,
    tries: Attempts | None = None,
) -> ReportFigure | None:
    """The plan; None where no cell has a position, or where it would be that of the only cell.

    `basemap` is a file with a picture of the ground; `tries` gets the cells that cannot be drawn.

    Raises `ConfigError` where the file cannot be read, or does not cover the plan.
    """
    tries = tries or Attempts("its place on the map")
    numbered = enumerate(cells, 1)
    found = tries.each(numbered, lambda one: one[1].cell, lambda one: _place(survey, *one))
    places = [place for _, place in found if place is not None]
    if survey.utm is None or not places or (len(cells) < 2 and basemap is None):
        return None
    extras = [np.vstack([place.positions_m, *place.outline]) for place in places]
    box = plan_box(survey.track_m, extras)
    ground = read_basemap(basemap, survey, box, _MOST_PIXELS) if basemap else None
    height_inch = (_WIDTH_INCH - _BESIDE_INCH) * box.height / box.width + _ABOVE_INCH
    figure = figure_of_size(_WIDTH_INCH, min(height_inch, _TALLEST_INCH))
    axes = figure.subplots()
    if ground is not None:
        _draw_basemap(axes, ground)
    draw_ground(axes, box)
    draw_walks(figure, axes, picture_of(survey, None))
    tries.each(places, lambda place: place.result.cell, lambda place: _draw_place(axes, place))
    legend_below(figure, axes)
    return ReportFigure("map", "All cells on one plan", figure, _alt_text(places, len(cells)))


def _place(survey: Survey, number: int, cell: CellResult) -> _Place | None:
    """A cell with its number in the table of all cells; None where its position is not known."""
    if cell.posterior is None or cell.verdict not in _POSITIONED:
        return None
    modes = relevant_modes(cell.posterior.modes)
    shares = tuple(share_text(mode.probability) if len(modes) > 1 else "" for mode in modes)
    outline = regions_of(cell.posterior, survey.origin_m)["95"]
    return _Place(number, cell, survey.modes_m(modes), shares, outline)


def _draw_basemap(axes: Axes, basemap: Basemap) -> None:
    alpha = _OPACITY * basemap.pixels[..., 3:] / 255.0
    paper = np.array(colours.PAPER)
    pixels = np.rint(basemap.pixels[..., :3] * alpha + paper * (1.0 - alpha)).astype(np.uint8)
    box = basemap.box
    extent = (box.west, box.east, box.south, box.north)
    axes.imshow(pixels, extent=extent, interpolation="none", zorder=0)
    axes.grid(visible=False)


def _draw_place(axes: Axes, place: _Place) -> None:
    colour = colours.verdict_colour(place.result.verdict)
    if place.outline:
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in place.outline))
        style = {"facecolor": (*rgb(colour), 0.18), "edgecolor": rgb(colour), "zorder": 4}
        axes.add_patch(PathPatch(path, **style))
    for i, ((east_m, north_m), share) in enumerate(
        zip(place.positions_m.tolist(), place.shares, strict=True)
    ):
        label = (
            "_nolegend_" if i else f"{place.number}: {place.result.cell}, {place.result.verdict}"
        )
        style = {"markeredgecolor": rgb(colours.PAPER), "label": label, "zorder": 8}
        draw_marks(axes, east_m, north_m, "o", colour, 8, **style)
        text = f"{place.number}" + (f" ({share})" if share else "")
        note = axes.annotate(text, (east_m, north_m), (7, 7), textcoords="offset points")
        note.set(fontsize=10, fontweight="bold", zorder=9, annotation_clip=True)


def _alt_text(places: Sequence[_Place], n_cells: int) -> str:
    named = [f"{place.number} is {place.result.cell}, {place.result.verdict}" for place in places]
    text = (
        "The walk, and for each cell with a position its number in the table, its most likely "
        f"positions and the region that holds 95 % of its probability: {'; '.join(named)}."
    )
    left = n_cells - len(places)
    return text + (f" The other {left} have no position to show." if left else "")
