"""The results of `smooth` as `run.post.h5`, beside the run, which is never changed."""

from pathlib import Path

import h5py
import numpy as np

from postproc.atomic_write import whole_file
from postproc.estimators.filters import FilterPath
from postproc.json_text import as_json
from postproc.result import CellResult, Result
from postproc.result_json import Summary

_OBSERVATIONS = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
_FILTERS = ("reference", "ekf", "backward", "rts")
_FILTER_COLUMNS = ("t_ns", "x", "p", "innovation_db", "innovation_var_db2")
_POSTERIOR_COLUMNS = ("x_m", "y_m", "size_m", "probability")


def path_beside(run: Path, *, together: bool = False) -> Path:
    """`run-x.h5` -> `run-x.post.h5`, or `run-x.together.post.h5` for the first of several runs."""
    return run.with_suffix(".together.post.h5" if together else ".post.h5")


def write(result: Result, summary: Summary, path: Path) -> None:
    """Write the summary and every filter's path to HDF5, complete or not at all.

    Of several runs `observations/run` is the index in the attribute `run_ids` of each reading.
    Raises `RunFileError`.
    """
    run_ids = [observed.run.meta.run_id for observed in result.runs]
    with whole_file(path) as part, h5py.File(part, "w", libver=("earliest", "v108")) as file:
        file.attrs["format"] = "cellwalk results"
        file["summary"] = np.bytes_(as_json(summary).encode())
        if len(run_ids) == 1:
            file.attrs["run_id"] = run_ids[0]
        else:
            file.attrs["run_ids"] = run_ids
        for i, cell in enumerate(result.cells):
            group = file.create_group(f"cells/{i:04d}")
            _write_cell(group, cell)
            if len(run_ids) > 1:
                run_index = cell.run_index
                group["observations/run"] = np.zeros(0, int) if run_index is None else run_index


def _write_cell(group: h5py.Group, result: CellResult) -> None:
    group.attrs["cell"] = result.cell
    if result.obs is None:
        return
    group.attrs["utm_zone"] = result.obs.utm.zone
    for column in _OBSERVATIONS:
        group[f"observations/{column}"] = getattr(result.obs, column)
    if result.obs.ta is not None:
        group["observations/ta"] = result.obs.ta
    for name in _FILTERS:
        path: FilterPath | None = getattr(result, name)
        for column in _FILTER_COLUMNS if path is not None else ():
            group[f"{name}/{column}"] = getattr(path, column)
    if result.posterior is not None:
        for column in _POSTERIOR_COLUMNS:
            group[f"posterior/{column}"] = getattr(result.posterior.squares, column)
