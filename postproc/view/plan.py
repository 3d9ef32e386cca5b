"""The plan: metres east and north of the first fix, seen from above; and the map of the world."""

from collections.abc import Callable, Iterable, Sequence
from io import BytesIO
from itertools import pairwise, product
from math import ceil, cos, floor, log2, radians
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import rerun as rr
from PIL import Image

from logger.core.arrays import FloatArray, IntArray
from logger.core.certainty import ellipse95
from logger.core.locator.region import LEVEL, Squares
from logger.core.places import MAX_GAP_S, Places
from postproc.basemap import Basemap
from postproc.estimators.filters import FilterPath
from postproc.notebook_plan import length_text, round_step
from postproc.pictures import colours
from postproc.pictures.colours import Bytes, Colour
from postproc.pictures.picture import legend_of, mode_labels, region_rings
from postproc.pictures.survey import Box, Clock, Walk, evenly_spaced
from postproc.result import BATCH, RTS, Estimate
from postproc.view.view_model import CellView, ViewModel

# `RerunWriter` draws points and lines on both. Positions come in local metres and paths without the
# name of the surface. The map has no drawing order and no labels; they are left out there.

Ink = Colour | tuple[int, int, int, int]
"""A colour, with its opacity where it is not opaque."""


class RerunWriter:
    """Writes entities of a recording on the timelines `elapsed` and, where known, `utc`.

    Columns without a row are left out. Times are nanoseconds since boot, in ascending order.
    """

    def __init__(self, recording: rr.RecordingStream, clock: Clock) -> None:
        self._recording = recording
        self._clock = clock

    def log_static(self, path: str, *archetypes: Any) -> None:
        """Log what does not change with time."""
        self._recording.log(path, *archetypes, static=True)

    def send_columns(self, path: str, t_ns: IntArray, *columns: Iterable[Any]) -> None:
        """Send columns with a row for each of the times (n,)."""
        if len(t_ns):
            merged = [part for column in columns for part in column]
            self._recording.send_columns(path, self._time_columns(t_ns), merged)

    def plot(self, path: str, t_ns: IntArray, values: FloatArray, style: Any) -> None:
        """A plot of values (n,) in the style of `line`, `step_line` or `dots`."""
        self.log_static(path, style)
        self.send_columns(path, t_ns, rr.Scalars.columns(scalars=values))

    def plot_band(
        self, path: str, t_ns: IntArray, mean: FloatArray, sigma: FloatArray, *, name: str, ink: Ink
    ) -> None:
        """A plot of means (n,) with a band of plus and minus two standard deviations."""
        self.log_static(path, rr.Measurements.from_fields(colors=[ink], names=[name], widths=[1.5]))
        # rerun draws a band of one standard deviation
        columns = rr.Measurements.columns(values=mean, variances=(2.0 * sigma) ** 2)
        self.send_columns(path, t_ns, columns)

    def _time_columns(self, t_ns: IntArray) -> list[rr.TimeColumn]:
        # arrays of 64-bit integers: floats would lose nanoseconds, lists would cost half a second
        elapsed = self._clock.elapsed_ns(t_ns).astype("timedelta64[ns]")
        columns = [rr.TimeColumn("elapsed", duration=elapsed)]
        utc_ns = self._clock.utc_ns(t_ns)
        if utc_ns is not None:
            columns.append(rr.TimeColumn("utc", timestamp=utc_ns.astype("datetime64[ns]")))
        return columns


def entity(*parts: str) -> str:
    """Path of an entity; names of cells may contain any character."""
    return str(rr.new_entity_path(list(parts)))


def line(name: str, ink: Ink, width: float = 1.5) -> rr.SeriesLines:
    """Style of a line; extremes stay visible where there are more readings than pixels."""
    extremes = rr.components.AggregationPolicy.MinMax
    return rr.SeriesLines(colors=[ink], names=[name], widths=[width], aggregation_policy=extremes)


def step_line(name: str, ink: Ink) -> rr.SeriesLines:
    """Style of a line that keeps a value until the next one."""
    step = rr.components.InterpolationMode.StepAfter
    return rr.SeriesLines(colors=[ink], names=[name], widths=[2.0], interpolation_mode=step)


def dots(name: str, ink: Ink, size: float = 1.5) -> rr.SeriesPoints:
    """Style of points."""
    return rr.SeriesPoints(colors=[ink], names=[name], marker_sizes=[size])


def on_screen(size: float) -> Any:
    """A radius in points of the screen, the same at every zoom."""
    return rr.Radius.ui_points(size)


_ON_A_MAP = 1.25
"""Radii on a map, relative to the plan: its ground is light and full of detail."""


class Style(NamedTuple):
    """Colours of the marks, or one for all; radius on screen; a larger `order` is drawn above."""

    inks: Sequence[Ink] | Bytes
    radius: float
    order: float = 20.0


class Surface(NamedTuple):
    """`convert` turns local metres (n, 2) into positions of the surface."""

    writer: RerunWriter
    name: str
    is_plan: bool
    most_points: int
    convert: Callable[[FloatArray], FloatArray]

    def points(
        self, path: Sequence[str], positions_m: FloatArray, style: Style, **labels: Any
    ) -> None:
        """Static points (n, 2)."""
        fields = self._point_fields(positions_m, labels) | self._style(style)
        self.log_static(path, self._points.from_fields(**fields))

    def lines(self, path: Sequence[str], strips_m: Sequence[FloatArray], style: Style) -> None:
        """Static strips (k, 2); without one there is no entity."""
        if strips_m:
            fields = self._strip_fields(strips_m) | self._style(style)
            self.log_static(path, self._lines.from_fields(**fields))

    def points_over_time(
        self,
        path: Sequence[str],
        t_ns: IntArray,
        positions_m: FloatArray,
        style: Style,
        counts: Sequence[int] | None = None,
        **labels: Any,
    ) -> None:
        """A point for each time, or `counts` of them; `labels` (n,) change with the points."""
        shown = {"show_labels": True} if labels and self.is_plan else {}
        self.log_static(path, self._points.from_fields(**self._style(style), **shown))
        columns = self._points.columns(**self._point_fields(positions_m, labels))
        self.send_columns(path, t_ns, columns if counts is None else columns.partition(counts))

    def lines_over_time(
        self,
        path: Sequence[str],
        t_ns: IntArray,
        strips_m: Sequence[Sequence[FloatArray]],
        style: Style,
    ) -> None:
        """Several strips (k, 2) for each time."""
        self.log_static(path, self._lines.from_fields(**self._style(style)))
        flat = [strip for strips in strips_m for strip in strips]
        columns = self._lines.columns(**self._strip_fields(flat))
        self.send_columns(path, t_ns, columns.partition([len(strips) for strips in strips_m]))

    def log_static(self, path: Sequence[str], *archetypes: Any) -> None:
        """As `RerunWriter.log_static`."""
        self.writer.log_static(entity(self.name, *path), *archetypes)

    def send_columns(self, path: Sequence[str], t_ns: IntArray, *columns: Any) -> None:
        """As `RerunWriter.send_columns`."""
        self.writer.send_columns(entity(self.name, *path), t_ns, *columns)

    @property
    def _points(self) -> Any:
        return rr.Points2D if self.is_plan else rr.GeoPoints

    @property
    def _lines(self) -> Any:
        return rr.LineStrips2D if self.is_plan else rr.GeoLineStrings

    def _point_fields(self, positions_m: FloatArray, labels: dict[str, Any]) -> dict[str, Any]:
        positions = self.convert(np.asarray(positions_m, float))
        return {"positions": positions} | (labels if self.is_plan else {})

    def _strip_fields(self, strips_m: Sequence[FloatArray]) -> dict[str, Any]:
        return {"strips" if self.is_plan else "line_strings": [self.convert(s) for s in strips_m]}

    def _style(self, style: Style) -> dict[str, Any]:
        if self.is_plan:
            return {
                "colors": style.inks,
                "radii": on_screen(style.radius),
                "draw_order": style.order,
            }
        return {"colors": style.inks, "radii": on_screen(_ON_A_MAP * style.radius)}


MOST_STRIPS = 5_000
"""With more strips in one entity the viewer becomes slow."""
FARTHEST_M = 1e6
"""A diverged filter beyond this cannot be drawn in single precision, and shows nothing."""

_REGION_RADII = {"95": 0.75, "50": 1.25}


def draw_walks(surface: Surface, view: ViewModel) -> None:
    """The tracks in grey, and the walker at the time of the cursor."""
    for walk in view.survey.walks:
        strips = [strip for strip in walk.strips_m if len(strip) > 1]
        track = [strips[i] for i in evenly_spaced(len(strips), MOST_STRIPS)]
        grey = Style([(*colours.QUIET, 160)], 1.0, 0.0)
        surface.lines(("walks", walk.run.name, "track"), track, grey)
        shown = evenly_spaced(len(walk.t_ns), surface.most_points)
        style = Style([colours.WALKER], 7.0, 30.0)
        surface.points_over_time(("walker",), walk.t_ns[shown], walk.track_m[shown], style)


def draw_levels(surface: Surface, cell: CellView) -> None:
    """The readings of a cell in the colours of their levels."""
    picture = cell.picture
    shown = evenly_spaced(len(picture.level_dbm), surface.most_points)
    if len(shown):
        inks = colours.level_colours(picture.level_dbm[shown], *picture.level_range_dbm)
        path = ("cells", cell.name, "levels")
        surface.points(path, picture.readings_m[shown], Style(inks, 2.5, 5.0))


def draw_posterior(surface: Surface, view: ViewModel, cell: CellView) -> None:
    """The regions that contain 95 % and 50 % of the probability, and the modes, step by step."""
    if not cell.steps:
        return
    path = ("cells", cell.name, "posterior")
    for share, radius in _REGION_RADII.items():
        style = Style([colours.POSTERIOR], radius, 10.0)
        rings = [regions[share] for regions in cell.regions]
        surface.lines_over_time((*path, f"region{share}"), cell.t_ns, rings, style)
    posteriors = [step.posterior for step in cell.steps]
    positions_m = view.survey.modes_m([mode for one in posteriors for mode in one.likely_modes])
    counts = [len(posterior.likely_modes) for posterior in posteriors]
    labels = [text for posterior in posteriors for text in mode_labels(posterior)]
    if surface.is_plan:
        rim = Style([colours.PAPER], 7.0, 19.0)
        surface.points_over_time((*path, "modes", "rim"), cell.t_ns, positions_m, rim, counts)
    style = Style([colours.POSTERIOR], 5.0, 20.0)
    surface.points_over_time((*path, "modes"), cell.t_ns, positions_m, style, counts, labels=labels)


# --- what the plan shows ---

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
    bar = [[(box.west, y), (box.west + length_m, y)]]
    scale = rr.LineStrips2D(
        bar, colors=[_INK], radii=on_screen(2.0), labels=[length_text(length_m)]
    )
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
    return range(ceil(low / step), floor(high / step) + 1)


_GROUND_ORDER = -25.0
"""Below the density and everything else."""
_GROUND_OPACITY = 0.3
"""Dark enough for what glows on it."""


def draw_basemap(writer: RerunWriter, basemap: Basemap) -> None:
    """Below everything else on the plan."""
    rows, columns = basemap.pixels.shape[:2]
    box = basemap.box
    picture = rr.EncodedImage(
        contents=basemap.jpeg(PAPER),
        media_type="image/jpeg",
        opacity=_GROUND_OPACITY,
        draw_order=_GROUND_ORDER,
    )
    corner = rr.Transform3D(
        translation=(box.west, box.north, 0.0),
        scale=(box.width / columns, -box.height / rows, 1.0),
    )
    writer.log_static("plan/ground/basemap", picture, corner)


MOST_POINTS = 40_000
"""With more points in one entity the viewer becomes slow."""
_TRAIL_FIXES = 30
"""Half a minute of one fix a second."""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)


def draw_plan(writer: RerunWriter, view: ViewModel) -> None:
    """Everything on the plan; nothing for a run without a fix."""
    if view.box is None:
        return
    plan = Surface(
        writer,
        "plan",
        is_plan=True,
        most_points=MOST_POINTS,
        convert=lambda m: m.astype(np.float32),
    )
    draw_ground(plan, view.box)
    draw_walks(plan, view)
    _draw_trail(plan, view.survey.walks)
    for cell in view.cell_views:
        draw_level_scale(plan, cell, view.box)
        draw_key(plan, view, cell)
        draw_density(plan, view, cell)
        draw_levels(plan, cell)
        _draw_level_track(plan, cell)
        draw_posterior(plan, view, cell)
        _draw_estimates(plan, view, cell)
        _draw_claims(plan, view, cell)
        if cell.picture.truth_m is not None:
            style = Style([colours.TRUTH], 7.0, 20.0)
            plan.points(("cells", cell.name, "truth"), cell.picture.truth_m[None], style)
    _draw_all_cells(plan, view)


def level_strips(
    t_ns: IntArray, positions_m: FloatArray, level_dbm: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """The track from reading to reading, and the mean level of each strip.

    At most `MOST_STRIPS` strips (k, 2); none where there was no reading for long.
    """
    n_steps = max(1, -(-(len(t_ns) - 1) // MOST_STRIPS))
    longest_ns = n_steps * MAX_GAP_S * 1e9
    starts = range(0, len(t_ns) - 1, n_steps)
    # of several runs an earlier one may follow: time leaps back
    slices = [
        slice(start, start + n_steps + 1)
        for start in starts
        if 0 <= t_ns[min(start + n_steps, len(t_ns) - 1)] - t_ns[start] <= longest_ns
    ]
    means_dbm = np.array([np.mean(level_dbm[part]) for part in slices])
    return [positions_m[part] for part in slices], means_dbm


def ellipse_axes(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """95 % ellipses of covariances (n, k, k): semi-axes (n, 2) in m, quaternions (n, 4).

    A quaternion turns x to the major axis. Azimuths run clockwise from north, angles in a plane
    counterclockwise from east: angle = 90 deg - azimuth.
    """
    axes_m, quaternions = np.empty((len(p), 2)), np.zeros((len(p), 4))
    # lists of floats: indexing each matrix would take longer than the ellipses
    columns = (p[:, row, column].tolist() for row, column in ((0, 0), (0, 1), (1, 1)))
    for i, (xx, xy, yy) in enumerate(zip(*columns, strict=True)):
        ellipse = ellipse95(xx, xy, yy)
        axes_m[i] = ellipse.semi_major_m, ellipse.semi_minor_m
        half_angle = 0.5 * np.radians(90.0 - ellipse.azimuth_deg)
        quaternions[i, 2:] = np.sin(half_angle), np.cos(half_angle)
    return axes_m, quaternions


def _draw_trail(plan: Surface, walks: Sequence[Walk]) -> None:
    ink, path = (*colours.WALKER, 200), ("walker", "trail")
    style = rr.LineStrips2D.from_fields(colors=[ink], radii=on_screen(3.0), draw_order=29.0)
    plan.log_static(path, style)
    for walk in walks:
        shown = evenly_spaced(len(walk.t_ns), MOST_STRIPS // len(walks))
        # trails of equal length: the first ones stay at the first fix
        back = np.arange(_TRAIL_FIXES - 1, -1, -1)
        trails = plan.convert(walk.track_m)[np.maximum(shown[:, None] - back, 0)]
        plan.send_columns(path, walk.t_ns[shown], rr.LineStrips2D.columns(strips=trails))


def _draw_level_track(plan: Surface, cell: CellView) -> None:
    obs, picture = cell.result.obs, cell.picture
    if obs is not None:
        strips_m, means_dbm = level_strips(obs.t_ns, picture.readings_m, picture.level_dbm)
        inks = colours.level_colours(means_dbm, *picture.level_range_dbm)
        plan.lines(("cells", cell.name, "levels", "track"), strips_m, Style(inks, 2.5, 4.0))


def _draw_estimates(plan: Surface, view: ViewModel, cell: CellView) -> None:
    for estimate in cell.picture.estimates:
        if estimate.estimator in (RTS, BATCH) and np.hypot(*estimate.x[:2]) < FARTHEST_M:
            _draw_final(plan, ("cells", cell.name, estimate.estimator.key), estimate)
    for estimator, filtered in cell.filters:
        path = ("cells", cell.name, estimator.key)
        _draw_filter(plan, view, path, filtered, colours.ESTIMATORS[estimator.key])


def _draw_final(plan: Surface, path: Sequence[str], estimate: Estimate) -> None:
    position_m, ink = estimate.x[:2], [colours.ESTIMATORS[estimate.estimator.key]]
    plan.points(path, position_m[None], Style(ink, 5.0, 20.0))
    axes_m, (quaternion,) = ellipse_axes(estimate.p[None])
    # rerun's ellipses have no angle: the entity is rotated
    plan.log_static(
        (*path, "ellipse"),
        rr.Ellipses2D(half_sizes=axes_m, colors=ink, line_radii=on_screen(1.0)),
        rr.Transform3D(
            translation=(*position_m.tolist(), 0.0), quaternion=rr.Quaternion(xyzw=quaternion)
        ),
    )


def _draw_filter(
    plan: Surface, view: ViewModel, path: Sequence[str], filtered: FilterPath, ink: Colour
) -> None:
    """A filter's path, and its position and ellipse at each reading."""
    positions_m = view.survey.local(Places.of(*filtered.x[:, :2].T))
    with np.errstate(invalid="ignore"):
        drawable = np.all(np.isfinite(filtered.p), axis=(1, 2)) & (
            np.hypot(*positions_m.T) < FARTHEST_M
        )
    t_ns, positions_m = filtered.t_ns[drawable], positions_m[drawable]
    if not len(t_ns):
        return
    if len(t_ns) > 1:
        plan.lines((*path, "path"), [positions_m], Style([(*ink, 130)], 0.75))
    plan.points_over_time(path, t_ns, positions_m, Style([ink], 5.0, 15.0))
    axes_m, quaternions = ellipse_axes(filtered.p[drawable])
    ellipse = (*path, "ellipse")
    style = rr.Ellipses2D.from_fields(colors=[ink], line_radii=on_screen(1.25))
    plan.log_static(ellipse, style)
    centres_m = np.column_stack([positions_m, np.zeros(len(t_ns))])
    plan.send_columns(
        ellipse,
        t_ns,
        rr.Ellipses2D.columns(half_sizes=axes_m),
        rr.Transform3D.columns(translation=centres_m, quaternion=quaternions),
    )


def _draw_claims(plan: Surface, view: ViewModel, cell: CellView) -> None:
    if view.survey.utm is None:
        return
    for i, tested in enumerate(cell.claims, 1):
        claim, ink = tested.claim, [colours.verdict_colour(tested.verdict)]
        position_m = view.survey.position_m(claim.at)
        if np.hypot(*position_m) > FARTHEST_M:
            continue
        path = ("cells", cell.name, "claims", str(i))
        labels = [f"claim: {tested.verdict}"]
        plan.points(path, position_m[None], Style(ink, 8.0, 25.0), labels=labels)
        if claim.sigma_m > 0.0:
            circle = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])
            ring_m = position_m + 2.0 * claim.sigma_m * circle
            plan.lines((*path, "two_sigma"), [ring_m], Style(ink, 1.0))


def _draw_all_cells(plan: Surface, view: ViewModel) -> None:
    for result in view.cells:
        posterior = result.posterior
        if posterior is None or result.verdict == "cannot tell":
            continue
        ink = view.cell_colours.get(result.cell, colours.QUIET)
        rings = region_rings(posterior.squares, LEVEL, view.survey.origin_m)
        plan.lines(("all", result.cell, "region95"), rings, Style([(*ink, 200)], 0.75))
        labels = [f"{result.cell} {text}".rstrip() for text in mode_labels(posterior)]
        positions_m = view.survey.modes_m(posterior.likely_modes)
        style = Style([ink], 6.0, 30.0)
        plan.points(("all", result.cell), positions_m, style, labels=labels, show_labels=True)


MOST_PIXELS = 192
"""Along the longer side of the plan: twenty steps are a third of a megabyte."""
_ORDER = -15.0
"""Below all lines, above the base map."""
_SHADES = 64
_OPACITY = 0.85
"""Below 1, or the viewer draws transparent pixels as black."""


def draw_density(plan: Surface, view: ViewModel, cell: CellView) -> None:
    """Density at each step, over the whole plan."""
    box = view.box
    if not cell.steps or box is None:
        return
    pixel_m = box.size / MOST_PIXELS
    path = ("cells", cell.name, "posterior", "density")
    style = rr.EncodedImage.from_fields(media_type="image/png", opacity=_OPACITY, draw_order=_ORDER)
    corner = rr.Transform3D(translation=(box.west, box.north, 0.0), scale=(pixel_m, -pixel_m, 1.0))
    plan.log_static(path, style, corner)
    origin_m = view.survey.origin_m
    images = [png(density(step.posterior.squares, origin_m, box, pixel_m)) for step in cell.steps]
    plan.send_columns(path, cell.t_ns, rr.EncodedImage.columns(blob=images))


def density(squares: Squares, origin_m: FloatArray, box: Box, pixel_m: float) -> FloatArray:
    """Probability of each pixel of the plan, shape (rows, columns), north up.

    A square contributes to a pixel by their common area. Its corners are steps in a two-dimensional
    difference array, which is summed in both directions.
    """
    rows, columns = box.shape(pixel_m)
    half = 0.5 * squares.size_m / pixel_m
    across = (squares.x_m - origin_m[0] - box.west) / pixel_m
    down = (box.north - squares.y_m + origin_m[1]) / pixel_m
    share = squares.probability * (pixel_m / squares.size_m) ** 2
    steps = np.zeros((rows + 2, columns + 2))
    for side_y, side_x in product((-1.0, 1.0), repeat=2):
        edges = product(
            _split_edge(down + side_y * half, rows), _split_edge(across + side_x * half, columns)
        )
        for (row, row_share), (column, column_share) in edges:
            np.add.at(steps, (row, column), side_y * side_x * share * row_share * column_share)
    summed = np.cumsum(np.cumsum(steps, axis=0), axis=1)
    return np.maximum(summed[:rows, :columns], 0.0)


def _split_edge(
    edge: FloatArray, count: int
) -> tuple[tuple[IntArray, FloatArray], tuple[IntArray, FloatArray]]:
    """The two pixels next to an edge, and the share of its step that each gets."""
    edge = np.clip(edge, 0.0, count)
    first = np.floor(edge).astype(np.int64)
    return (first, first + 1.0 - edge), (first + 1, edge - first)


def png(pixel_density: FloatArray) -> bytes:
    """A glow in the posterior's colour, transparent where the density (rows, columns) is 0."""
    peak = float(np.max(pixel_density))
    # the square root shows a hundredth of the peak's density, too
    share = np.sqrt(pixel_density / peak) if peak > 0.0 else pixel_density
    picture = Image.fromarray(np.rint(share * (_SHADES - 1)).astype(np.uint8), "P")
    picture.putpalette(_palette().tobytes(), "RGBA")
    file = BytesIO()
    picture.convert("RGBA").save(file, "PNG", compress_level=6)
    return file.getvalue()


def _palette() -> npt.NDArray[np.uint8]:
    """From transparent to nearly white, shape (shades, 4)."""
    share = np.linspace(0.0, 1.0, _SHADES)[:, None]
    white = np.maximum(share - 0.6, 0.0) * 1.6  # from 60 % of the scale on
    rgb = np.array(colours.POSTERIOR) * (1.0 - white) + 255.0 * white
    return np.rint(np.hstack([rgb, 255.0 * share])).astype(np.uint8)


# A map view of rerun has neither ellipses nor filled areas.

_MOST_POINTS = 5_000
"""With more points the map view becomes slow."""
_MAP_PIXELS, _TILE_PIXELS = 700, 256
"""Size of the map view in a window of usual size, and of a tile of Web Mercator."""
_EQUATOR_M = 40_075_017.0
_MOST_ZOOM = 18.0
"""OpenStreetMap has no tiles beyond 19."""


def draw_map(writer: RerunWriter, view: ViewModel) -> None:
    """Walks, and for each cell shown in detail its levels, regions and positions."""
    if view.box is None:
        return
    surface = Surface(
        writer, "map", is_plan=False, most_points=_MOST_POINTS, convert=view.survey.degrees
    )
    # the map centres on what is visible at the moment: an invisible frame keeps it in place
    corners = view.survey.degrees(view.box.corners_m)
    frame = rr.GeoPoints(lat_lon=corners, colors=[(0, 0, 0, 0)], radii=on_screen(0.1))
    surface.log_static(("frame",), frame)
    draw_walks(surface, view)
    for cell in view.cell_views:
        draw_levels(surface, cell)
        draw_posterior(surface, view, cell)
        _draw_marks(surface, view, cell)


def zoom_of(view: ViewModel) -> float:
    """Web Mercator zoom at which the plan's box fills the map view."""
    box = view.box
    if box is None:
        return 1.0
    lat_deg = float(view.survey.degrees(box.corners_m)[:, 0].mean())
    around_m = _EQUATOR_M * cos(radians(lat_deg))
    return min(log2(around_m / max(box.size, 1.0) * _MAP_PIXELS / _TILE_PIXELS), _MOST_ZOOM)


def _draw_marks(surface: Surface, view: ViewModel, cell: CellView) -> None:
    marks = [
        (estimate.x[:2], colours.ESTIMATORS[estimate.estimator.key])
        for estimate in cell.picture.estimates
    ]
    if cell.picture.truth_m is not None:
        marks.append((cell.picture.truth_m, colours.TRUTH))
    for tested in cell.claims:
        position_m = view.survey.position_m(tested.claim.at)
        marks.append((position_m, colours.verdict_colour(tested.verdict)))
    near = [(position_m, ink) for position_m, ink in marks if np.hypot(*position_m) < FARTHEST_M]
    if near:
        positions_m, inks = zip(*near, strict=True)
        surface.points(("cells", cell.name, "marks"), np.array(positions_m), Style(inks, 4.0))
