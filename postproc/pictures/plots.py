"""A run as a printed page: the plan, level against distance, levels over time."""

import textwrap
from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from logger.core.ellipse import radii_text
from postproc.atomic_write import whole_file
from postproc.picture_file import kind_of
from postproc.pictures.fit import fit_of
from postproc.pictures.picture import Picture, focus_of, headline, picture_of
from postproc.pictures.plots_levels import draw_distance, draw_levels
from postproc.pictures.plots_plan import draw_plan
from postproc.pictures.plots_style import (
    PIXELS_PER_INCH,
    STYLE,
    figure_of_size,
    legend_below,
    verbatim,
)
from postproc.pictures.survey import survey_of
from postproc.result import Result

_SIZE_INCH = (11.7, 8.3)
"""A4, landscape."""
_TITLE_LETTERS = 150
"""As many as fit on a line of the title."""
_WITHOUT_DATE: dict[str, dict[str, None]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata to leave out, so that the same picture has the same bytes."""


def draw_run(result: Result, path: Path) -> None:
    """One page for the focus cell, format by the suffix (.png, .svg, .pdf).

    Raises `RunFileError` or `ConfigError`.
    """
    save_figure(figure_of(result), path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure, format by the suffix; raises `RunFileError` or `ConfigError`."""
    kind = kind_of(path)
    FigureCanvasAgg(figure)
    metadata = _WITHOUT_DATE.get(kind, {})
    with whole_file(path) as part, mpl.rc_context(STYLE):
        figure.savefig(part, format=kind, dpi=PIXELS_PER_INCH, metadata=metadata)


def figure_of(result: Result) -> Figure:
    """The page as a figure, drawn without a screen."""
    picture = picture_of(survey_of(result), focus_of(result))
    with mpl.rc_context(STYLE):
        figure = figure_of_size(*_SIZE_INCH)
        figure.suptitle(_title(picture), fontsize=11, ha="left", x=0.01)
        sides = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
        left, right = figure.add_subfigure(sides[0]), figure.add_subfigure(sides[1])
        draw_plan(left, left.subplots(), picture)
        distance, time = right.subplots(2, 1)
        draw_distance(distance, fit_of(picture.focus) if picture.focus else None)
        draw_levels(time, picture)
        legend_below(right, distance, time)
    return figure


def _title(picture: Picture) -> str:
    """Cell, run and verdict; a simulated run is marked as such."""
    survey, focus = picture.survey, picture.focus
    cell = f"Cell {focus.cell}, {focus.n} readings" if focus else "No cell"
    kind = "SIMULATED run" if survey.is_simulated else "run"
    files = ", ".join(walk.run.path.name for walk in survey.walks)
    lines = [f"{cell} - {kind} {files}"]
    lines += [headline(focus)] if focus else []
    if focus is not None and focus.posterior is not None and focus.verdict == "cannot tell":
        radii = radii_text(focus.posterior.r50_m, focus.posterior.r95_m)
        lines.append(f"{radii} of the best position")
    lines += survey.warnings
    wrapped = (part for line in lines for part in textwrap.wrap(line, _TITLE_LETTERS))
    return "\n".join(map(verbatim, wrapped))
