"""Results as JSON and as `run.post.h5`, beside the run, which is never changed."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.ellipse import ellipse95
from logger.core.geo import Utm
from postproc.estimators.batch import BatchFit
from postproc.estimators.filtered import Filtered
from postproc.estimators.posterior import Posterior
from postproc.estimators.region import area_m2, geojson
from postproc.info import describe
from postproc.smooth import CellResult, Smoothed
from postproc.truth import truth_of
from postproc.whole_file import whole_file

Json = dict[str, Any]

_BEST = ("lat", "lon", "r95_m", "drms_m", "p0_dbm", "p0_sigma_db", "eta", "eta_sigma")


def path_beside(run: Path) -> Path:
    """`run-x.h5` -> `run-x.post.h5`."""
    return run.with_suffix(".post.h5")


def as_json(value: Any) -> str:
    """JSON text; NaN and infinity become null."""
    return msgspec.json.format(msgspec.json.encode(value, enc_hook=_plain), indent=2).decode()


def summary(smoothed: Smoothed) -> Json:
    """What `postproc smooth --json` prints; unknown values are null."""
    info = asdict(describe(smoothed.run))
    for bulky in ("cells", "events", "gaps"):
        del info[bulky]
    observations = smoothed.observations
    info["n_readings_without_position"] = observations.n_without_position if observations else info["n_readings"]
    return {
        "run": info | {"warnings": list(smoothed.warnings)},
        "cells": [_cell(result, smoothed) for result in smoothed.cells],
    }


def _cell(result: CellResult, smoothed: Smoothed) -> Json:
    posterior, obs = result.posterior, result.obs
    entry: Json = {
        "cell": result.cell,
        "n": result.n,
        "verdict": result.verdict,
        "best": dict.fromkeys(_BEST),
        "modes": [],
        "region95": {"area_m2": None, "geojson": None},
        "prior": None,
    }
    utm = obs.utm if obs else None
    if posterior is not None and utm is not None:
        entry |= _located(posterior, utm)
    entry["reference_ekf"] = _last(result.reference, utm)
    entry["ekf"] = _last(result.ekf, utm)
    entry["rts"] = _last(result.rts, utm)
    entry["batch"] = _batch(result.batch, utm)
    entry["truth"] = truth_of(result, smoothed.run)
    entry["warnings"] = list(result.warnings)
    return entry


def _located(posterior: Posterior, utm: Utm) -> Json:
    lat, lon = utm.to_latlon(posterior.x_m, posterior.y_m)
    named = {name: getattr(posterior, name) for name in _BEST[2:]}
    modes = []
    for mode in posterior.modes:
        mode_lat, mode_lon = utm.to_latlon(mode.x_m, mode.y_m)
        ellipse = asdict(mode.ellipse)
        modes.append({"lat": mode_lat, "lon": mode_lon, "probability": mode.probability, "ellipse95": ellipse})
    return {
        "best": {"lat": lat, "lon": lon, **named},
        "modes": modes,
        "region95": {"area_m2": area_m2(posterior.cells), "geojson": geojson(posterior.cells, utm)},
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


_NO_ESTIMATE: Json = dict.fromkeys(("lat", "lon", "drms_m", "p0_dbm", "p0_sigma_db", "eta", "eta_sigma", "ellipse95"))
_NO_ESTIMATE["n"] = 0


def _last(filtered: Filtered | None, utm: Utm | None) -> Json:
    """Where a filter ended; every value null where it was not started."""
    if filtered is None or utm is None:
        return _NO_ESTIMATE
    return estimate(filtered.x[-1], filtered.p[-1], len(filtered), utm)


def _batch(fitted: BatchFit | None, utm: Utm | None) -> Json:
    if fitted is None or utm is None:
        return _NO_ESTIMATE
    more = {"sigma_db": fitted.sigma_db, "converged": fitted.converged, "correlation_inflation": fitted.inflation}
    rivals = [dict(zip(("lat", "lon"), utm.to_latlon(*r[:2].tolist()), strict=True)) for r in fitted.rivals]
    return estimate(fitted.state, fitted.covariance, fitted.n, utm) | more | {"rivals": rivals}


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"no JSON for {type(value).__name__}")


def write(smoothed: Smoothed, found: Json, path: Path) -> None:
    """Summary `found`, and the path of every filter, to HDF5; complete or not at all. Raises `RunFileError`."""
    with whole_file(path) as part, h5py.File(part, "w", libver=("earliest", "v108")) as file:
        file.attrs["format"] = "cellwalk results"
        file.attrs["run_id"] = smoothed.run.meta.run_id
        file["summary"] = np.bytes_(as_json(found).encode())
        for i, result in enumerate(smoothed.cells):
            _write_cell(file.create_group(f"cells/{i:04d}"), result)


def _write_cell(group: h5py.Group, result: CellResult) -> None:
    group.attrs["cell"] = result.cell
    if result.obs is None:
        return
    group.attrs["utm_zone"] = result.obs.utm.zone
    for name in ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq"):
        group[f"observations/{name}"] = getattr(result.obs, name)
    for name in ("reference", "ekf", "rts"):
        filtered: Filtered | None = getattr(result, name)
        if filtered is not None:
            for column in ("t_ns", "x", "p", "innovation_db", "innovation_var_db2"):
                group[f"{name}/{column}"] = getattr(filtered, column)
    if result.posterior is not None:
        for column in ("x_m", "y_m", "size_m", "probability"):
            group[f"posterior/{column}"] = getattr(result.posterior.cells, column)
