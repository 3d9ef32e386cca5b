"""What the simulation says."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.document import Column, Document, Line, Part, Table, Value
from logger.core.errors import ConfigError
from postproc.reproductions.toa.simulate import Row, Setting

_COLUMNS = ("LSE", "KF of the README", "KF on squares", "bound, epoch", "bound, motion")
_NOTES = (
    "LSE: each epoch alone.",
    "KF of the README: singular S, inverted over independent rows;",
    "the pseudo-inverse gives the same to {apart:.1e} m.",
    "KF on squares: the same task with a matrix of full rank.",
    "Bound: mean error of a Gaussian that reaches the Cramer-Rao bound (unbiased estimators),",
    "of one epoch, or of all epochs so far at constant velocity.",
    "NEES by degree of freedom: 1 for a true covariance, above 1 for one that is too small.",
)
_FORM = "{text!r}: positions are written x,y x,y ... in metres"


def places(text: str) -> FloatArray:
    """Positions from "x,y x,y ..." (or with semicolons between) in metres, shape (n, 2).

    Raises `ConfigError`.
    """
    pairs = [pair.split(",") for pair in text.replace(";", " ").split()]
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise ConfigError(_FORM.format(text=text))
    try:
        return np.array(pairs, float)
    except ValueError:
        raise ConfigError(_FORM.format(text=text)) from None


def document_of(setting: Setting, rows: list[Row], *, steps: bool) -> Document:
    """Mean errors over steps and runs, a line for each variance; with `steps` for each step too."""
    content = {
        "anchors_m": setting.anchors.position_m,
        "path_m": setting.path_m,
        "runs": setting.runs,
        "seed": setting.seed,
        "rows": [_row(row, steps=steps) for row in rows],
    }
    columns = [
        Column("sigma²", unit="m²"),
        *(Column(title, is_right=True) for title in (*_COLUMNS, "NEES KF", "NEES squares")),
        Column("Q from"),
    ]
    apart_m = max(row.pinv_difference_m for row in rows)
    over = f"{len(setting.path_m)} steps and {setting.runs} runs, {len(setting.anchors)} anchors"
    body: list[Part] = [
        f"mean error (m) over {over}",
        Table(columns, [line for row in rows for line in _lines(row, steps=steps)]),
        *(Line(note.format(apart=apart_m), "dim") for note in _NOTES),
    ]
    return Document(content, body=body)


def _row(row: Row, *, steps: bool) -> dict[str, Any]:
    found: dict[str, Any] = {"sigma2": row.sigma2_m2}
    found |= {
        name: None if errors is None else float(np.mean(errors))
        for name, errors in _errors(row).items()
    }
    found |= {
        "q_from": "README" if row.is_printed else "derived",
        "kf_nees": row.kf_nees,
        "squares_nees": row.squares_nees,
        "pinv_difference_m": row.pinv_difference_m,
    }
    if steps:
        found["steps"] = [
            {"k": k}
            | {name: None if e is None else float(e[k]) for name, e in _errors(row).items()}
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


def _lines(row: Row, *, steps: bool) -> list[Sequence[Value]]:
    nees = (f"{row.kf_nees:.2f}", f"{row.squares_nees:.2f}")
    q_from = "README" if row.is_printed else "derived"
    by_step = range(len(row.lse_m) if steps else 0)
    return [
        [f"{row.sigma2_m2:g}", *_metres(row, slice(None)), *nees, q_from],
        *([f"step {k}", *_metres(row, slice(k, k + 1))] for k in by_step),
    ]


def _metres(row: Row, steps: slice) -> list[str]:
    """Mean errors over some steps with four digits, as the README's errors are known."""
    return [
        "–" if error_m is None else f"{np.mean(error_m[steps]):#.4g}"
        for error_m in _errors(row).values()
    ]
