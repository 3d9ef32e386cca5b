"""The few calls of rerun that pictures are made of."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from logger.core.ellipse import ellipse95
from postproc.pictures.colours import Colour
from postproc.view.clock import Clock


class Sheet:
    """Writes entities of a recording on the timelines `elapsed` and, where known, `utc`; leaves out
    what is empty.
    """

    def __init__(self, recording: rr.RecordingStream, clock: Clock) -> None:
        self._recording = recording
        self._clock = clock

    def always(self, path: str, *what: Any) -> None:
        """What does not change with time."""
        self._recording.log(path, *what, static=True)

    def over_time(self, path: str, t_ns: IntArray, *columns: Iterable[Any]) -> None:
        """Columns with one row for each time since boot; the times must rise."""
        if len(t_ns):
            self._recording.send_columns(
                path, self._times(t_ns), [one for column in columns for one in column]
            )

    def _times(self, t_ns: IntArray) -> list[rr.TimeColumn]:
        # arrays of 64-bit integers: floats would lose nanoseconds, lists would cost half a second
        elapsed = self._clock.elapsed_ns(t_ns).astype("timedelta64[ns]")
        columns = [rr.TimeColumn("elapsed", duration=elapsed)]
        utc_ns = self._clock.utc_ns(t_ns)
        if utc_ns is not None:
            columns.append(rr.TimeColumn("utc", timestamp=utc_ns.astype("datetime64[ns]")))
        return columns


def entity(*parts: str) -> str:
    """Path of an entity; names of cells may hold any character."""
    return str(rr.new_entity_path(list(parts)))


def line(
    name: str, colour: Colour | tuple[int, int, int, int], width: float = 1.5
) -> rr.SeriesLines:
    """Style of a plotted line; extremes stay visible where there are more readings than pixels."""
    return rr.SeriesLines(
        colors=[colour],
        names=[name],
        widths=[width],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )


def steps(name: str, colour: Colour, width: float = 2.0) -> rr.SeriesLines:
    """Style of a line that keeps a value until the next one is known."""
    held = rr.components.InterpolationMode.StepAfter
    return rr.SeriesLines(colors=[colour], names=[name], widths=[width], interpolation_mode=held)


def dots(name: str, colour: Colour, size: float = 1.5) -> rr.SeriesPoints:
    """Style of plotted points."""
    return rr.SeriesPoints(colors=[colour], names=[name], marker_sizes=[size])


def band(name: str, colour: Colour) -> rr.Measurements:
    """Style of a line with a band around it."""
    return rr.Measurements.from_fields(colors=[colour], names=[name], widths=[1.5])


def two_sigma(value: FloatArray, variance: FloatArray) -> Iterable[Any]:
    """Columns of a line with a band of plus and minus two standard deviations; rerun draws one,
    hence the 4.
    """
    return rr.Measurements.columns(values=value, variances=4.0 * variance)


def strips_by_row(rows: Sequence[Sequence[FloatArray]]) -> Iterable[Any]:
    """Column of line strips (k, 2), several in each row."""
    flat = [strip.astype(np.float32) for row in rows for strip in row]
    return rr.LineStrips2D.columns(strips=flat).partition([len(row) for row in rows])


def points(size: float) -> Any:
    """A radius that stays the same however near one looks."""
    return rr.Radius.ui_points(size)


def ellipse_axes(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """95 % ellipses of covariances (n, k, k): semi-axes (n, 2) in m, quaternions (n, 4) that turn x
    to the major one.

    Azimuths run clockwise from north, angles in a plane counterclockwise from east: angle = 90 deg
    - azimuth.
    """
    axes, turns = np.empty((len(p), 2)), np.zeros((len(p), 4))
    for i, (xx, xy, yy) in enumerate(
        zip(p[:, 0, 0].tolist(), p[:, 0, 1].tolist(), p[:, 1, 1].tolist(), strict=True)
    ):
        found = ellipse95(xx, xy, yy)
        axes[i] = found.semi_major_m, found.semi_minor_m
        half = 0.5 * np.radians(90.0 - found.azimuth_deg)
        turns[i, 2:] = np.sin(half), np.cos(half)
    return axes, turns


def thinned(count: int, most: int) -> slice:
    """Every so many of `count` things, that at most `most` remain."""
    return slice(None, None, max(1, -(-count // most)))


def closed(rings: Sequence[FloatArray]) -> list[npt.NDArray[np.float32]]:
    """Rings as strips."""
    return [ring.astype(np.float32) for ring in rings]
