"""The JSON form of a `Result`."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET

from logger.core import ekf
from logger.core.answer import Answer
from logger.core.arrays import FloatArray
from logger.core.ellipse import ellipse95
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import HALF, LEVEL, area_m2
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
from postproc.result import CellResult, ObservedRun, Result
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


def summarise(result: Result) -> form.Summary:
    """What `postproc smooth --json` prints of one run or of several."""
    runs = [observed.run for observed in result.runs]
    cells = [_cell_or_why_not(result, cell) for cell in result.cells]
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


def _cell_or_why_not(result: Result, cell: CellResult) -> form.Cell:
    entry = attempt(cell.cell, "its summary", lambda: _cell(result, cell))
    return _without_answer(cell.after(entry)) if isinstance(entry, Failure) else entry


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


def _cell(every: Result, result: CellResult) -> form.Cell:
    runs = [observed.run for observed in every.runs]
    entry = _without_answer(result)
    entry.reference_ekf = _final_state(result, "reference")
    entry.ekf = _final_state(result, "ekf")
    entry.ekf_backward = _final_state(result, "backward")
    entry.agreement = _agreement(result.comparison)
    entry.rts = _final_state(result, "rts")
    entry.batch = _least_squares(result)
    entry.residuals = _residuals(result.residuals)
    entry.set_aside = [form.Spike(**spike._asdict()) for spike in result.set_aside]
    entry.truth = truth_of(result, runs)
    if result.timing is not None:
        entry.timing = form.Timing(**result.timing._asdict())
    if result.posterior is not None and result.obs is not None:
        _add_posterior(entry, every.answer(result), result.posterior, result.obs.utm)
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


def _add_posterior(entry: form.Cell, answer: Answer, posterior: Posterior, utm: Utm) -> None:
    place, parameters = answer.place, answer.parameters
    if place is None or parameters is None:
        return
    entry.best = form.Best(
        **{name: getattr(place, name) for name in _PLACE},
        **{name: getattr(parameters, name) for name in _PARAMETERS},
    )
    entry.modes = list(place.modes)
    entry.region95 = _region(posterior, utm, LEVEL)
    if posterior.is_strongest_inside:
        entry.region50 = _region(posterior, utm, HALF)
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
