"""The plan: metres east and north of the first fix, seen from above."""

from itertools import pairwise

import numpy as np
import rerun as rr

from logger.core.arrays import FloatArray
from postproc.estimators.filtered import Filtered
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import Box, Picture, mode_label, nice_step
from postproc.pictures.scene_sheet import Sheet, closed, ellipse_axes, thinned

_MOST_STRIPS = 5_000
_MOST_POINTS = 40_000
_TRAIL_FIXES = 20
_FARTHEST_M = 1e6
"""A filter that has run away farther than this cannot be drawn in single precision and tells nothing."""
_SCALE_STEPS = 24

KEY_WIDTH = 0.3
"""Room for the colour key to the east of the plan, as a share of its size."""


def draw_plan(sheet: Sheet, picture: Picture) -> None:
    """Everything on the plan; nothing for a run without a fix."""
    if picture.box is None:
        return
    # in a 2-D view y points down: mirror the picture, so that the data stay true
    sheet.always("plan", rr.Transform3D(scale=(1.0, -1.0, 1.0)))
    _ground(sheet, picture.box)
    _legend(sheet, picture)
    _key(sheet, picture)
    _track(sheet, picture)
    _walker(sheet, picture)
    _posterior(sheet, picture)
    _estimates(sheet, picture)
    if picture.truth_m is not None:
        _mark(sheet, "plan/truth", picture.truth_m, colours.TRUTH, 7.0)


def _ground(sheet: Sheet, box: Box) -> None:
    """Grid, scale bar and an arrow to the north."""
    step = nice_step(box.size, 12)
    easts = np.arange(np.ceil(box.west / step), np.floor(box.east / step) + 1) * step
    norths = np.arange(np.ceil(box.south / step), np.floor(box.north / step) + 1) * step
    lines = [[(x, box.south), (x, box.north)] for x in easts] + [[(box.west, y), (box.east, y)] for y in norths]
    if lines:
        thin = rr.Radius.ui_points(0.5)
        sheet.always("plan/grid", rr.LineStrips2D(lines, colors=[(*colours.QUIET, 90)], radii=thin, draw_order=-10.0))
    below = box.south - 0.05 * box.height
    bar = [(box.west, below), (box.west + step, below)]
    label = f"{step:g} m" if step < 1000.0 else f"{step / 1000.0:g} km"
    thick = rr.Radius.ui_points(2.0)
    sheet.always("plan/scale", rr.LineStrips2D([bar], colors=[colours.QUIET], radii=thick, labels=[label]))
    arrow = 0.08 * box.height
    foot = (box.west + 0.03 * box.width, box.north - 1.5 * arrow)
    north = rr.Arrows2D(vectors=[(0.0, arrow)], origins=[foot], colors=[colours.QUIET], labels=["N"])
    sheet.always("plan/north", north)


def _legend(sheet: Sheet, picture: Picture) -> None:
    """The scale of levels, below the plan."""
    box = picture.box
    if box is None or not len(picture.heard_dbm):
        return
    weakest, strongest = picture.strength_dbm
    height, y = 0.02 * box.height, box.south - 0.05 * box.height
    x = np.linspace(box.east - 0.4 * box.width, box.east, _SCALE_STEPS + 1)
    strips = [[(west, y), (east, y)] for west, east in pairwise(x.tolist())]
    bar = rr.LineStrips2D(strips, colors=colours.scale(_SCALE_STEPS), radii=0.5 * height)
    sheet.always("plan/levels/scale", bar)
    ends = rr.Points2D(
        [(x[0], y - 1.5 * height), (x[-1], y - 1.5 * height)],
        labels=[f"{weakest:.0f} dBm", f"{strongest:.0f} dBm"],
        colors=colours.scale(2),
        radii=rr.Radius.ui_points(0.1),
        show_labels=True,
    )
    sheet.always("plan/levels/ends", ends)


def _key(sheet: Sheet, picture: Picture) -> None:
    """Which colour is whose, beside the plan: labels at the places themselves would cover each other."""
    box = picture.box
    if box is None:
        return
    named = [("walker", colours.WALKER)]
    if picture.region95:
        named.append(("posterior 95 %, 50 %", colours.POSTERIOR))
    named += [(estimate.name, estimate.colour) for estimate in picture.estimates]
    if picture.truth_m is not None:
        named.append(("truth (simulated)", colours.TRUTH))
    places = [(box.east + 0.5 * KEY_WIDTH * box.size, box.north - 0.09 * i * box.height) for i in range(len(named))]
    labels, rgb = [name for name, _ in named], [colour for _, colour in named]
    radius = rr.Radius.ui_points(5.0)
    sheet.always("plan/key", rr.Points2D(places, labels=labels, colors=rgb, radii=radius, show_labels=True))


def _track(sheet: Sheet, picture: Picture) -> None:
    """The walk in grey, cut where the receiver was silent, and the focus cell's readings in the colours of levels."""
    strips = [strip.astype(np.float32) for strip in picture.strips_m if len(strip) > 1]
    strips = strips[thinned(len(strips), _MOST_STRIPS)]
    thin = rr.Radius.ui_points(1.0)
    if strips:
        sheet.always("plan/track", rr.LineStrips2D(strips, colors=[(*colours.QUIET, 160)], radii=thin, draw_order=0.0))
    if len(picture.heard_m):
        part = thinned(len(picture.heard_m), _MOST_POINTS)
        rgb = colours.of_levels(picture.heard_dbm[part], *picture.strength_dbm)
        radius = rr.Radius.ui_points(3.0)
        sheet.always("plan/readings", rr.Points2D(picture.heard_m[part], colors=rgb, radii=radius, draw_order=5.0))


def _walker(sheet: Sheet, picture: Picture) -> None:
    """Where the walker is at the time looked at, and where he came from."""
    assert picture.track is not None
    t_ns, places = picture.track.t_ns, picture.track_m.astype(np.float32)
    sheet.always("plan/walker", rr.Points2D.from_fields(colors=[colours.WALKER], radii=rr.Radius.ui_points(7.0)))
    sheet.over_time("plan/walker", t_ns, rr.Points2D.columns(positions=places))
    # trails of equal length: the first ones stand still at the first fix
    ago = np.arange(_TRAIL_FIXES - 1, -1, -1)
    trails = places[np.maximum(np.arange(len(places))[:, None] - ago, 0)]
    style = rr.LineStrips2D.from_fields(colors=[(*colours.WALKER, 200)], radii=rr.Radius.ui_points(2.5))
    sheet.always("plan/trail", style)
    sheet.over_time("plan/trail", t_ns, rr.LineStrips2D.columns(strips=trails))


def _posterior(sheet: Sheet, picture: Picture) -> None:
    """Regions that hold 95 % and 50 % of the probability, and the places in them."""
    for name, rings, width in (("95", picture.region95, 1.5), ("50", picture.region50, 2.5)):
        if rings:
            radius = rr.Radius.ui_points(0.5 * width)
            strips = rr.LineStrips2D(closed(rings), colors=[colours.POSTERIOR], radii=radius, draw_order=10.0)
            sheet.always(f"plan/posterior/region{name}", strips)
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is not None:
        places = picture.local(
            np.array([mode.x_m for mode in posterior.modes]), np.array([mode.y_m for mode in posterior.modes])
        )
        labels = [mode_label(posterior, mode) for mode in posterior.modes]
        points = rr.Points2D(
            places,
            labels=labels if any(labels) else None,
            colors=[colours.POSTERIOR],
            radii=rr.Radius.ui_points(5.0),
            show_labels=True,
        )
        sheet.always("plan/posterior/places", points)


def _estimates(sheet: Sheet, picture: Picture) -> None:
    """Filters along the walk, and the last word of RTS and least squares."""
    focus = picture.focus
    if focus is None:
        return
    for key, colour, filtered in (
        ("reference", colours.REFERENCE, focus.reference),
        ("ekf", colours.EKF, focus.ekf),
    ):
        if filtered is not None:
            _filter(sheet, picture, filtered, f"plan/{key}", colour)
    for estimate in picture.estimates:
        if estimate.key in ("rts", "batch") and np.hypot(*estimate.x[:2]) < _FARTHEST_M:
            path, place = f"plan/{estimate.key}", (float(estimate.x[0]), float(estimate.x[1]))
            _mark(sheet, path, place, estimate.colour, 5.0)
            axes, turn = ellipse_axes(estimate.p[None])
            sheet.always(f"{path}/ellipse", *_ellipse_at(place, axes[0], turn[0], estimate.colour))


def _filter(sheet: Sheet, picture: Picture, filtered: Filtered, path: str, colour: Colour) -> None:
    """A filter's path, and its place and 95 % ellipse at each reading."""
    places = picture.local(filtered.x[:, 0], filtered.x[:, 1])
    with np.errstate(invalid="ignore"):
        sane = np.all(np.isfinite(filtered.p), axis=(1, 2)) & (np.hypot(places[:, 0], places[:, 1]) < _FARTHEST_M)
    t_ns, places = filtered.t_ns[sane], places[sane]
    if not len(places):
        return
    if len(places) > 1:
        strip = places[thinned(len(places), _MOST_POINTS)]
        radius = rr.Radius.ui_points(0.75)
        sheet.always(f"{path}/path", rr.LineStrips2D([strip], colors=[(*colour, 130)], radii=radius))
    sheet.always(path, rr.Points2D.from_fields(colors=[colour], radii=rr.Radius.ui_points(5.0)))
    sheet.over_time(path, t_ns, rr.Points2D.columns(positions=places))
    axes, turns = ellipse_axes(filtered.p[sane])
    outline = rr.Ellipses2D.from_fields(colors=[colour], line_radii=rr.Radius.ui_points(1.25))
    sheet.always(f"{path}/ellipse", outline)
    move = rr.Transform3D.columns(translation=np.column_stack([places, np.zeros(len(places))]), quaternion=turns)
    sheet.over_time(f"{path}/ellipse", t_ns, rr.Ellipses2D.columns(half_sizes=axes), move)


def _ellipse_at(
    place_m: tuple[float, float], axes_m: FloatArray, turn: FloatArray, colour: Colour
) -> tuple[rr.Ellipses2D, rr.Transform3D]:
    # an ellipse has no angle: its entity is turned
    outline = rr.Ellipses2D(half_sizes=[axes_m], colors=[colour], line_radii=rr.Radius.ui_points(1.0))
    return outline, rr.Transform3D(translation=(*place_m, 0.0), quaternion=rr.Quaternion(xyzw=turn))


def _mark(sheet: Sheet, path: str, place_m: tuple[float, float], colour: Colour, size: float) -> None:
    sheet.always(path, rr.Points2D([place_m], colors=[colour], radii=rr.Radius.ui_points(size)))
