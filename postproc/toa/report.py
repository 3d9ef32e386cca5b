"""The table of the simulation: in a terminal, and as JSON."""

import json
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.toa.simulate import Row, Setting

Json = dict[str, Any]

_COLUMNS = ("LSE", "KF of the README", "KF on squares", "bound, epoch", "bound, motion")
_NOTES = (
    "LSE: each epoch alone. KF of the README: singular S, inverted over independent rows; the pseudo-inverse gives the",
    "same to {apart:.1e} m. KF on squares: the same task with a matrix of full rank. Bounds: mean error of a Gaussian",
    "that reaches the Cramer-Rao bound of one epoch, and of all epochs so far of an even motion (unbiased estimators).",
    "NEES by degree of freedom: 1 for a covariance that is true, above 1 for one that is too small.",
)


def places(text: str) -> FloatArray:
    """Places from "x,y x,y ..." (or with semicolons between) in metres, shape (n, 2); raises `ConfigError`."""
    try:
        found = [[float(value) for value in place.split(",")] for place in text.replace(";", " ").split()]
    except ValueError:
        raise ConfigError(f"{text!r}: places are written x,y x,y ... in metres") from None
    if not found or any(len(place) != 2 for place in found):
        raise ConfigError(f"{text!r}: places are written x,y x,y ... in metres")
    return np.array(found)


def as_json(setting: Setting, rows: list[Row], *, steps: bool) -> str:
    """All there is to know, with the errors of each step where wanted."""
    found = {
        "anchors_m": setting.anchors.place_m.tolist(),
        "path_m": setting.path_m.tolist(),
        "runs": setting.runs,
        "seed": setting.seed,
        "rows": [_row(row, steps=steps) for row in rows],
    }
    return json.dumps(found, indent=2)


def _row(row: Row, *, steps: bool) -> Json:
    found: Json = {"sigma2": row.sigma2_m2}
    found |= {name: None if errors is None else float(np.mean(errors)) for name, errors in _errors(row).items()}
    found |= {
        "q_from": "README" if row.is_printed else "derived",
        "kf_nees": row.kf_nees,
        "squares_nees": row.squares_nees,
        "pinv_difference_m": row.pinv_difference_m,
    }
    if steps:
        found["steps"] = [
            {"k": k} | {name: None if e is None else float(e[k]) for name, e in _errors(row).items()}
            for k in range(len(row.lse_m))
        ]
    return found


def _errors(row: Row) -> dict[str, FloatArray | None]:
    return {
        "lse_m": row.lse_m,
        "kf_m": row.kf_m,
        "squares_m": row.squares_m,
        "bound_epoch_m": row.epoch_bound_m,
        "bound_motion_m": row.motion_bound_m,
    }


def print_rows(setting: Setting, rows: list[Row], *, steps: bool) -> None:
    """Mean errors over steps and runs, one line for each variance; with `steps` one for each step as well."""
    console = Console(highlight=False)
    console = console if console.is_terminal else Console(highlight=False, width=200)
    console.print(
        f"mean error (m) over {len(setting.path_m)} steps and {setting.runs} runs, {len(setting.anchors)} anchors"
    )
    table = Table("sigma² (m²)", *_COLUMNS, "NEES KF", "NEES squares", "Q from", box=None)
    for column in table.columns[:-1]:
        column.justify = "right"
    for row in rows:
        table.add_row(
            f"{row.sigma2_m2:g}",
            *_metres(row, slice(None)),
            f"{row.kf_nees:.2f}",
            f"{row.squares_nees:.2f}",
            "README" if row.is_printed else "derived",
        )
        if steps:
            for k in range(len(row.lse_m)):
                table.add_row(f"step {k}", *_metres(row, slice(k, k + 1)))
    console.print(table)
    apart_m = max(row.pinv_difference_m for row in rows)
    console.print("\n".join(_NOTES).format(apart=apart_m), style="dim")


def _metres(row: Row, steps: slice) -> list[str]:
    """Mean errors over some steps with four digits, as the README's errors are known."""
    return ["-" if error_m is None else f"{np.mean(error_m[steps]):#.4g}" for error_m in _errors(row).values()]
