"""Where things stand in the viewer, and what it opens on."""

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from postproc.pictures.picture import Picture
from postproc.pictures.scene_plan import KEY_WIDTH
from postproc.pictures.scene_series import QUANTITIES, axis_range

SHARED_AXIS = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"
"""Where the viewer keeps the time range that linked plots share; it has no public name."""

_SPEED = 60.0


class _Blueprint(rrb.Blueprint):
    """Opens linked plots on the whole run; else they open on half a minute around the cursor."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        stream.log(SHARED_AXIS, rrb.TimeAxis(view_range=_everything()))


def layout(picture: Picture) -> rrb.Blueprint:
    """Plan and report to the left, plots over one time axis to the right; opens on the end of the run."""
    timeline = "utc" if picture.clock.timebase else "elapsed"
    words = rrb.Tabs(
        rrb.TextDocumentView(origin="/report", name="Report"), rrb.TextLogView(origin="/events", name="Events")
    )
    left = rrb.Vertical(_plan(picture), words, row_shares=[1.6, 1.0])
    plots = _plots(picture)
    right = rrb.Vertical(*plots, row_shares=[1.6] + [1.0] * (len(plots) - 1))
    return _Blueprint(
        rrb.Horizontal(left, right, column_shares=[1.1, 1.0]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed", timeline=timeline, play_state="following", playback_speed=_SPEED, loop_mode="off"
        ),
        auto_views=False,
        auto_layout=False,
    )


def _plan(picture: Picture) -> rrb.View:
    if picture.box is None:
        return rrb.TextDocumentView(origin="/plan/missing", name="Plan")
    box = picture.box
    margin = 0.03 * box.size
    # the plan is mirrored, so are its bounds
    bounds = rrb.VisualBounds2D(
        x_range=(box.west - margin, box.east + KEY_WIDTH * box.size),
        y_range=(-(box.north + margin), -(box.south - 0.12 * box.height - margin)),
    )
    return rrb.Spatial2DView(origin="/", contents="/plan/**", name="Plan", visual_bounds=bounds)


def _plots(picture: Picture) -> Sequence[rrb.View]:
    found = [_plot("rssi", "RSSI [dBm]")]
    if picture.focus is None or picture.focus.obs is None:
        return found
    if picture.focus.posterior is not None:
        found += [_plot(q.path, f"{q.name} ± 2 sigma", axis_range(picture, q)) for q in QUANTITIES]
    if picture.focus.ekf is not None or picture.focus.reference is not None:
        found += [_plot("nis", "NIS", (0.0, 15.0)), _plot("accuracy", "accuracy [m]")]
    return found


def _plot(path: str, name: str, y_range: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=f"/{path}",
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_y=rrb.ScalarAxis(range=y_range) if y_range else None,
    )


def _everything() -> rr.TimeRange:
    return rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
