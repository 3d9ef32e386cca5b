"""A view model as a recording for the rerun viewer: its layout, its texts and all that it draws."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import hypot
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from logger.core.arrays import FloatArray, IntArray
from logger.core.document import (
    Column,
    Degrees,
    Table,
    Word,
    markdown_table,
    markdown_text,
    number_of,
)
from logger.core.locator.alternatives import alternatives_text
from logger.core.places import Places
from logger.core.rows import Rows
from postproc.atomic_write import whole_file
from postproc.basemap import Basemap
from postproc.cell_work import Attempts, Failure, attempt, attempt_alone
from postproc.estimators.metrics import NIS_95, NIS_999
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import ETA, P0, Parameter, headline, legend_of
from postproc.pictures.survey import Box
from postproc.result import BATCH, EKF, REFERENCE, RTS, CellResult, share_names
from postproc.summary import REFERENCE_NOTE, estimator_table
from postproc.verification.claims import CellVerdict
from postproc.view.plan import (
    FARTHEST_M,
    FOOT_HEIGHT,
    KEY_WIDTH,
    PAPER,
    RerunWriter,
    dots,
    draw_basemap,
    draw_map,
    draw_plan,
    ellipse_axes,
    entity,
    line,
    step_line,
    zoom_of,
)
from postproc.view.view_model import CellView, ViewModel

MOST_DOTS = 40_000
"""The viewer thins lines but not points: above this the other cells are drawn as lines."""
_FAINT = 80
"""Opacity of those lines: the viewer draws in the order of names, so they may cover the others."""
NIS_BOUNDS = ((0.95, NIS_95), (0.999, NIS_999))

AXES = {"p0": (P0, 60.0), "eta": (ETA, 4.0)}
"""Path loss parameters by entity, and how far from the posterior's mean their axis may reach."""


def draw_series(writer: RerunWriter, view: ViewModel) -> None:
    """Every plot over time; without readings there is none."""
    draw_levels(writer, view)
    span_ns = _time_span_ns(view)
    if span_ns is None:
        return
    for cell in view.cell_views:
        for key, (parameter, _) in AXES.items():
            _draw_path_loss(writer, cell, key, parameter, span_ns)
        _draw_consistency(writer, cell, span_ns)
        _draw_area(writer, cell)
        _draw_accuracy(writer, view, cell)


def has_innovations(cell: CellView) -> bool:
    """Whether a filter has run, so that there is a NIS to plot."""
    return any(len(filtered) for _, filtered in cell.filters)


def axis_range(cell: CellView, key: str) -> tuple[float, float] | None:
    """Range of the axis of `AXES[key]` that shows the bands near the answer; None without one."""
    posterior = cell.result.posterior
    if posterior is None:
        return None
    parameter, reach = AXES[key]
    mean, _ = parameter.of_posterior(posterior)
    values = np.concatenate(list(_shown_values(cell, parameter)))
    near = values[np.isfinite(values) & (np.abs(values - mean) <= reach)]
    low, high = (float(near.min()), float(near.max())) if len(near) else (mean - 1.0, mean + 1.0)
    margin = 0.05 * max(high - low, 0.1)
    return low - margin, high + margin


def draw_levels(writer: RerunWriter, view: ViewModel) -> None:
    """Levels of all cells: the detailed ones as lines on top, the others as dots below them."""
    detailed = {cell.name for cell in view.cell_views}
    by_cell = view.survey.levels
    n_others = sum(len(levels.t_ns) for levels in by_cell if levels.cell not in detailed)
    for levels in sorted(by_cell, key=lambda levels: levels.cell in detailed):
        name, ink = levels.cell, view.cell_colours[levels.cell]
        style: Any = line(name, (*ink, _FAINT), 1.0)
        if name in detailed:
            style = line(name, ink, 2.0)
        elif n_others <= MOST_DOTS:
            style = dots(name, ink)
        writer.plot(entity("rssi", name), levels.t_ns, levels.level_dbm, style)


def _time_span_ns(view: ViewModel) -> IntArray | None:
    """First and last time since boot of anything plotted."""
    times = [walk.t_ns for walk in view.survey.walks]
    times += [levels.t_ns for levels in view.survey.levels]
    ends = np.concatenate([t_ns[[0, -1]] for t_ns in times if len(t_ns)] or [np.zeros(0, np.int64)])
    return np.array([ends.min(), ends.max()]) if len(ends) else None


def _shown_values(cell: CellView, parameter: Parameter) -> Iterator[FloatArray]:
    """Limits of the bands and final values of a parameter.

    Of the posterior's band only the later half counts: at the beginning it is the prior.
    """
    half = len(cell.steps) // 2
    mean, sigma = (cell.of_steps(name)[half:] for name in (parameter.mean, parameter.sigma))
    yield from (mean - 2.0 * sigma, mean + 2.0 * sigma)
    ekf = cell.result.ekf
    if ekf is not None:
        value, sigma = parameter.of_states(ekf.x, ekf.p)
        yield from (value - 2.0 * sigma, value + 2.0 * sigma)
    for estimate in cell.picture.estimates:
        if estimate.estimator != REFERENCE:
            yield estimate.x[[parameter.row]]


def _draw_path_loss(
    writer: RerunWriter, cell: CellView, key: str, parameter: Parameter, span_ns: IntArray
) -> None:
    path = entity("series", cell.name, key)
    if cell.steps:
        mean, sigma = cell.of_steps(parameter.mean), cell.of_steps(parameter.sigma)
        writer.plot_band(
            f"{path}/posterior", cell.t_ns, mean, sigma, name="posterior", ink=colours.POSTERIOR
        )
    for estimate in cell.picture.estimates:
        if estimate.estimator in (BATCH, RTS):
            value = np.full(2, estimate.x[parameter.row])
            style = line(*legend_of(estimate.estimator))
            writer.plot(f"{path}/{estimate.estimator.key}", span_ns, value, style)
    for estimator, filtered in cell.filters:
        filter_path, (name, ink) = f"{path}/{estimator.key}", legend_of(estimator)
        value, sigma = parameter.of_states(filtered.x, filtered.p)
        finite = np.isfinite(value) & np.isfinite(sigma)
        t_ns, value, sigma = filtered.t_ns[finite], value[finite], sigma[finite]
        if estimator == EKF:
            writer.plot_band(filter_path, t_ns, value, sigma, name=name, ink=ink)
        else:
            writer.plot(filter_path, t_ns, value, line(name, ink, 1.0))


def _draw_consistency(writer: RerunWriter, cell: CellView, span_ns: IntArray) -> None:
    """NIS: chi-square with one degree of freedom for a consistent filter."""
    path = entity("series", cell.name, "nis")
    for estimator, filtered in cell.filters:
        with np.errstate(divide="ignore", invalid="ignore"):
            nis = filtered.nis
        points = dots(*legend_of(estimator), 2.0)
        _plot_finite(writer, f"{path}/{estimator.key}", filtered.t_ns, nis, points)
    if has_innovations(cell):
        for (share, bound), ink in zip(NIS_BOUNDS, colours.BOUNDS, strict=True):
            style = line(f"{share * 100:g} %", ink)
            writer.plot(f"{path}/bound{share:g}", span_ns, np.full(2, bound), style)


def _draw_area(writer: RerunWriter, cell: CellView) -> None:
    """Decimal logarithms, since rerun has no logarithmic axis."""
    path = entity("series", cell.name, "area")
    if cell.steps:
        style = step_line("posterior region", colours.POSTERIOR)
        area_m2 = cell.of_steps("region_area_m2")
        writer.plot(f"{path}/posterior", cell.t_ns, np.log10(area_m2), style)
    for estimator, filtered in cell.filters:
        axes_m, _ = ellipse_axes(filtered.p)
        with np.errstate(divide="ignore", invalid="ignore"):
            lg_area = np.log10(np.pi * axes_m[:, 0] * axes_m[:, 1])
        style = line(*legend_of(estimator))
        _plot_finite(writer, f"{path}/{estimator.key}", filtered.t_ns, lg_area, style)


def _draw_accuracy(writer: RerunWriter, view: ViewModel, cell: CellView) -> None:
    if not cell.steps:
        return
    path = entity("series", cell.name, "accuracy")
    style = step_line("posterior", colours.POSTERIOR)
    writer.plot(f"{path}/r95", cell.t_ns, cell.of_steps("r95_m"), style)
    half = step_line("posterior, 50 %", colours.POSTERIOR)
    writer.plot(f"{path}/r50", cell.t_ns, cell.of_steps("r50_m"), half)
    if cell.picture.truth_m is not None:
        best_m = view.survey.local(Places.of(cell.of_steps("x_m"), cell.of_steps("y_m")))
        error_m = np.hypot(*(best_m - cell.picture.truth_m).T)
        writer.plot(f"{path}/error", cell.t_ns, error_m, step_line("error", colours.TRUTH))


def _plot_finite(
    writer: RerunWriter, path: str, t_ns: IntArray, values: FloatArray, style: object
) -> None:
    finite = np.isfinite(values)
    writer.plot(path, t_ns[finite], values[finite], style)


_LEVELS = {b"info": "INFO", b"warning": "WARN", b"error": "ERROR"}
_STATES: dict[str, Colour] = {
    **{name: colours.verdict_colour(name) for name in ("located", "ambiguous", "cannot tell")},
    "locator": colours.POSTERIOR,
    "ekf": colours.EKF,
    "fix": colours.GREEN,
    "no fix": colours.RED,
}


def draw_states(writer: RerunWriter, view: ViewModel) -> None:
    """Lanes of states for each detailed cell, one for the receiver, and the notes of all runs."""
    for walk in view.survey.walks:
        fixes = walk.run.tables["fixes"]
        states = ["fix" if valid else "no fix" for valid in fixes["valid"]]
        _draw_lane(writer, "states/receiver", fixes["t_ns"], states)
        _draw_events(writer, walk.run.tables["notes"])
    for cell in view.cell_views:
        path = entity("states", cell.name, "verdict")
        _draw_lane(writer, path, cell.t_ns, [step.verdict for step in cell.steps])
        for walk in view.survey.walks:
            _draw_stages(writer, cell, walk.run.tables["live"])


def _draw_stages(writer: RerunWriter, cell: CellView, live: Rows) -> None:
    """The estimator whose answer the device used."""
    is_cell = live["cell"] == cell.name.encode()
    rows = live[is_cell & np.isin(live["stage"], (b"locator", b"ekf"))]
    stages = [stage.decode() for stage in rows["stage"]]
    _draw_lane(writer, entity("states", cell.name, "live_stage"), rows["t_ns"], stages)


def _draw_lane(writer: RerunWriter, path: str, t_ns: IntArray, states: Sequence[str]) -> None:
    order = np.argsort(t_ns, kind="stable")
    in_order = np.array(states, object)[order]
    changes = np.flatnonzero(np.append(True, in_order[1:] != in_order[:-1])[: len(in_order)])
    if not len(changes):
        return
    names = list(_STATES)
    inks = list(_STATES.values())
    writer.log_static(path, rr.StateConfiguration(values=names, labels=names, colors=inks))
    columns = rr.StateChange.columns(state=in_order[changes].tolist())
    writer.send_columns(path, t_ns[order][changes], columns)


def _draw_events(writer: RerunWriter, notes: Rows) -> None:
    notes = notes[np.argsort(notes["t_ns"], kind="stable")]
    if not len(notes):
        return
    texts = [
        f"{row['source'].decode()}: {row['text'].decode() or row['code'].decode()}" for row in notes
    ]
    levels = [_LEVELS.get(level, "INFO") for level in notes["level"].tolist()]
    writer.send_columns("events", notes["t_ns"], rr.TextLog.columns(text=texts, level=levels))


# --- the recording ---

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
    unnoticed = markdown_text(view.unnoticed)
    return _join("# No cell", _runs(view), _list(view.survey.warnings), unnoticed)


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
        markdown_text(view.unnoticed),
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
    cells = {levels.cell for levels in survey.levels}
    return "; ".join([*runs, f"{number_of(len(cells), 'cell')} observed"])


def _list(lines: Sequence[str]) -> str:
    return "\n".join(f"- {markdown_text(text)}" for text in lines)


def _run_texts(view: ViewModel, result: CellResult) -> list[str]:
    texts = []
    shares = result.shares if len(result.shares) > 1 else ()
    names = share_names(shares, [walk.run.name for walk in view.survey.walks])
    for share, name in zip(shares, names, strict=True):
        text = f"{name} contributed {number_of(share.n, 'reading')}"
        if share.offset_db and share.sigma_db:
            text += f" (modem offset {share.offset_db:+.1f} ± {share.sigma_db:.1f} dB)"
        without = result.without.get(share.run)
        texts.append(f"{text}; without it: {headline(without)}" if without else text)
    return texts


def _error(view: ViewModel, cell: CellView) -> str:
    posterior, truth_m = cell.result.posterior, cell.picture.truth_m
    if truth_m is None or posterior is None:
        return ""
    error_m = float(np.hypot(*(view.survey.local(posterior.place)[0] - truth_m)))
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
        f"eta {prior.eta:.1f} ± {prior.eta_sigma:.1f}, at least {prior.least_eta:.0f}, "
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
    ids = " ".join(walk.run.meta.run_id for walk in view.survey.walks)
    blueprint = layout(view, online=online)
    with recording_of(path, f"{ids} {view.name}", view.name, blueprint) as recording:
        writer = RerunWriter(recording, view.survey.clock)
        _draw_texts(writer, view)
        draw_plan(writer, view)
        if basemap is not None:
            draw_basemap(writer, basemap)
        if online:
            draw_map(writer, view)
        draw_series(writer, view)
        draw_states(writer, view)


@contextmanager
def recording_of(
    path: Path, identity: str, name: str, blueprint: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """A recording to fill, written to `path` (.rrd) at the end."""
    rr.set_strict_mode(True)
    recording = rr.RecordingStream(APPLICATION, recording_id=identity)
    recording.set_log_time_enabled(False)
    content = recording.memory_recording()  # on a full disk rerun's file never ends
    # active as well: the layout that the viewer remembers from another run overrides a default
    recording.send_blueprint(blueprint, make_active=True, make_default=True)
    recording.send_recording_name(name)
    yield recording
    path.write_bytes(content.drain_as_bytes())
    recording.disconnect()


def _draw_texts(writer: RerunWriter, view: ViewModel) -> None:
    reports = {entity("report", cell.name): cell_report(view, cell) for cell in view.cell_views}
    for path, text in (reports or {"report": empty_report(view)}).items():
        writer.log_static(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    if view.box is None:
        writer.log_static("plan/missing", rr.TextDocument("no position fix"))
