"""One plan of all cells: the walks, where each cell is, and a picture of the ground."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox, BboxBase

from logger.core.arrays import FloatArray
from postproc.basemap import Basemap, ground_under
from postproc.cell_work import Attempts
from postproc.pictures import colours
from postproc.pictures.picture import Rings, picture_of, regions_of
from postproc.pictures.plots import (
    DASHED,
    SIGNS,
    SMALLEST_POINTS,
    draw_cell_mark,
    draw_ground,
    draw_inset,
    draw_rings,
    draw_walks,
    figure_of_size,
    legend_below,
    rgb,
)
from postproc.pictures.survey import Box, Survey, plan_box, with_inset
from postproc.report.figures import WIDTH_INCH, ReportFigure, legends_inch
from postproc.report.svg import PLACE
from postproc.result import CellResult

_BESIDE_INCH, _ABOVE_INCH = 0.2, 0.3
_TALLEST_INCH = 6.0
"""A walk from north to south leaves room for others on a sheet of paper."""
_MOST_PIXELS = 1200
"""Along the longer side of the ground: a street has several pixels on paper."""
_OPACITY = 0.75
_POSITIONED = ("located", "ambiguous")


class _Place(NamedTuple):
    """A cell on the plan: its number, its word, its positions (n, 2) and its regions.

    `what` says what the position is, where it is not that of a verdict.
    """

    number: int
    cell: str
    word: str
    what: str
    positions_m: FloatArray
    shares: tuple[str, ...]
    outline: Rings
    likely: Rings

    @property
    def extent_m(self) -> FloatArray:
        """Shape (n, 2); a region only where a verdict stands for it."""
        return np.vstack([self.positions_m, *([] if self.what else self.outline)])

    @property
    def label(self) -> str:
        return f"{self.number} {self.word}" if self.word in SIGNS else str(self.number)


def cell_map(
    survey: Survey,
    cells: Sequence[CellResult],
    basemap: Path | None,
    tries: Attempts | None = None,
) -> ReportFigure | None:
    """The plan; None where no cell has a place on it.

    A cell with a word has one also where no verdict gives a position: the best one, or where it was
    strongest. If small, the first of them is drawn larger. `basemap` is a picture of the ground;
    `tries` gets the cells that cannot be drawn.
    """
    tries = tries or Attempts("its place on the map")
    numbered = enumerate(cells, 1)
    found = tries.each(numbered, lambda one: one[1].cell, lambda one: _place(survey, *one))
    places = [place for _, place in found if place is not None]
    if survey.utm is None or not places:
        return None
    extents = [place.extent_m for place in places]
    box = plan_box(survey.track_m, extents)
    drawn_m = np.vstack([survey.track_m, *(place.positions_m for place in places)])
    first = places[0]
    box, inset = with_inset(box, None if first.what else first.extent_m, drawn_m)
    ground = ground_under(basemap, survey, box, _MOST_PIXELS)
    if ground is not None:
        survey = replace(survey, streets_m=())
    height_inch = (WIDTH_INCH - _BESIDE_INCH) * box.height / box.width + _ABOVE_INCH
    figure = figure_of_size(WIDTH_INCH, min(height_inch, _TALLEST_INCH))
    axes = figure.subplots()
    picture = picture_of(survey, None)
    _draw_ground(axes, box, ground)
    draw_walks(figure, axes, picture)
    _name_directly(axes, picture.survey)
    drawn = tries.each(
        places, lambda place: place.cell, lambda place: _draw_place(axes, place, box)
    )
    if inset is not None:
        enlarged = draw_inset(axes, inset, picture)
        if ground is not None:
            _draw_basemap(enlarged, ground, inset[0])
        tries.each(places[:1], lambda one: one.cell, lambda one: _draw_place(enlarged, one))
    legend_below(figure, axes)
    figure.set_size_inches(WIDTH_INCH, min(height_inch + legends_inch(figure), _TALLEST_INCH))
    figure.draw_without_rendering()  # from now on lengths of texts are known
    _set_apart(axes, [note for _, notes in drawn for note in notes])
    return ReportFigure("map", "All cells on one plan", figure, _alt_text(places, len(cells)))


def _place(survey: Survey, number: int, cell: CellResult) -> _Place | None:
    word = survey.word(cell.cell)
    named = number, cell.cell, word
    is_positioned = cell.verdict in _POSITIONED
    if cell.posterior is not None and (is_positioned or word in SIGNS):
        modes = cell.posterior.likely_modes
        likely = () if cell.place is None else cell.place.likely_modes
        shares = tuple(mode.share if len(modes) > 1 else "" for mode in likely)
        regions = regions_of(cell.posterior, survey.origin_m)
        what = "" if is_positioned else "not located yet"
        rings = regions["95"], regions["50"]
        return _Place(*named, what, survey.modes_m(modes), shares, *rings)
    if word in SIGNS and cell.obs is not None and len(cell.obs):
        where_m = survey.local(cell.obs.strongest.places)
        return _Place(*named, "where it was strongest", where_m, ("",), [], [])
    return None


def _draw_ground(axes: Axes, box: Box, ground: Basemap | None) -> None:
    """Without a scale along the sides: numbers of metres help nobody to find a place."""
    draw_ground(axes, box)
    axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
    axes.spines[:].set_visible(False)
    if ground is not None:
        _draw_basemap(axes, ground, box)


def _name_directly(axes: Axes, survey: Survey) -> None:
    muted: dict[str, Any] = {"color": rgb(colours.MUTED), "fontsize": SMALLEST_POINTS, "zorder": 6}
    if survey.streets_m:
        text = axes.text(0.99, 0.99, "simulated streets", transform=axes.transAxes, **muted)
        text.set(ha="right", va="top")
    tracks = [walk.track_m for walk in survey.walks if len(walk.track_m)]
    for track_m in tracks if len(tracks) == 1 else ():
        for name, end_m in (("start", track_m[0]), ("end", track_m[-1])):
            is_low = axes.transAxes.inverted().transform(axes.transData.transform(end_m))[1] < 0.15
            below = (6, 5) if is_low else (6, -11)  # the scale bar is there
            axes.annotate(name, end_m, below, textcoords="offset points", **muted)
    named = ("streets", *(("start", "end") if len(tracks) == 1 else ()))
    for line in axes.lines:
        if str(line.get_label()).startswith(named):
            line.set_label("_nolegend_")


def _draw_basemap(axes: Axes, basemap: Basemap, shown: Box) -> None:
    pixels, box = basemap.on_paper(colours.PAPER, _OPACITY), basemap.box
    extent = (box.west, box.east, box.south, box.north)
    axes.imshow(pixels, extent=extent, interpolation="none", zorder=0)
    axes.set_xlim(shown.west, shown.east)
    axes.set_ylim(shown.south, shown.north)
    axes.grid(visible=False)


def _draw_place(axes: Axes, place: _Place, box: Box | None = None) -> list[Annotation]:
    notes = []
    colour = colours.word_colour(place.word)
    # faint where no verdict stands for it: the side that it is on shows all the same
    wide: tuple[float, Any] = (0.05, DASHED) if place.what else (0.16, "solid")
    for rings, (alpha, line) in ((place.outline, wide), (place.likely, (0.28, "none"))):
        if rings:
            draw_rings(axes, rings, colour, alpha, linestyle=line)
    positions_m = place.positions_m
    n_outside = int(np.sum(~box.contains(positions_m))) if box else 0
    outside = f", {n_outside} of {len(positions_m)} places outside the plan" if n_outside else ""
    for i, (position_m, share) in enumerate(zip(positions_m, place.shares, strict=True)):
        what = f", {place.what}" if place.what else ""
        label = "_nolegend_" if i else f"{place.label}: {place.cell}{what}{outside}"
        gid = f"{PLACE}{place.number}" if box and not i else None
        draw_cell_mark(axes, position_m, place.word, colour, label=label, gid=gid)
        if box is None:
            continue
        text = f"{place.number} ({share})" if i else place.label + (f" ({share})" if share else "")
        note = axes.annotate(text, position_m, (9, 6), textcoords="offset points")
        note.set(fontsize=10, fontweight="bold", zorder=9, annotation_clip=True)
        note.set_bbox({"facecolor": rgb(colours.PAPER), "alpha": 0.8, "linewidth": 0, "pad": 1})
        notes.append(note)
    return notes


def _set_apart(axes: Axes, notes: Sequence[Annotation]) -> None:
    # each label beside its mark, where it hides least of marks, of labels, and of itself
    if not notes:
        return
    marks: FloatArray = axes.transData.transform([note.xy for note in notes])
    middle = 0.5 * (axes.bbox.x0 + axes.bbox.x1)
    taken: list[Bbox] = []
    for note, (x, _) in zip(notes, marks, strict=True):
        aligned = ("right", "left") if x > middle else ("left", "right")
        sides = [(each, above) for above in (6, -14) for each in aligned]
        hidden = [_hidden_px2(_beside(note, *side), axes.bbox, marks, taken) for side in sides]
        taken.append(_beside(note, *sides[int(np.argmin(hidden))]))


def _beside(note: Annotation, aligned: str, above: int) -> Bbox:
    note.set(ha=aligned, position=(-9 if aligned == "right" else 9, above))
    return note.get_window_extent()


def _hidden_px2(label: Bbox, plan: BboxBase, marks: FloatArray, taken: Sequence[Bbox]) -> int:
    # outside of the plan, over other labels, and all of it for each mark that it covers
    seen, *shared = (Bbox.intersection(label, other) for other in (plan, *taken))
    areas = [0.0 if part is None else part.width * part.height for part in (seen, *shared)]
    own = label.width * label.height
    return round(own * (1 + label.count_contains(marks)) - areas[0] + sum(areas[1:]))


def _alt_text(places: Sequence[_Place], n_cells: int) -> str:
    named = [
        f"{place.number} is {place.cell}" + "".join(f", {t}" for t in (place.word, place.what) if t)
        for place in places
    ]
    text = (
        "The walk, and for each cell with a position its number, its most likely positions and "
        f"the regions that hold 50 % and 95 % of its probability: {'; '.join(named)}."
    )
    left = n_cells - len(places)
    return text + (f" The plan does not show the other {left}." if left else "")
