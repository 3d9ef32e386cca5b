"""Where things stand in the viewer, and what it opens on."""

from math import hypot

import rerun as rr
import rerun.blueprint as rrb

from postproc.pictures.picture import Box
from postproc.view.ground import FOOT, KEY_WIDTH, PAPER
from postproc.view.rerun_writer import entity
from postproc.view.series import QUANTITIES, axis_range, filters
from postproc.view.view_model import Story, Subject
from postproc.view.world_map import zoom_of

SHARED_AXIS = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"
"""Where the viewer keeps the time range that linked plots share; it has no public name."""

_PAPER = rrb.Background(color=PAPER, kind=rrb.BackgroundKind.SolidColor)
_COMMON = ("/plan/ground/**", "/plan/walks/**", "/plan/walker/**")
_SPEED = 60.0
_NEAR_M, _NEAR_R95 = 60.0, 1.5


class _Blueprint(rrb.Blueprint):
    """Opens linked plots on the whole run; else they open on half a minute around the cursor."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        stream.log(SHARED_AXIS, _all_time())


def layout(story: Story, *, online: bool) -> rrb.Blueprint:
    """Plan and words to the left, plots over one time axis to the right; opens on the end of the
    run.

    `online` adds the map of the world, whose tiles come from the network once somebody looks at it.
    """
    left = rrb.Vertical(
        rrb.Tabs(*_plans(story, online=online)), rrb.Tabs(*_words(story)), row_shares=[1.75, 1.0]
    )
    subjects = [_plots(subject, named=len(story.subjects) > 1) for subject in story.subjects]
    right = (
        rrb.Tabs(*subjects)
        if len(subjects) > 1
        else subjects[0]
        if subjects
        else _plot("/rssi", "RSSI [dBm]")
    )
    return _Blueprint(
        rrb.Horizontal(left, right, column_shares=[1.15, 1.0]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline="utc" if story.clock.knows_utc and len(story.walks) == 1 else "elapsed",
            play_state="following",
            playback_speed=_SPEED,
            loop_mode="off",
        ),
        auto_views=False,
        auto_layout=False,
    )


def _plans(story: Story, *, online: bool) -> list[rrb.View]:
    if story.box is None:
        return [rrb.TextDocumentView(origin="/plan/missing", name="Plan")]
    several = len(story.subjects) > 1
    found = []
    for subject in story.subjects:
        contents = [*_COMMON, f"{entity('plan', 'cells', subject.cell)}/**"]
        named = f" {subject.cell}" if several else ""
        found.append(_plan(f"Plan{named}", contents, _whole(story.box)))
        near = _near(story, subject)
        if near is not None:
            found.append(_plan(f"Close-up{named}", contents, near))
    if not found:
        found.append(_plan("Plan", ["/plan/**"], _whole(story.box)))
    if len(story.cells) > 1:
        found.append(_plan("All cells", [*_COMMON, "/plan/all/**"], _whole(story.box)))
    if online:
        background = rrb.MapProvider.OpenStreetMap
        found.append(
            rrb.MapView(
                origin="/map", name="Map (online)", zoom=zoom_of(story), background=background
            )
        )
    return found


def _plan(name: str, contents: list[str], box: Box) -> rrb.View:
    # the plan is mirrored, so are its bounds
    bounds = rrb.VisualBounds2D(x_range=(box.west, box.east), y_range=(-box.north, -box.south))
    return rrb.Spatial2DView(
        origin="/", contents=contents, name=name, visual_bounds=bounds, background=_PAPER
    )


def _whole(box: Box) -> Box:
    margin = 0.03 * box.size
    room = KEY_WIDTH * box.size
    return Box(
        box.west - margin, box.south - FOOT * box.height, box.east + room, box.north + margin
    )


def _near(story: Story, subject: Subject) -> Box | None:
    """Around the best place, as far as a walker sees, or as far as the answer is unsure."""
    posterior = subject.result.posterior
    if posterior is None or story.box is None:
        return None
    reach = max(_NEAR_M, min(_NEAR_R95 * posterior.r95_m, story.box.size))
    east, north = posterior.x_m - story.origin_m[0], posterior.y_m - story.origin_m[1]
    if hypot(east, north) > 1e6:
        return None
    return Box(east, north, east, north).wider(reach)


def _words(story: Story) -> list[rrb.View]:
    several = len(story.subjects) > 1
    found: list[rrb.View] = [
        rrb.TextDocumentView(
            origin=entity("report", subject.cell),
            name=f"Report {subject.cell}" if several else "Report",
        )
        for subject in story.subjects
    ]
    found = found or [rrb.TextDocumentView(origin="/report", name="Report")]
    return [*found, rrb.TextLogView(origin="/events", name="Events")]


def _plots(subject: Subject, *, named: bool) -> rrb.Container:
    of = f"{entity('series', subject.cell)}"
    views: list[rrb.View | rrb.Container]
    views, shares = [_plot("/rssi", "RSSI [dBm]")], [1.7]
    if subject.steps:
        for quantity in QUANTITIES:
            views.append(
                _plot(
                    f"{of}/{quantity.path}",
                    f"{quantity.name} ± 2 sigma",
                    axis_range(subject, quantity),
                )
            )
            shares.append(1.0)
    if any(len(filtered) for _, _, _, filtered in filters(subject)):
        views.append(_plot(f"{of}/nis", "NIS with chi-square bounds", (0.0, 15.0)))
        shares.append(1.0)
    if subject.steps:
        area = _plot(f"{of}/area", "area of 95 % [lg m²]: 4 is a hectare, 6 a km²")
        reach_m = 4.0 * subject.steps[-1].posterior.r95_m
        views.append(rrb.Tabs(area, _plot(f"{of}/accuracy", "radius of 95 % [m]", (0.0, reach_m))))
        shares.append(1.1)
    lanes = [f"{entity('states', subject.cell)}/**", "/states/receiver"]
    views.append(
        rrb.StateTimelineView(
            origin="/", contents=lanes, name="Verdict, live stage, receiver", time_view=_all_time()
        )
    )
    shares.append(1.6)
    return rrb.Vertical(*views, row_shares=shares, name=subject.cell if named else None)


def _plot(path: str, name: str, y_range: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=path,
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_y=rrb.ScalarAxis(range=y_range) if y_range else None,
    )


def _all_time() -> rrb.TimeAxis:
    return rrb.TimeAxis(view_range=_everything())


def _everything() -> rr.TimeRange:
    return rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
