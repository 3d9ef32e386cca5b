"""Results as JSON and as `run.post.h5`, beside the run, which is never changed."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.ellipse import ellipse95
from logger.core.geo import Utm
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import area_m2
from logger.core.locator.rivals import relevant_modes, whole_percents
from postproc.atomic_write import whole_file
from postproc.estimators.direction_check import AXES, Comparison
from postproc.estimators.filters import FilterPath
from postproc.estimators.region_outline import geojson
from postproc.estimators.residuals import Residuals
from postproc.info import describe
from postproc.json_text import Json, as_json
from postproc.result import CellResult, ObservedRun, Result
from postproc.truth import truth_of

_BEST = ("lat", "lon", "r95_m", "drms_m", "p0_dbm", "p0_sigma_db", "eta", "eta_sigma")


def path_beside(run: Path, *, together: bool = False) -> Path:
    """`run-x.h5` -> `run-x.post.h5`, or `run-x.together.post.h5` for the first of several runs."""
    return run.with_suffix(".together.post.h5" if together else ".post.h5")


def summary(result: Result) -> Json:
    """What `postproc smooth --json` prints; unknown values are null."""
    runs = [_run(run) for run in result.runs]
    if len(runs) == 1:
        runs[0]["warnings"] += result.warnings
        return {"run": runs[0], "cells": [_cell(cell, result.runs) for cell in result.cells]}
    cells = [_cell(cell, result.runs) | _by_run(cell, result.runs) for cell in result.cells]
    return {"runs": runs, "warnings": list(result.warnings), "cells": cells}


def _run(observed: ObservedRun) -> Json:
    info = asdict(describe(observed.run))
    for bulky in ("cells", "events", "gaps"):
        del info[bulky]
    info["n_readings_without_position"] = (
        observed.observations.n_without_position if observed.observations else info["n_readings"]
    )
    return info | {"warnings": list(observed.warnings)}


def _by_run(cell: CellResult, runs: Sequence[ObservedRun]) -> Json:
    """Only of several runs: what each gave to a cell, and the answer without it."""
    return {
        "offsets": [
            asdict(share) | {"run": str(runs[share.run].run.path)} for share in cell.shares
        ],
        "without": [
            _short(rest) | {"run": str(runs[left_out].run.path)}
            for left_out, rest in cell.without.items()
        ],
    }


def _short(result: CellResult) -> Json:
    """The posterior's answer in a few values."""
    entry: Json = {
        "n": result.n,
        "verdict": result.verdict,
        "best": None,
        "region95": {"area_m2": None},
    }
    if result.posterior is not None and result.obs is not None:
        best = result.posterior
        lat, lon = result.obs.utm.to_latlon(best.x_m, best.y_m)
        entry["best"] = {"lat": lat, "lon": lon, "r95_m": best.r95_m}
        entry["region95"] = {"area_m2": best.region_area_m2}
    return entry


def _cell(result: CellResult, runs: Sequence[ObservedRun]) -> Json:
    posterior, obs = result.posterior, result.obs
    entry: Json = {
        "cell": result.cell,
        "n": result.n,
        "n_scans": result.n_scans,
        "verdict": result.verdict,
        "best": dict.fromkeys(_BEST),
        "modes": [],
        "region95": {"area_m2": None, "geojson": None},
        "region50": {"area_m2": None, "geojson": None},
        "prior": None,
    }
    utm = obs.utm if obs else None
    if posterior is not None and utm is not None:
        entry |= _located(posterior, utm)
    entry["reference_ekf"] = _last(result, "reference")
    entry["ekf"] = _last(result, "ekf")
    entry["ekf_backward"] = _last(result, "backward")
    entry["agreement"] = _agreement(result.comparison)
    entry["rts"] = _last(result, "rts")
    entry["batch"] = _batch(result)
    entry["residuals"] = _residuals(result.residuals)
    entry["set_aside"] = [spike._asdict() for spike in result.set_aside]
    entry["truth"] = truth_of(result, [run.run for run in runs])
    entry["warnings"] = list(result.warnings)
    if result.timing is not None:
        entry["timing"] = result.timing._asdict()
    return entry


def _located(posterior: Posterior, utm: Utm) -> Json:
    lat, lon = utm.to_latlon(posterior.x_m, posterior.y_m)
    named = {name: getattr(posterior, name) for name in _BEST[2:]}
    modes = []
    places = relevant_modes(posterior.modes)
    percent = {id(mode): share for mode, share in zip(places, whole_percents(places), strict=True)}
    for mode in posterior.modes:
        mode_lat, mode_lon = utm.to_latlon(mode.x_m, mode.y_m)
        ellipse = asdict(mode.ellipse)
        shares = {"probability": mode.probability, "percent": percent.get(id(mode))}
        modes.append({"lat": mode_lat, "lon": mode_lon, **shares, "ellipse95": ellipse})
    return {
        "best": {"lat": lat, "lon": lon, **named},
        "modes": modes,
        "region95": {
            "area_m2": area_m2(posterior.squares),
            "geojson": geojson(posterior.squares, utm),
        },
        "region50": {
            "area_m2": area_m2(posterior.squares, 0.5),
            "geojson": geojson(posterior.squares, utm, 0.5),
        },
        "noise": {
            "sigma_db": posterior.sigma_db,
            "decorrelation_m": posterior.decorrelation_m,
            "white_share": posterior.white_share,
        },
        "prior": asdict(posterior.prior),
    }


def estimate(x: FloatArray, p: FloatArray, n: int, utm: Utm) -> Json:
    """A Gaussian estimate: state (4,), covariance (4, 4)."""
    lat, lon = utm.to_latlon(float(x[0]), float(x[1]))
    return {
        "lat": lat,
        "lon": lon,
        "drms_m": ekf.drms_m(ekf.upper_triangle(p)),
        "p0_dbm": float(x[2]),
        "p0_sigma_db": float(np.sqrt(max(p[2, 2], 0.0))),
        "eta": float(x[3]),
        "eta_sigma": float(np.sqrt(max(p[3, 3], 0.0))),
        "ellipse95": asdict(ellipse95(p[0, 0], p[0, 1], p[1, 1])),
        "n": n,
    }


_NO_ESTIMATE: Json = dict.fromkeys(
    ("lat", "lon", "drms_m", "p0_dbm", "p0_sigma_db", "eta", "eta_sigma", "ellipse95")
)
_NO_ESTIMATE |= {"n": 0, "converged": None}


def _no_estimate(result: CellResult, name: str) -> Json:
    """Every value null; `converged` is false where the estimator was asked, null where it was
    not.
    """
    return _NO_ESTIMATE | {"converged": False} if name in result.failed else _NO_ESTIMATE


def _last(result: CellResult, name: str) -> Json:
    """Where a filter ended."""
    filtered: FilterPath | None = getattr(result, name)
    if filtered is None or result.obs is None:
        return _no_estimate(result, name)
    n = filtered.consistency.n if filtered.consistency else len(filtered)
    last = estimate(filtered.x[-1, :4], filtered.p[-1, :4, :4], n, result.obs.utm)
    return last | {"converged": True}


def _agreement(compared: Comparison | None) -> Json | None:
    """EKF backward minus forward, in combined standard deviations."""
    if compared is None:
        return None
    return {"sigmas": dict(zip(AXES, compared.sigmas, strict=True)), "agrees": compared.agrees}


def _residuals(left: Residuals | None) -> Json | None:
    if left is None:
        return None
    names = (
        "sigma_db",
        "skewness",
        "excess_kurtosis",
        "beyond_3_sigma",
        "lag1",
        "decorrelation_m",
        "independent",
    )
    found: Json = {name: getattr(left, name) for name in names}
    for name in ("by_distance", "by_azimuth", "innovations"):
        part = getattr(left, name)
        found[name] = None if part is None else part._asdict()
    found["outliers"] = [outlier._asdict() for outlier in left.outliers]
    return found


def _batch(result: CellResult) -> Json:
    fitted = result.batch
    if fitted is None or result.obs is None:
        return _no_estimate(result, "batch")
    utm = result.obs.utm
    more = {
        "sigma_db": fitted.sigma_db,
        "converged": fitted.converged,
        "bounded": fitted.bounded,
        "correlation_inflation": fitted.inflation,
    }
    rivals = [
        dict(zip(("lat", "lon"), utm.to_latlon(*r[:2].tolist()), strict=True))
        for r in fitted.rivals
    ]
    return estimate(fitted.state, fitted.covariance, fitted.n, utm) | more | {"rivals": rivals}


def write(result: Result, found: Json, path: Path) -> None:
    """Summary `found`, and the path of every filter, to HDF5; complete or not at all.

    Of several runs `run` of each reading is its place in the attribute `run_ids`. Raises
    `RunFileError`.
    """
    run_ids = [run.run.meta.run_id for run in result.runs]
    with _results_file(path, found) as file:
        file.attrs["run_id" if len(run_ids) == 1 else "run_ids"] = (
            run_ids[0] if len(run_ids) == 1 else run_ids
        )
        for i, cell in enumerate(result.cells):
            group = file.create_group(f"cells/{i:04d}")
            _write_cell(group, cell)
            if len(run_ids) > 1:
                group["observations/run"] = (
                    np.zeros(0, np.int64) if cell.run_index is None else cell.run_index
                )


@contextmanager
def _results_file(path: Path, found: Json) -> Iterator[h5py.File]:
    with whole_file(path) as part, h5py.File(part, "w", libver=("earliest", "v108")) as file:
        file.attrs["format"] = "cellwalk results"
        file["summary"] = np.bytes_(as_json(found).encode())
        yield file


def _write_cell(group: h5py.Group, result: CellResult) -> None:
    group.attrs["cell"] = result.cell
    if result.obs is None:
        return
    group.attrs["utm_zone"] = result.obs.utm.zone
    for name in ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq"):
        group[f"observations/{name}"] = getattr(result.obs, name)
    if result.obs.ta is not None:
        group["observations/ta"] = result.obs.ta
    for name in ("reference", "ekf", "backward", "rts"):
        filtered: FilterPath | None = getattr(result, name)
        if filtered is not None:
            for column in ("t_ns", "x", "p", "innovation_db", "innovation_var_db2"):
                group[f"{name}/{column}"] = getattr(filtered, column)
    if result.posterior is not None:
        for column in ("x_m", "y_m", "size_m", "probability"):
            group[f"posterior/{column}"] = getattr(result.posterior.squares, column)
