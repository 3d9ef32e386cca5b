"""The ground of the plan: map, grid, scale bar, north arrow, and the keys of colours."""

from itertools import pairwise
from math import ceil, floor

import numpy as np
import rerun as rr

from postproc.basemap.reading import Basemap
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.estimates import legend_of
from postproc.pictures.geometry import Box, round_step
from postproc.view.rerun_writer import RerunWriter, on_screen
from postproc.view.surface import Style, Surface
from postproc.view.view_model import CellView, ViewModel

PAPER: Colour = (17, 20, 26)
"""The same on dark and on light screens, since the posterior's glow needs a dark ground."""
KEY_WIDTH = 0.3
"""Space for the key east of the plan, as a share of the plan's size."""
FOOT_HEIGHT = 0.14
"""Space for the scales south of the plan, as a share of the plan's height."""

_FINE_LINES, _BOLD_EVERY = 24, 5
"""At most this many fine lines across the plan, every fifth of them bold."""
_SCALE_STEPS = 24
"""Enough for the scale to look continuous."""
_LEAST_KEY_ROWS = 10
"""A short key is spaced as if it had this many rows."""
_INK: Colour = (150, 150, 160)
_GRID_ORDER = -10.0


def draw_ground(plan: Surface, box: Box) -> None:
    """Grid, scale bar and an arrow to the north."""
    # y points down in a 2-D view: mirror the plan, so that the data stay as they are
    plan.log_static((), rr.Transform3D(scale=(1.0, -1.0, 1.0)))
    _draw_grid(plan, box)
    length_m = round_step(box.size, 8)
    y = box.south - 0.05 * box.height
    label = f"{length_m:g} m" if length_m < 1000.0 else f"{length_m / 1000.0:g} km"
    bar = [[(box.west, y), (box.west + length_m, y)]]
    scale = rr.LineStrips2D(bar, colors=[_INK], radii=on_screen(2.0), labels=[label])
    plan.log_static(("ground", "scale"), scale)
    arrow_m = 0.08 * box.height
    foot = (box.west + 0.03 * box.width, box.north - 1.5 * arrow_m)
    north = rr.Arrows2D(
        vectors=[(0.0, arrow_m)], origins=[foot], colors=[_INK], radii=on_screen(1.5), labels=["N"]
    )
    plan.log_static(("ground", "north"), north)


def draw_level_scale(plan: Surface, cell: CellView, box: Box) -> None:
    """The scale of levels, below the plan."""
    if not len(cell.picture.level_dbm):
        return
    height, y = 0.02 * box.height, box.south - 0.05 * box.height
    x = np.linspace(box.east - 0.4 * box.width, box.east, _SCALE_STEPS + 1)
    strips = [[(west, y), (east, y)] for west, east in pairwise(x.tolist())]
    path = ("cells", cell.name, "level_scale")
    bar = rr.LineStrips2D(strips, colors=colours.level_scale(_SCALE_STEPS), radii=0.5 * height)
    plan.log_static(path, bar)
    weakest, strongest = cell.picture.level_range_dbm
    labels = [f"{dbm:.0f} dBm" for dbm in (weakest, 0.5 * (weakest + strongest), strongest)]
    labelled = np.column_stack(
        [x[[0, _SCALE_STEPS // 2, _SCALE_STEPS]], np.full(3, y - 1.2 * height)]
    )
    plan.points((*path, "ends"), labelled, Style([_INK], 0.1), labels=labels, show_labels=True)


def draw_key(plan: Surface, view: ViewModel, cell: CellView) -> None:
    """The key of colours beside the plan: labels at the positions would cover each other."""
    box = view.box
    assert box is not None
    entries = key_of(view, cell)
    rows = np.arange(len(entries)) + 0.3
    y = box.north - rows * box.height / max(len(entries), _LEAST_KEY_ROWS)
    positions_m = np.column_stack([np.full(len(y), box.east + 0.5 * KEY_WIDTH * box.size), y])
    labels, inks = [name for name, _ in entries], [ink for _, ink in entries]
    path = ("cells", cell.name, "key")
    plan.points(path, positions_m, Style(inks, 5.0), labels=labels, show_labels=True)


def key_of(view: ViewModel, cell: CellView) -> list[tuple[str, Colour]]:
    """Names and colours of what is drawn of a cell."""
    entries = [("walker", colours.WALKER)] if len(view.survey.track_m) else []
    if cell.steps:
        entries.append(("posterior: 95 % (50 %)", colours.POSTERIOR))
    entries += [legend_of(estimate.estimator) for estimate in cell.picture.estimates]
    verdicts = [tested.verdict for tested in cell.claims]
    entries += [(f"claim: {verdict}", colours.verdict_colour(verdict)) for verdict in verdicts]
    if cell.picture.truth_m is not None:
        entries.append(("truth (simulated)", colours.TRUTH))
    return list(dict.fromkeys(entries))


def _draw_grid(plan: Surface, box: Box) -> None:
    step_m = round_step(box.size, _FINE_LINES)
    lines = [
        (number, np.array([(number * step_m, box.south), (number * step_m, box.north)]))
        for number in _multiples(box.west, box.east, step_m)
    ]
    lines += [
        (number, np.array([(box.west, number * step_m), (box.east, number * step_m)]))
        for number in _multiples(box.south, box.north, step_m)
    ]
    for name, is_bold, opacity in (("fine", False, 45), ("bold", True, 110)):
        strips = [line for number, line in lines if (number % _BOLD_EVERY == 0) == is_bold]
        style = Style([(*colours.QUIET, opacity)], 0.5, _GRID_ORDER)
        plan.lines(("ground", "grid", name), strips, style)


def _multiples(low: float, high: float, step: float) -> range:
    """Multiples of a step between two values."""
    return range(ceil(low / step), floor(high / step) + 1)


_ORDER = -25.0
"""Below the density and everything else."""
_OPACITY = 0.3
"""Dark enough for what glows on it."""


def draw_basemap(writer: RerunWriter, basemap: Basemap) -> None:
    """Below everything else on the plan."""
    rows, columns = basemap.pixels.shape[:2]
    box = basemap.box
    picture = rr.EncodedImage(
        contents=basemap.jpeg(PAPER), media_type="image/jpeg", opacity=_OPACITY, draw_order=_ORDER
    )
    corner = rr.Transform3D(
        translation=(box.west, box.north, 0.0),
        scale=(box.width / columns, -box.height / rows, 1.0),
    )
    writer.log_static("plan/ground/basemap", picture, corner)
