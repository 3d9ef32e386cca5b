"""The plan: metres east and north of the first fix, seen from above."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from logger.core.observations import MAX_GAP_S
from postproc.estimators.filters import FilterPath
from postproc.pictures import colours
from postproc.pictures.colours import Bytes, Colour
from postproc.pictures.picture import mode_label
from postproc.view.density_image import draw_heat
from postproc.view.ground import colour_of_verdict, draw_ground, draw_key, draw_level_key, key_of
from postproc.view.regions import rings
from postproc.view.rerun_writer import (
    Sheet,
    closed,
    ellipse_axes,
    entity,
    points,
    strips_by_row,
    thinned,
)
from postproc.view.view_model import SHARES, Story, Subject, Walk

MOST_STRIPS = 5_000
MOST_POINTS = 40_000
REGION_WIDTHS = (1.5, 2.5)
"""Of the outlines of 95 % and 50 %, in points."""
_TRAIL_FIXES = 30
FARTHEST_M = 1e6
"""A filter that has run away farther than this cannot be drawn in single precision and tells
nothing.
"""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)


def draw_plan(sheet: Sheet, story: Story) -> None:
    """Everything on the plan; nothing for a run without a fix."""
    if story.box is None:
        return
    draw_ground(sheet, story.box)
    for walk in story.walks:
        _walk(sheet, walk)
    _walker(sheet, story.walks)
    for subject in story.subjects:
        draw_level_key(sheet, subject, story.box)
        draw_key(
            sheet, entity("plan", "cells", subject.cell, "key"), key_of(story, subject), story.box
        )
        draw_heat(sheet, story, subject, story.box)
        _levels(sheet, subject)
        _posterior(sheet, story, subject)
        _estimates(sheet, story, subject)
        _claims(sheet, story, subject)
        if subject.picture.truth_m is not None:
            _mark(
                sheet,
                entity("plan", "cells", subject.cell, "truth"),
                subject.picture.truth_m,
                colours.TRUTH,
                7.0,
            )
    _all_cells(sheet, story)


def strips_of(t_ns: IntArray, places_m: FloatArray) -> list[FloatArray]:
    """A walk cut where the receiver was silent: at most `MOST_STRIPS` strips of two or more places,
    (k, 2).
    """
    silent = np.flatnonzero(np.diff(t_ns) > MAX_GAP_S * 1e9) + 1
    strips = [strip for strip in np.split(places_m, silent) if len(strip) > 1]
    return strips[thinned(len(strips), MOST_STRIPS)]


def level_strips(
    t_ns: IntArray, places_m: FloatArray, level_dbm: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """The way from reading to reading with the mean level of each stretch, at most `MOST_STRIPS` of
    them.

    Where nothing was heard for long there is no stretch.
    """
    each = max(1, -(-(len(t_ns) - 1) // MOST_STRIPS))
    begins = range(0, len(t_ns) - 1, each)
    long_ns = each * MAX_GAP_S * 1e9
    parts = [
        slice(i, i + each + 1)
        for i in begins
        if t_ns[min(i + each, len(t_ns) - 1)] - t_ns[i] <= long_ns
    ]
    return [places_m[part] for part in parts], np.array(
        [np.mean(level_dbm[part]) for part in parts]
    )


def _walk(sheet: Sheet, walk: Walk) -> None:
    """The track in grey."""
    strips = closed(strips_of(walk.t_ns, walk.track_m))
    if strips:
        ink = [(*colours.QUIET, 160)]
        drawn = rr.LineStrips2D(strips, colors=ink, radii=points(1.0), draw_order=0.0)
        sheet.always(entity("plan", "walks", walk.name, "track"), drawn)


def _walker(sheet: Sheet, walks: Sequence[Walk]) -> None:
    """Where the walker is at the time looked at, and where he came from."""
    ink, size = colours.WALKER, points(7.0)
    sheet.always("plan/walker", rr.Points2D.from_fields(colors=[ink], radii=size, draw_order=30.0))
    style = rr.LineStrips2D.from_fields(colors=[(*ink, 200)], radii=points(3.0), draw_order=29.0)
    sheet.always("plan/walker/trail", style)
    most = MOST_STRIPS // max(len(walks), 1)
    for walk in walks:
        places = walk.track_m.astype(np.float32)
        sheet.over_time("plan/walker", walk.t_ns, rr.Points2D.columns(positions=places))
        # trails of equal length: the first ones stand still at the first fix
        part = thinned(len(places), most)
        ago = np.arange(_TRAIL_FIXES - 1, -1, -1)
        trails = places[np.maximum(np.arange(len(places))[part, None] - ago, 0)]
        sheet.over_time(
            "plan/walker/trail", walk.t_ns[part], rr.LineStrips2D.columns(strips=trails)
        )


def _levels(sheet: Sheet, subject: Subject) -> None:
    """The way along which the cell was heard, in the colours of its levels."""
    obs, picture = subject.result.obs, subject.picture
    if obs is None or not len(obs):
        return
    path = entity("plan", "cells", subject.cell, "levels")
    part = thinned(len(obs), MOST_POINTS)
    rgb = colours.of_levels(picture.heard_dbm[part], *picture.strength_dbm)
    sheet.always(
        path, rr.Points2D(picture.heard_m[part], colors=rgb, radii=points(2.5), draw_order=5.0)
    )
    strips, means_dbm = level_strips(obs.t_ns, picture.heard_m, picture.heard_dbm)
    if strips:
        ink: Bytes = colours.of_levels(means_dbm, *picture.strength_dbm)
        drawn = rr.LineStrips2D(closed(strips), colors=ink, radii=points(2.5), draw_order=4.0)
        sheet.always(entity("plan", "cells", subject.cell, "levels", "track"), drawn)


def _posterior(sheet: Sheet, story: Story, subject: Subject) -> None:
    """Regions that hold 95 % and 50 % of the probability, and the places in them, as they came
    about.
    """
    if not subject.steps:
        return
    times = np.array([step.t_ns for step in subject.steps])
    for (name, rows), width in zip(subject.regions.items(), REGION_WIDTHS, strict=True):
        path = entity("plan", "cells", subject.cell, "posterior", f"region{name}")
        ink, radius = [colours.POSTERIOR], points(0.5 * width)
        sheet.always(path, rr.LineStrips2D.from_fields(colors=ink, radii=radius, draw_order=10.0))
        sheet.over_time(path, times, strips_by_row(rows))
    path = entity("plan", "cells", subject.cell, "posterior", "places")
    style = rr.Points2D.from_fields(
        colors=[colours.POSTERIOR], radii=points(5.0), show_labels=True, draw_order=20.0
    )
    sheet.always(path, style)
    rim = rr.Points2D.from_fields(
        colors=[(255, 255, 255)], radii=points(7.0), show_labels=False, draw_order=19.0
    )
    sheet.always(f"{path}/rim", rim)
    modes = [(step.posterior, mode) for step in subject.steps for mode in step.posterior.modes]
    places = story.local(
        np.array([mode.x_m for _, mode in modes]), np.array([mode.y_m for _, mode in modes])
    )
    labels = [mode_label(posterior, mode) for posterior, mode in modes]
    counts = [len(step.posterior.modes) for step in subject.steps]
    sheet.over_time(
        path, times, rr.Points2D.columns(positions=places, labels=labels).partition(counts)
    )
    sheet.over_time(f"{path}/rim", times, rr.Points2D.columns(positions=places).partition(counts))


def _estimates(sheet: Sheet, story: Story, subject: Subject) -> None:
    """Filters along the walk, and the last word of RTS and least squares."""
    for key, colour, filtered in (
        ("reference", colours.REFERENCE, subject.result.reference),
        ("ekf", colours.EKF, subject.result.ekf),
    ):
        if filtered is not None:
            _filter(sheet, story, filtered, entity("plan", "cells", subject.cell, key), colour)
    for estimate in subject.picture.estimates:
        if estimate.key in ("rts", "batch") and np.hypot(*estimate.x[:2]) < FARTHEST_M:
            path = entity("plan", "cells", subject.cell, estimate.key)
            place = (float(estimate.x[0]), float(estimate.x[1]))
            _mark(sheet, path, place, estimate.colour, 5.0)
            axes, turn = ellipse_axes(estimate.p[None])
            # an ellipse has no angle: its entity is turned
            drawn = rr.Ellipses2D(half_sizes=axes, colors=[estimate.colour], line_radii=points(1.0))
            move = rr.Transform3D(translation=(*place, 0.0), quaternion=rr.Quaternion(xyzw=turn[0]))
            sheet.always(f"{path}/ellipse", drawn, move)


def _filter(sheet: Sheet, story: Story, filtered: FilterPath, path: str, colour: Colour) -> None:
    """A filter's path, and its place and 95 % ellipse at each reading."""
    places = story.local(filtered.x[:, 0], filtered.x[:, 1])
    with np.errstate(invalid="ignore"):
        sane = np.all(np.isfinite(filtered.p), axis=(1, 2)) & (
            np.hypot(places[:, 0], places[:, 1]) < FARTHEST_M
        )
    t_ns, places = filtered.t_ns[sane], places[sane]
    if not len(places):
        return
    if len(places) > 1:
        drawn = rr.LineStrips2D(
            [places.astype(np.float32)], colors=[(*colour, 130)], radii=points(0.75)
        )
        sheet.always(f"{path}/path", drawn)
    sheet.always(path, rr.Points2D.from_fields(colors=[colour], radii=points(5.0), draw_order=15.0))
    sheet.over_time(path, t_ns, rr.Points2D.columns(positions=places))
    axes, turns = ellipse_axes(filtered.p[sane])
    sheet.always(
        f"{path}/ellipse", rr.Ellipses2D.from_fields(colors=[colour], line_radii=points(1.25))
    )
    move = rr.Transform3D.columns(
        translation=np.column_stack([places, np.zeros(len(places))]), quaternion=turns
    )
    sheet.over_time(f"{path}/ellipse", t_ns, rr.Ellipses2D.columns(half_sizes=axes), move)


def _claims(sheet: Sheet, story: Story, subject: Subject) -> None:
    """Where the cell is said to stand, in the colour of the verdict; around it two sigma of what
    was said.
    """
    for i, claim in enumerate(subject.claims, 1):
        place = story.place_of(claim.claim.lat_deg, claim.claim.lon_deg)
        if place is None or np.hypot(*place) > FARTHEST_M:
            continue
        path, ink = (
            entity("plan", "cells", subject.cell, "claims", str(i)),
            colour_of_verdict(claim.verdict),
        )
        drawn = rr.Points2D(
            [place],
            colors=[ink],
            radii=points(8.0),
            labels=[f"claim: {claim.verdict}"],
            draw_order=25.0,
        )
        sheet.always(path, drawn)
        if claim.claim.sigma_m > 0.0:
            ring = place + 2.0 * claim.claim.sigma_m * np.column_stack(
                [np.cos(_CIRCLE), np.sin(_CIRCLE)]
            )
            sheet.always(
                f"{path}/two_sigma", rr.LineStrips2D([ring], colors=[ink], radii=points(1.0))
            )


def _all_cells(sheet: Sheet, story: Story) -> None:
    """Where every cell of the run that has a place stands, with its 95 % region."""
    for cell in story.cells:
        if cell.posterior is None or cell.verdict == "cannot tell" or story.box is None:
            continue
        ink = story.inks.get(cell.cell, colours.QUIET)
        found = rings(cell.posterior.squares, SHARES["95"], story.origin_m)
        region = rr.LineStrips2D(closed(found), colors=[(*ink, 200)], radii=points(0.75))
        sheet.always(entity("plan", "all", cell.cell, "region95"), region)
        modes = cell.posterior.modes
        places = story.local(
            np.array([mode.x_m for mode in modes]), np.array([mode.y_m for mode in modes])
        )
        labels = [f"{cell.cell} {mode_label(cell.posterior, mode)}".rstrip() for mode in modes]
        drawn = rr.Points2D(
            places, colors=[ink], radii=points(6.0), labels=labels, show_labels=True
        )
        sheet.always(entity("plan", "all", cell.cell), drawn)


def _mark(
    sheet: Sheet, path: str, place_m: tuple[float, float], colour: Colour, radius: float
) -> None:
    sheet.always(
        path, rr.Points2D([place_m], colors=[colour], radii=points(radius), draw_order=20.0)
    )
