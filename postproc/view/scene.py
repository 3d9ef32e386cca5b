"""A view model as a recording for the rerun viewer: its layout, its texts and all that it draws."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from logger.core.document import Column, Degrees, Table, Word, markdown_table, markdown_text
from logger.core.locator.alternatives import alternatives_text
from postproc.atomic_write import whole_file
from postproc.basemap.reading import Basemap
from postproc.cell_work import Attempts, Failure, attempt, attempt_alone
from postproc.pictures.picture import headline
from postproc.pictures.survey import Box
from postproc.result import CellResult
from postproc.summary import REFERENCE_NOTE, estimator_table
from postproc.verification.verdicts import CellVerdict
from postproc.view.plan import (
    FOOT_HEIGHT,
    KEY_WIDTH,
    PAPER,
    draw_basemap,
    draw_map,
    draw_plan,
    zoom_of,
)
from postproc.view.series import AXES, axis_range, draw_series, draw_states, has_innovations
from postproc.view.surface import FARTHEST_M, RerunWriter, entity
from postproc.view.view_model import CellView, ViewModel

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
    """With the key to the east and the scales to the south."""
    margin_m = _MARGIN * box.size
    south, east = box.south - FOOT_HEIGHT * box.height, box.east + KEY_WIDTH * box.size
    return Box(box.west - margin_m, south, east, box.north + margin_m)


def _close_up(view: ViewModel, cell: CellView) -> Box | None:
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


_COLOURS = (
    "Blue: posterior (thin outline 95 % region, thick outline 50 % region, glow density). "
    "Orange: EKF. Teal: RTS. Brown: least squares. Grey: reference EKF. Violet: truth of a "
    "simulation. The track is coloured by level, from violet (weak) to yellow (strong). "
    "Move the time cursor below to see the answer develop."
)


def empty_report(view: ViewModel) -> str:
    """Report of a run in which no cell was observed."""
    return _join("# No cell", _runs(view), _list(view.survey.warnings))


def cell_report(view: ViewModel, cell: CellView) -> str:
    """Verdict, warnings, all estimators, and claims."""
    result, runs = cell.result, [walk.run for walk in view.survey.walks]
    verdict = headline(result)
    warnings = [text for text in result.warnings if text not in verdict]
    return _join(
        f"# Cell {markdown_text(cell.name)}",
        f"**{verdict}**",
        f"{_runs(view)}; {result.n} readings of this cell",
        _list([*warnings, *_run_texts(view, result)]),
        markdown_table(estimator_table(result.answer(runs))),
        markdown_text(REFERENCE_NOTE if result.reference else ""),
        _error(view, cell),
        _claims(cell.claims),
        _list(view.survey.warnings),
        _prior(result),
        _COLOURS,
    )


def _join(*paragraphs: str) -> str:
    return "\n\n".join(filter(None, paragraphs))


def _runs(view: ViewModel) -> str:
    survey = view.survey
    runs = [
        f"{'SIMULATED run' if walk.run.meta.truth else 'Run'} `{walk.run.name}`, "
        f"{survey.clock.start_text(i) or 'unknown date'}"
        for i, walk in enumerate(survey.walks)
    ]
    cells = {levels.cell for walk in survey.walks for levels in walk.levels}
    return "; ".join([*runs, f"{len(cells)} cells observed"])


def _list(lines: Sequence[str]) -> str:
    return "\n".join(f"- {markdown_text(text)}" for text in lines)


def _run_texts(view: ViewModel, result: CellResult) -> list[str]:
    texts = []
    for share in result.shares if len(result.shares) > 1 else ():
        text = f"{view.survey.walks[share.run].run.name} contributed {share.n} readings"
        if share.offset_db and share.sigma_db:
            text += f" (modem offset {share.offset_db:+.1f} ± {share.sigma_db:.1f} dB)"
        without = result.without.get(share.run)
        texts.append(f"{text}; without it: {headline(without)}" if without else text)
    return texts


def _error(view: ViewModel, cell: CellView) -> str:
    posterior, truth_m = cell.result.posterior, cell.picture.truth_m
    if truth_m is None or posterior is None:
        return ""
    best_m = np.array([posterior.x_m, posterior.y_m]) - view.survey.origin_m
    error_m = float(np.hypot(*(best_m - truth_m)))
    return f"Simulated: the best position is {error_m:.0f} m from the truth."


def _claims(claims: Sequence[CellVerdict]) -> str:
    columns = (Column("claimed position"), Column("source"), Column("verdict"), Column("reason"))
    rows = [
        (
            Degrees(tested.claim.lat_deg, tested.claim.lon_deg),
            tested.claim.source,
            Word(tested.verdict),
            tested.reasons[0] if tested.reasons else "",
        )
        for tested in claims
    ]
    return markdown_table(Table(columns, rows))


def _prior(result: CellResult) -> str:
    if result.posterior is None:
        return ""
    prior = result.posterior.prior
    return (
        f"Prior: P0 {prior.p0_dbm:.0f} ± {prior.p0_sigma_db:.0f} dBm, "
        f"eta {prior.eta:.1f} ± {prior.eta_sigma:.1f}, "
        f"level standard deviation about {prior.sigma_db:.0f} dB, "
        f"at most {prior.reach_m / 1000:.0f} km away; "
        f"{alternatives_text(result.posterior.alternatives)}."
    )


APPLICATION = "cellwalk"

_WHAT = "its drawing"


def write_scene(
    view: ViewModel, path: Path, *, basemap: Basemap | None = None, online: bool = True
) -> tuple[Failure, ...]:
    """Write the recording (.rrd), complete or not at all; raises `RunFileError`.

    `online` is as in `layout`. Returns the cells of which something cannot be shown.
    """

    def write(some: ViewModel) -> None:
        with whole_file(path) as part:
            _write(some, part, basemap, online=online)

    if isinstance(attempt(view.name, _WHAT, lambda: write(view)), Failure):
        view = view.without(_undrawable(view, path, online=online))
        attempt_alone(view.name, _WHAT, lambda: write(view))
    return view.failures


def _undrawable(view: ViewModel, path: Path, *, online: bool) -> list[Failure]:
    tries = Attempts(_WHAT)

    def draw(cell: CellView | CellResult) -> None:
        if isinstance(cell, CellView):
            alone = replace(view, cells=(), cell_views=(cell,))
        else:
            alone = replace(view, cells=(cell,), cell_views=())
        with TemporaryDirectory(dir=path.absolute().parent) as scratch:
            _write(alone, Path(scratch) / "alone.rrd", None, online=online)

    tries.each(view.cell_views, lambda cell: cell.name, draw)
    tries.each(view.cells, lambda cell: cell.cell, draw)
    return list(tries.failures.values())


def _write(view: ViewModel, path: Path, basemap: Basemap | None, *, online: bool) -> None:
    rr.set_strict_mode(True)
    ids = " ".join(walk.run.meta.run_id for walk in view.survey.walks)
    recording = rr.RecordingStream(APPLICATION, recording_id=f"{ids} {view.name}")
    recording.set_log_time_enabled(False)
    recording.save(path)
    # active as well: the layout that the viewer remembers from another run overrides a default
    recording.send_blueprint(layout(view, online=online), make_active=True, make_default=True)
    recording.send_recording_name(view.name)
    writer = RerunWriter(recording, view.survey.clock)
    _draw_texts(writer, view)
    draw_plan(writer, view)
    if basemap is not None:
        draw_basemap(writer, basemap)
    if online:
        draw_map(writer, view)
    draw_series(writer, view)
    draw_states(writer, view)
    recording.flush()
    recording.disconnect()


def _draw_texts(writer: RerunWriter, view: ViewModel) -> None:
    reports = {entity("report", cell.name): cell_report(view, cell) for cell in view.cell_views}
    for path, text in (reports or {"report": empty_report(view)}).items():
        writer.log_static(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    if view.box is None:
        writer.log_static("plan/missing", rr.TextDocument("no position fix"))
