"""Over time: levels, path loss, accuracy of the estimators; states, and events of the run."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from logger.core.rows import Rows
from postproc.estimators.metrics import NIS_95, NIS_999
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import ETA, P0, Parameter, legend_of
from postproc.result import BATCH, EKF, REFERENCE, RTS
from postproc.view.plan import ellipse_axes
from postproc.view.surface import RerunWriter, dots, entity, line, step_line
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
    by_cell = [levels for walk in view.survey.walks for levels in walk.levels]
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
    walks = view.survey.walks
    times = [walk.t_ns for walk in walks]
    times += [levels.t_ns for walk in walks for levels in walk.levels]
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
        best_m = view.survey.local(cell.of_steps("x_m"), cell.of_steps("y_m"))
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
    stages = [_text(stage) for stage in rows["stage"]]
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
    texts = [f"{_text(row['source'])}: {_text(row['text']) or _text(row['code'])}" for row in notes]
    levels = [_LEVELS.get(level, "INFO") for level in notes["level"].tolist()]
    writer.send_columns("events", notes["t_ns"], rr.TextLog.columns(text=texts, level=levels))


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
