"""The calls of rerun that a recording is made of, and the styles of its plots."""

from collections.abc import Iterable
from typing import Any

import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from postproc.pictures.clock import Clock
from postproc.pictures.colours import Colour

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
