"""Points and lines on one of two surfaces: the plan in local metres, or the map of the world.

Positions come in local metres and paths without the name of the surface. The map has no drawing
order and no labels; they are left out there.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from postproc.pictures import colours
from postproc.pictures.colours import Bytes, Colour
from postproc.pictures.picture import mode_label
from postproc.pictures.survey import Clock, evenly_spaced
from postproc.view.view_model import CellView, ViewModel

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


def step_line(name: str, ink: Ink, width: float = 2.0) -> rr.SeriesLines:
    """Style of a line that keeps a value until the next one."""
    step = rr.components.InterpolationMode.StepAfter
    return rr.SeriesLines(colors=[ink], names=[name], widths=[width], interpolation_mode=step)


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
    positions_m = view.survey.modes_m([mode for one in posteriors for mode in one.modes])
    counts = [len(posterior.modes) for posterior in posteriors]
    labels = [mode_label(posterior, mode) for posterior in posteriors for mode in posterior.modes]
    if surface.is_plan:
        rim = Style([colours.PAPER], 7.0, 19.0)
        surface.points_over_time((*path, "modes", "rim"), cell.t_ns, positions_m, rim, counts)
    style = Style([colours.POSTERIOR], 5.0, 20.0)
    surface.points_over_time((*path, "modes"), cell.t_ns, positions_m, style, counts, labels=labels)
