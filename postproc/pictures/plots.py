"""A run as a printed page: the plan, level against distance, levels over time."""

from collections.abc import Sequence
from pathlib import Path

from logger.core.errors import ConfigError

try:
    import matplotlib as mpl
    from matplotlib.figure import Figure
except ImportError as error:
    raise ConfigError("pictures need matplotlib: install cellwalk[post]") from error

import textwrap

from matplotlib.backends.backend_agg import FigureCanvasAgg

from postproc.atomic_write import whole_file
from postproc.picture_file import kind_of
from postproc.pictures.fit import fit_of
from postproc.pictures.picture import Picture, focus_of, headline, picture_of
from postproc.pictures.plots_levels import draw_distance, draw_levels
from postproc.pictures.plots_plan import draw_plan
from postproc.pictures.plots_style import STYLE, figure_of_size, legend_below, verbatim
from postproc.result import Result

_DPI = 150
_SIZE_INCH = (11.7, 8.3)


def draw_run(result: Result, path: Path) -> None:
    """One page for the focus cell, format by the suffix (.png, .svg, .pdf); raises `RunFileError`
    or `ConfigError`.
    """
    save_figure(figure_of(result), path, _DPI)


def save_figure(figure: Figure, path: Path, pixels_per_inch: int) -> None:
    """Write a figure, format by the suffix (.png, .svg, .pdf); raises `RunFileError` or
    `ConfigError`.
    """
    kind = kind_of(path)
    FigureCanvasAgg(figure)
    with whole_file(path) as part, mpl.rc_context(STYLE):
        figure.savefig(part, format=kind, dpi=pixels_per_inch, metadata=_undated(kind))


def figure_of(result: Result) -> Figure:
    """The page as a figure, drawn without a screen."""
    observed = result.runs[0]
    picture = picture_of(observed, focus_of(result.cells))
    with mpl.rc_context(STYLE):
        figure = figure_of_size(*_SIZE_INCH)
        figure.suptitle(
            _title(picture, (*observed.warnings, *result.warnings)), fontsize=11, ha="left", x=0.01
        )
        sides = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
        left, right = figure.add_subfigure(sides[0]), figure.add_subfigure(sides[1])
        draw_plan(left, left.subplots(), picture)
        distance, time = right.subplots(2, 1)
        draw_distance(distance, fit_of(picture.focus) if picture.focus else None)
        draw_levels(time, picture)
        legend_below(right, distance, time)
    return figure


def _undated(kind: str) -> dict[str, None]:
    """What to leave out of a file, so that the same picture has the same bytes."""
    return {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})


def _title(picture: Picture, warnings: Sequence[str]) -> str:
    """Cell, run and verdict; what is simulated says so."""
    run, focus = picture.run, picture.focus
    simulated = "SIMULATED run" if run.meta.truth else "run"
    cell = f"Cell {focus.cell}, {focus.n} readings" if focus else "No cell"
    lines = [f"{cell} - {simulated} {run.path.name}"]
    lines += [headline(focus)] if focus else []
    if focus is not None and focus.posterior is not None and focus.verdict == "cannot tell":
        lines.append(f"the 95 % radius around the likeliest place is {focus.posterior.r95_m:.0f} m")
    lines += warnings
    return "\n".join(verbatim(part) for line in lines for part in textwrap.wrap(line, 150))
