"""The simulation as a picture: errors by noise, and step by step."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from postproc.atomic_write import whole_file
from postproc.picture_file import kind_of
from postproc.reproductions.toa.simulate import Row, Setting

_DPI = 150
_SIZE_INCH = (11.0, 4.5)
_LINES = {
    "LSE": ("lse_m", "#b2182b", "-"),
    "KF of the README": ("kf_m", "#2166ac", "-"),
    "KF on squares": ("squares_m", "#1b7837", "-"),
    "bound, one epoch": ("epoch_bound_m", "#555555", "--"),
    "bound, constant velocity": ("motion_bound_m", "#555555", ":"),
}


def draw(setting: Setting, rows: list[Row], path: Path) -> None:
    """Write the figure, format by the suffix (.png, .svg, .pdf).

    Raises `ConfigError` or `RunFileError`.
    """
    figure = _figure(setting, rows)
    with whole_file(path) as part:
        figure.savefig(part, format=kind_of(path), dpi=_DPI)


def _figure(setting: Setting, rows: list[Row]) -> Figure:
    figure = Figure(figsize=_SIZE_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    by_noise, by_step = figure.subplots(1, 2)
    _by_noise(by_noise, sorted(rows, key=lambda row: row.sigma2_m2))
    _by_step(by_step, rows[len(rows) // 2])
    figure.suptitle(
        f"{len(setting.anchors)} anchors, {len(setting.path_m)} steps, "
        f"{setting.runs} simulated runs"
    )
    return figure


def _by_noise(axes: Axes, rows: list[Row]) -> None:
    axes.set_title("mean error over all steps, by the noise", fontsize=9)
    sigma_m = np.sqrt([row.sigma2_m2 for row in rows])
    for label, (name, colour, style) in _LINES.items():
        errors = [getattr(row, name) for row in rows]
        if all(error is not None for error in errors):
            mean_m = [float(np.mean(error)) for error in errors]
            axes.loglog(
                sigma_m,
                mean_m,
                style,
                color=colour,
                label=label,
                marker="." if style == "-" else "",
            )
    axes.set_xlabel("sigma of a range (m)")
    axes.set_ylabel("mean error (m)")
    axes.grid(visible=True, which="both", alpha=0.2)
    axes.legend(fontsize=8)


def _by_step(axes: Axes, row: Row) -> None:
    axes.set_title(f"mean error step by step, sigma² = {row.sigma2_m2:g} m²", fontsize=9)
    for name, colour, style in _LINES.values():
        error_m = getattr(row, name)
        if error_m is not None:
            axes.plot(range(len(error_m)), error_m, style, color=colour)
    axes.set_xlabel("step k")
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=True, alpha=0.2)
