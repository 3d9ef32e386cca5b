"""The layout of the viewer, and the time and range on which it opens."""

from math import hypot

import rerun as rr
import rerun.blueprint as rrb

from postproc.pictures.geometry import Box
from postproc.view.ground import FOOT_HEIGHT, KEY_WIDTH, PAPER
from postproc.view.layers import FARTHEST_M
from postproc.view.rerun_writer import entity
from postproc.view.series import AXES, axis_range, has_innovations
from postproc.view.view_model import CellView, ViewModel
from postproc.view.world_map import zoom_of

SHARED_AXIS = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"
"""Where the viewer stores the time range of linked plots; it has no public name (rerun 0.41)."""

_PAPER = rrb.Background(color=PAPER, kind=rrb.BackgroundKind.SolidColor)
_SHARED_ENTITIES = ("/plan/ground/**", "/plan/walks/**", "/plan/walker/**")
_PLAYBACK_SPEED = 60.0
"""An hour's walk plays in a minute."""
_CLOSE_UP_M, _CLOSE_UP_R95 = 60.0, 1.5
"""Half the width of the close-up: what a walker overlooks, or more where the radius is larger."""
_MARGIN = 0.03


class _Blueprint(rrb.Blueprint):
    """Opens linked plots on all of the run; by default they show half a minute at the cursor."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        stream.log(SHARED_AXIS, _all_time())


def layout(view: ViewModel, *, online: bool) -> rrb.Blueprint:
    """Plan and texts on the left, plots over one time axis on the right; opens at the run's end.

    `online` adds the map of the world, whose tiles come from the network once it is shown.
    """
    left = rrb.Vertical(
        rrb.Tabs(*_plans(view, online=online)), rrb.Tabs(*_texts(view)), row_shares=[1.75, 1.0]
    )
    plots: list[rrb.View | rrb.Container] = [
        _plots(cell, name=cell.name if len(view.cell_views) > 1 else None)
        for cell in view.cell_views
    ]
    plots = plots or [_plot("/rssi", "RSSI [dBm]")]
    has_date = view.survey.clock.has_utc and len(view.survey.walks) == 1
    return _Blueprint(
        rrb.Horizontal(
            left, rrb.Tabs(*plots) if len(plots) > 1 else plots[0], column_shares=[1.15, 1.0]
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline="utc" if has_date else "elapsed",
            play_state="following",
            playback_speed=_PLAYBACK_SPEED,
            loop_mode="off",
        ),
        auto_views=False,
        auto_layout=False,
    )


def _plans(view: ViewModel, *, online: bool) -> list[rrb.View]:
    if view.box is None:
        return [rrb.TextDocumentView(origin="/plan/missing", name="Plan")]
    complete = _with_keys(view.box)
    views: list[rrb.View] = []
    for cell in view.cell_views:
        contents = [*_SHARED_ENTITIES, f"{entity('plan', 'cells', cell.name)}/**"]
        suffix = f" {cell.name}" if len(view.cell_views) > 1 else ""
        views.append(_plan(f"Plan{suffix}", contents, complete))
        close_up = _close_up(view, cell)
        if close_up is not None:
            views.append(_plan(f"Close-up{suffix}", contents, close_up))
    if not views:
        views.append(_plan("Plan", ["/plan/**"], complete))
    if len(view.cells) > 1:
        views.append(_plan("All cells", [*_SHARED_ENTITIES, "/plan/all/**"], complete))
    if online:
        tiles = rrb.MapProvider.OpenStreetMap
        name = "Map (online)"
        views.append(rrb.MapView(origin="/map", name=name, zoom=zoom_of(view), background=tiles))
    return views


def _plan(name: str, contents: list[str], box: Box) -> rrb.View:
    # the plan is mirrored, so are its bounds
    bounds = rrb.VisualBounds2D(x_range=(box.west, box.east), y_range=(-box.north, -box.south))
    return rrb.Spatial2DView(
        origin="/", contents=contents, name=name, visual_bounds=bounds, background=_PAPER
    )


def _with_keys(box: Box) -> Box:
    """The plan with the key to the east and the scales to the south."""
    margin_m = _MARGIN * box.size
    south, east = box.south - FOOT_HEIGHT * box.height, box.east + KEY_WIDTH * box.size
    return Box(box.west - margin_m, south, east, box.north + margin_m)


def _close_up(view: ViewModel, cell: CellView) -> Box | None:
    """A square around the best position."""
    posterior = cell.result.posterior
    if posterior is None or view.box is None:
        return None
    margin_m = max(_CLOSE_UP_M, min(_CLOSE_UP_R95 * posterior.r95_m, view.box.size))
    origin_x, origin_y = view.survey.origin_m
    east_m, north_m = posterior.x_m - origin_x, posterior.y_m - origin_y
    if hypot(east_m, north_m) > FARTHEST_M:
        return None
    return Box(east_m, north_m, east_m, north_m).enlarge(margin_m)


def _texts(view: ViewModel) -> list[rrb.View]:
    several = len(view.cell_views) > 1
    reports: list[rrb.View] = [
        rrb.TextDocumentView(
            origin=entity("report", cell.name),
            name=f"Report {cell.name}" if several else "Report",
        )
        for cell in view.cell_views
    ]
    reports = reports or [rrb.TextDocumentView(origin="/report", name="Report")]
    return [*reports, rrb.TextLogView(origin="/events", name="Events")]


def _plots(cell: CellView, *, name: str | None) -> rrb.Container:
    """Plots of a cell, each with its share of the height."""
    path = entity("series", cell.name)
    rows: list[tuple[float, rrb.View | rrb.Container]] = [(1.7, _plot("/rssi", "RSSI [dBm]"))]
    if cell.steps:
        rows += [
            (1.0, _plot(f"{path}/{key}", f"{parameter.name} ± 2 sigma", axis_range(cell, key)))
            for key, (parameter, _) in AXES.items()
        ]
    if has_innovations(cell):
        rows.append((1.0, _plot(f"{path}/nis", "NIS with chi-square bounds", (0.0, 15.0))))
    if cell.steps:
        area = _plot(f"{path}/area", "95 % area [lg m²]: 4 is a hectare, 6 a km²")
        most_m = 4.0 * cell.steps[-1].posterior.r95_m
        radius = _plot(f"{path}/accuracy", "radii of 50 % and 95 % [m]", (0.0, most_m))
        rows.append((1.1, rrb.Tabs(area, radius)))
    lanes = [f"{entity('states', cell.name)}/**", "/states/receiver"]
    states = rrb.StateTimelineView(
        origin="/", contents=lanes, name="Verdict, live stage, receiver", time_view=_all_time()
    )
    rows.append((1.6, states))
    shares, views = zip(*rows, strict=True)
    return rrb.Vertical(*views, row_shares=list(shares), name=name)


def _plot(path: str, name: str, y_range: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=path,
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_y=rrb.ScalarAxis(range=y_range) if y_range else None,
    )


def _all_time() -> rrb.TimeAxis:
    infinite = rr.TimeRangeBoundary.infinite
    return rrb.TimeAxis(view_range=rr.TimeRange(start=infinite(), end=infinite()))
