"""What `postproc smooth` says of a `Result`: its JSON form, and lines and tables."""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET

from logger.core import ekf
from logger.core.answer import Mode, Parameters, Place, Position, parameters_of
from logger.core.arrays import FloatArray
from logger.core.document import Column, Degrees, Document, Line, Measured, Table, Value, Word
from logger.core.ellipse import RADII, Ellipse, ellipse95
from logger.core.locator.alternatives import alternatives_text
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import HALF, LEVEL, area_m2
from logger.core.locator.rivals import share_text
from logger.core.places import Places, Utm
from logger.core.runfile import Run
from postproc import result_json as form
from postproc.cell_work import Failure, attempt
from postproc.estimators.direction_check import AXES, Comparison
from postproc.estimators.filters import FilterPath
from postproc.estimators.least_squares import BatchFit
from postproc.estimators.region_outline import geojson
from postproc.estimators.residuals import Residuals
from postproc.info import RunFacts, describe
from postproc.result import ESTIMATORS, REFERENCE, CellResult, ObservedRun, Result
from postproc.truth import truth_of

_PLACE = ("lat", "lon", "r95_m", "r50_m", "drms_m", "strongest")
_PARAMETERS = ("p0_dbm", "p0_sigma_db", "eta", "eta_sigma")
_NOISE = ("sigma_db", "decorrelation_m", "white_share")
_STATISTICS = (
    "sigma_db",
    "skewness",
    "excess_kurtosis",
    "beyond_3_sigma",
    "lag1",
    "decorrelation_m",
    "independent",
)

_ORDER = ("located", "ambiguous", "cannot tell")
REFERENCE_NOTE = (
    "* the filter of the specification, for comparison: neither its position nor its ellipse "
    "can be trusted"
)
_CELL_COLUMNS = (
    Column("cell"),
    Column("readings", "d"),
    Column("verdict"),
    Column("position"),
    Column("likely", is_right=True),  # short for `RADII`, so that a line fits into 80 columns
    Column("surely", is_right=True),
)
_ERROR_COLUMN = Column("error", is_right=True)
_ESTIMATOR_COLUMNS = (
    Column("estimator"),
    Column("position"),
    Column("50 %; 95 % (m)"),
    Column("P0", ".1f", "dBm"),
    Column("eta", ".2f"),
    Column("n", "d"),
)
_RUN_COLUMNS = (
    Column("run"),
    Column("n", "d"),
    Column("reads", "+.1f", "dB"),
    Column("without it"),
    Column("50 %; 95 % (m)"),
    Column("verdict"),
)
Parts = list[str | Line | Table]


def document_of(summary: form.Summary, *, details: bool) -> tuple[Document, list[Failure]]:
    """One line for each cell, the located first; with `details` its reasons and estimators.

    Beside it stand the cells of which a part could not be said.
    """
    one_run = isinstance(summary, form.SummaryOfRun)
    runs = [summary.run] if isinstance(summary, form.SummaryOfRun) else summary.runs
    cells = sorted(summary.cells, key=lambda cell: _ORDER.index(cell.verdict))
    parts: Parts = []
    if any(run.simulated for run in runs):
        parts.append("This is a simulated run: the error to the known truth is shown.")
    parts += [
        Line(warning if one_run else f"{run.path}: {warning}", "red")
        for run in runs
        for warning in run.warnings
    ]
    if isinstance(summary, form.SummaryOfRuns):
        parts += [Line(warning, "yellow") for warning in summary.warnings]
    failures: list[Failure] = []
    if details:
        for cell in cells:
            said = attempt(cell.cell, "its details", partial(_cell_parts, cell))
            if isinstance(said, Failure):
                failures.append(said)
            else:
                parts += said
        parts += map(_failure_line, failures)
        if any(cell.reference_ekf.lat is not None for cell in cells):
            parts += ["", REFERENCE_NOTE]
    elif cells:
        table, failures = _cell_table(cells)
        parts.append(table)
        parts += [
            _failure_line(Failure(cell.cell, reason, None))
            for cell in cells
            for reason in (cell.warnings if cell.error else ())
        ]
        parts += map(_failure_line, failures)
        likely = f"likely: {RADII[0]} (50 %); surely: {RADII[1]} (95 %)"
        more = "The reasons and all details of one cell: --cell NAME; of every cell: -v"
        parts.append(Line(f"\n{likely}\n{more}", "dim"))
    return Document(summary, body=parts), failures


def _failure_line(failure: Failure) -> Line:
    return Line((f"{failure.cell}: ", Word(failure.reason, "red")))


def _cell_table(cells: Sequence[form.Cell]) -> tuple[Table, list[Failure]]:
    lines = [attempt(cell.cell, "its line", partial(_cell_row, cell)) for cell in cells]
    failures = [line for line in lines if isinstance(line, Failure)]
    rows = [
        (cell.cell, cell.n, Word(cell.verdict)) if isinstance(line, Failure) else line
        for cell, line in zip(cells, lines, strict=True)
    ]
    has_error = any(cell.truth for cell in cells)
    return Table([*_CELL_COLUMNS, *[_ERROR_COLUMN][:has_error]], rows), failures


def _cell_row(cell: form.Cell) -> tuple[Value, ...]:
    row: tuple[Value, ...] = (cell.cell, cell.n, Word(cell.verdict))
    if cell.verdict == "located":
        error = _metres(cell.truth.error_m) if cell.truth else ""
        radii = _metres(cell.best.r50_m), _metres(cell.best.r95_m)
        return (*row, _position(cell.best), *radii, error)
    if cell.verdict == "ambiguous":
        n = sum(mode.percent is not None for mode in cell.modes)
        return (*row, f"{n} positions")
    return row


def _cell_parts(cell: form.Cell) -> Parts:
    scans = ""
    if cell.n_scans is not None:
        scans = f", observed in {cell.n_scans} scan{'s' * (cell.n_scans != 1)}"
    counts = f"  {cell.n} readings{scans}  "
    parts: Parts = ["", Line((Word(cell.cell, "bold"), counts, Word(cell.verdict)))]
    parts += [Line(warning, bullet="  - ") for warning in cell.warnings]
    parts.append(estimator_table(cell))
    if cell.alternatives:
        parts.append(Line(alternatives_text(cell.alternatives), bullet="  "))
    if cell.timing is not UNSET:
        points = f"read at {cell.timing.places} points, {cell.timing.disagree} disagree"
        parts.append(Line(f"timing advance: {points}", bullet="  "))
    if cell.without:
        parts.append(run_table(cell))
    if cell.truth is not None and cell.truth.error_m is not None:
        side = "inside" if cell.truth.inside_region95 else "OUTSIDE"
        error = f"best position is {cell.truth.error_m:.0f} m off"
        parts.append(Line(f"truth: {error}, truth is {side} the 95 % region", bullet="  "))
    return parts


def estimator_table(cell: form.Cell) -> Table:
    """The posterior, its modes where there are several, and every estimator."""
    return Table(
        _ESTIMATOR_COLUMNS, list(_estimator_rows(cell)), f"All estimators of cell {cell.cell}"
    )


def _estimator_rows(cell: form.Cell) -> Iterator[tuple[Value, ...]]:
    best = cell.best
    if best.lat is not None:
        yield ("posterior", _position(best), _radii(best), *_parameters(best), cell.n)
    for i, mode in enumerate(cell.modes if len(cell.modes) > 1 else (), 1):
        share = share_text(mode.probability) if mode.percent is None else f"{mode.percent}%"
        yield f"  position {i}: {share}", _position(mode), _axes(mode.ellipse95)
    for estimator in ESTIMATORS:
        title = f"{estimator.name}*" if estimator == REFERENCE else estimator.name
        state: form.FinalState | form.LeastSquares = getattr(cell, estimator.json_key)
        if state.converged is False:
            yield title, "did not converge"
        elif state.lat is not None:
            extent = (_axes(state.ellipse95), *_parameters(state))
            if isinstance(state, form.LeastSquares) and state.bounded is False:
                # a fit that the readings do not bound has no uncertainty
                extent = ("no bounds", state.p0_dbm, state.eta)
            yield (title, _position(state), *extent, state.n)


def _parameters(state: form.Best | form.State) -> tuple[Value, Value]:
    return Measured(state.p0_dbm, state.p0_sigma_db), Measured(state.eta, state.eta_sigma)


def run_table(cell: form.Cell) -> Table:
    """What each run contributes: its level against the first, and the answer without it."""
    rows: list[tuple[Value, ...]] = []
    for share, rest in zip(cell.offsets or (), cell.without or (), strict=True):
        is_first = share.offset_db is not None and not share.sigma_db
        level: Value = "0" if is_first else Measured(share.offset_db, share.sigma_db)
        position = (_position(rest.best), _radii(rest.best)) if rest.best else (None, None)
        rows.append((Path(share.run).name, share.n, level, *position, Word(rest.verdict)))
    return Table(_RUN_COLUMNS, rows, f"Run by run: cell {cell.cell}")


def _position(at: form.Best | Position | Mode | form.State) -> Degrees | None:
    return None if at.lat is None or at.lon is None else Degrees(at.lat, at.lon)


def _metres(m: float | None) -> str:
    return "" if m is None else f"{m:.0f} m"


def _radii(best: form.Best | Position) -> str:
    return f"r {best.r50_m:.0f}; {best.r95_m:.0f}"


def _axes(ellipse: Ellipse | None) -> str:
    return f"{ellipse.semi_major_m:.0f} x {ellipse.semi_minor_m:.0f}" if ellipse else ""


def summarise(result: Result) -> form.Summary:
    """What `postproc smooth --json` prints of one run or of several."""
    runs = [observed.run for observed in result.runs]
    cells = [_cell_or_why_not(cell, runs) for cell in result.cells]
    if len(runs) == 1:
        (observed,) = result.runs
        return form.SummaryOfRun(run=_run(observed, result.warnings), cells=cells)
    summaries = [_run(observed) for observed in result.runs]
    return form.SummaryOfRuns(runs=summaries, warnings=list(result.warnings), cells=cells)


def _run(observed: ObservedRun, more: Sequence[str] = ()) -> form.RunSummary:
    info = describe(observed.run)
    facts = {field.name: getattr(info, field.name) for field in fields(RunFacts)}
    observations = observed.observations
    return form.RunSummary(
        **facts,
        n_readings_without_position=(
            observations.n_without_position if observations else info.n_readings
        ),
        warnings=[*observed.warnings, *more],
    )


def _cell_or_why_not(result: CellResult, runs: Sequence[Run]) -> form.Cell:
    entry = attempt(result.cell, "its summary", lambda: _with_outlines(result, runs))
    return _without_answer(result.after(entry)) if isinstance(entry, Failure) else entry


def _without_answer(result: CellResult) -> form.Cell:
    none = form.FinalState()
    return form.Cell(
        cell=result.cell,
        n=result.n,
        n_scans=result.n_scans,
        verdict=result.verdict,
        best=form.Best(),
        modes=[],
        region95=form.Region(),
        region50=form.Region(),
        prior=None,
        alternatives=[],
        reference_ekf=none,
        ekf=none,
        ekf_backward=none,
        agreement=None,
        rts=none,
        batch=form.LeastSquares(),
        residuals=None,
        set_aside=[],
        truth=None,
        warnings=list(result.warnings),
        error=UNSET if result.error is None else result.error,
    )


def _with_outlines(result: CellResult, runs: Sequence[Run]) -> form.Cell:
    """A cell in JSON, complete."""
    entry = cell_of(result, runs)
    entry.truth = truth_of(result, runs)
    if result.posterior is not None and result.obs is not None:
        posterior, utm = result.posterior, result.obs.utm
        entry.region95 = _region(posterior, utm, LEVEL)
        if posterior.is_strongest_inside:
            entry.region50 = _region(posterior, utm, HALF)
    return entry


def cell_of(result: CellResult, runs: Sequence[Run]) -> form.Cell:
    """A cell in JSON without its regions and the truth, for which squares are outlined."""
    entry = _without_answer(result)
    entry.reference_ekf = _final_state(result, "reference")
    entry.ekf = _final_state(result, "ekf")
    entry.ekf_backward = _final_state(result, "backward")
    entry.agreement = _agreement(result.comparison)
    entry.rts = _final_state(result, "rts")
    entry.batch = _least_squares(result)
    entry.residuals = _residuals(result.residuals)
    entry.set_aside = [form.Spike(**spike._asdict()) for spike in result.set_aside]
    if result.timing is not None:
        entry.timing = form.Timing(**result.timing._asdict())
    place = result.place
    if place is not None and result.posterior is not None:
        _add_answer(entry, place, parameters_of(result.posterior))
    if len(runs) > 1:
        entry.offsets = [
            form.Offset(
                run=str(runs[share.run].path),
                n=share.n,
                offset_db=share.offset_db,
                sigma_db=share.sigma_db,
            )
            for share in result.shares
        ]
        entry.without = [_without(rest, runs[i]) for i, rest in result.without.items()]
    return entry


def _add_answer(entry: form.Cell, place: Place, parameters: Parameters) -> None:
    entry.best = form.Best(
        **{name: getattr(place, name) for name in _PLACE},
        **{name: getattr(parameters, name) for name in _PARAMETERS},
    )
    entry.modes = list(place.modes)
    entry.noise = form.Noise(**{name: getattr(parameters, name) for name in _NOISE})
    entry.prior = parameters.prior
    entry.alternatives = list(parameters.alternatives)


def _region(posterior: Posterior, utm: Utm, level: float) -> form.Region:
    return form.Region(
        area_m2=area_m2(posterior.squares, level),
        geojson=form.MultiPolygon(**geojson(posterior.squares, utm, level)),
    )


def _degrees(place: Places) -> dict[str, float]:
    return dict(zip(("lat", "lon"), place.first_deg, strict=True))


def _without(rest: CellResult, left_out: Run) -> form.Without:
    place = rest.place
    return form.Without(
        n=rest.n,
        verdict=rest.verdict,
        best=place.position if place else None,
        region95=form.Area(area_m2=place.area_m2 if place else None),
        run=str(left_out.path),
    )


def _state(x: FloatArray, p: FloatArray, utm: Utm) -> dict[str, Any]:
    """A Gaussian estimate: state (4,), covariance (4, 4)."""
    return {
        **_degrees(Places.of(x[0], x[1], utm=utm)),
        "drms_m": ekf.drms_m(ekf.upper_triangle(p)),
        "p0_dbm": float(x[2]),
        "p0_sigma_db": float(np.sqrt(max(p[2, 2], 0.0))),
        "eta": float(x[3]),
        "eta_sigma": float(np.sqrt(max(p[3, 3], 0.0))),
        "ellipse95": ellipse95(p[0, 0], p[0, 1], p[1, 1]),
    }


def _final_state(result: CellResult, name: str) -> form.FinalState:
    path: FilterPath | None = getattr(result, name)
    if path is None or result.obs is None:
        return form.FinalState(converged=False if name in result.failed else None)
    n = path.consistency.n if path.consistency else len(path)
    state = _state(path.x[-1, :4], path.p[-1, :4, :4], result.obs.utm)
    return form.FinalState(**state, n=n, converged=True)


def _least_squares(result: CellResult) -> form.LeastSquares:
    fit: BatchFit | None = result.batch
    if fit is None or result.obs is None:
        return form.LeastSquares(converged=False if "batch" in result.failed else None)
    utm = result.obs.utm
    return form.LeastSquares(
        **_state(fit.state, fit.covariance, utm),
        n=fit.n,
        sigma_db=fit.sigma_db,
        converged=fit.converged,
        bounded=fit.bounded,
        correlation_inflation=fit.inflation,
        rivals=[form.Point(**_degrees(Places.of(*rival[:2], utm=utm))) for rival in fit.rivals],
    )


def _agreement(compared: Comparison | None) -> form.Agreement | None:
    if compared is None:
        return None
    sigmas: dict[str, float | None] = dict(zip(AXES, compared.sigmas, strict=True))
    return form.Agreement(sigmas=sigmas, agrees=compared.agrees)


def _residuals(residuals: Residuals | None) -> form.Residuals | None:
    if residuals is None:
        return None
    bins = [
        part and form.Bins(**_lists(part)) for part in (residuals.by_distance, residuals.by_azimuth)
    ]
    innovations = residuals.innovations
    return form.Residuals(
        **{name: getattr(residuals, name) for name in _STATISTICS},
        by_distance=bins[0],
        by_azimuth=bins[1],
        innovations=innovations and form.Innovations(**innovations._asdict()),
        outliers=[form.Outlier(**outlier._asdict()) for outlier in residuals.outliers],
    )


def _lists(columns: NamedTuple) -> dict[str, Any]:
    return {name: column.tolist() for name, column in columns._asdict().items()}
