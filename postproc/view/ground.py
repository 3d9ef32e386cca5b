"""The sheet the plan is drawn on: grid, scale bar, north, and the keys of colours."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import rerun as rr

from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import Box, nice_step
from postproc.view.rerun_writer import Sheet, entity, points
from postproc.view.view_model import Story, Subject

PAPER: Colour = (17, 20, 26)
"""The ground is the same on dark and on light screens: what glows on it cannot be printed on
white.
"""
KEY_WIDTH = 0.3
"""Room for the key to the east of the plan, as a share of its size."""
FOOT = 0.14
"""Room for the scales to the south of the plan, as a share of its height."""

_FINE_LINES, _BOLD_EVERY = 24, 5
_SCALE_STEPS = 24
_INK: Colour = (150, 150, 160)
_ON_GROUND = -10.0


def draw_ground(sheet: Sheet, box: Box) -> None:
    """Grid, scale bar and an arrow to the north."""
    # in a 2-D view y points down: mirror the plan, so that the data stay true
    sheet.always("plan", rr.Transform3D(scale=(1.0, -1.0, 1.0)))
    _grid(sheet, box)
    step = nice_step(box.size, 8)
    below = box.south - 0.05 * box.height
    bar = [(box.west, below), (box.west + step, below)]
    label = f"{step:g} m" if step < 1000.0 else f"{step / 1000.0:g} km"
    sheet.always(
        "plan/ground/scale",
        rr.LineStrips2D([bar], colors=[_INK], radii=points(2.0), labels=[label]),
    )
    arrow = 0.08 * box.height
    foot = (box.west + 0.03 * box.width, box.north - 1.5 * arrow)
    north = rr.Arrows2D(
        vectors=[(0.0, arrow)], origins=[foot], colors=[_INK], radii=points(1.5), labels=["N"]
    )
    sheet.always("plan/ground/north", north)


def draw_level_key(sheet: Sheet, subject: Subject, box: Box) -> None:
    """The scale of levels, below the plan."""
    if not len(subject.picture.heard_dbm):
        return
    weakest, strongest = subject.picture.strength_dbm
    height, y = 0.02 * box.height, box.south - 0.05 * box.height
    x = np.linspace(box.east - 0.4 * box.width, box.east, _SCALE_STEPS + 1)
    strips = [[(west, y), (east, y)] for west, east in pairwise(x.tolist())]
    bar = rr.LineStrips2D(strips, colors=colours.scale(_SCALE_STEPS), radii=0.5 * height)
    sheet.always(entity("plan", "cells", subject.cell, "level_scale"), bar)
    at = x[[0, _SCALE_STEPS // 2, _SCALE_STEPS]].tolist()
    ends = rr.Points2D(
        [(east, y - 1.2 * height) for east in at],
        labels=[f"{dbm:.0f} dBm" for dbm in (weakest, 0.5 * (weakest + strongest), strongest)],
        colors=[_INK],
        radii=points(0.1),
        show_labels=True,
    )
    sheet.always(entity("plan", "cells", subject.cell, "level_scale", "ends"), ends)


def draw_key(sheet: Sheet, path: str, named: Sequence[tuple[str, Colour]], box: Box) -> None:
    """Which colour is whose, beside the plan: labels at the places themselves would cover each
    other.
    """
    east, rows = box.east + 0.5 * KEY_WIDTH * box.size, max(len(named), 10)
    places = [(east, box.north - (i + 0.3) * box.height / rows) for i in range(len(named))]
    labels, rgb = [name for name, _ in named], [colour for _, colour in named]
    sheet.always(
        path, rr.Points2D(places, labels=labels, colors=rgb, radii=points(5.0), show_labels=True)
    )


def key_of(story: Story, subject: Subject) -> list[tuple[str, Colour]]:
    """Names and colours of what is drawn of a cell."""
    named = [("walker", colours.WALKER)] if any(len(walk.t_ns) for walk in story.walks) else []
    if subject.steps:
        named.append(("posterior: 95 %, 50 %", colours.POSTERIOR))
    named += [(estimate.name, estimate.colour) for estimate in subject.picture.estimates]
    named += [
        (f"claim: {claim.verdict}", colour_of_verdict(claim.verdict)) for claim in subject.claims
    ]
    if subject.picture.truth_m is not None:
        named.append(("truth (simulated)", colours.TRUTH))
    return list(dict.fromkeys(named))


def colour_of_verdict(verdict: str) -> Colour:
    """Green where it holds, pink where it does not, amber in between, grey for what nobody can
    tell.
    """
    return _VERDICTS.get(verdict, colours.QUIET)


_VERDICTS: dict[str, Colour] = {
    "located": (50, 140, 80),
    "consistent": (50, 140, 80),
    "ambiguous": (190, 140, 30),
    "rejected": (225, 85, 165),
}


def _grid(sheet: Sheet, box: Box) -> None:
    step = nice_step(box.size, _FINE_LINES)
    for name, every, alpha in (("fine", 1, 45), ("bold", _BOLD_EVERY, 110)):
        easts, norths = (
            np.arange(np.ceil(low / step), np.floor(high / step) + 1)
            for low, high in ((box.west, box.east), (box.south, box.north))
        )
        easts, norths = (
            values[(values % _BOLD_EVERY == 0) == (every > 1)] * step for values in (easts, norths)
        )
        lines = [[(x, box.south), (x, box.north)] for x in easts] + [
            [(box.west, y), (box.east, y)] for y in norths
        ]
        if lines:
            ink = [(*colours.QUIET, alpha)]
            drawn = rr.LineStrips2D(lines, colors=ink, radii=points(0.5), draw_order=_ON_GROUND)
            sheet.always(f"plan/ground/grid/{name}", drawn)
