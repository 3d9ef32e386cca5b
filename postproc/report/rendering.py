"""The report of a result: its page, and its figures as files."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import matplotlib as mpl

from logger.core.suspicion.words import reason_line
from postproc.atomic_write import whole_file
from postproc.basemap import street_at
from postproc.cell_work import Attempts, Failure, attempt, exit_code
from postproc.pictures.picture import picture_of
from postproc.pictures.plots import STYLE, save_figure
from postproc.pictures.survey import Survey, survey_of
from postproc.progress import Progress
from postproc.report.cell_map import cell_map
from postproc.report.figures import ReportFigure, figures_of, overview
from postproc.report.page import (
    CellSection,
    Streets,
    cell_section,
    html,
    no_street,
    section_without_details,
)
from postproc.result import CellResult, Result, in_report_order
from postproc.verification.claims import Verified

MOST_DETAILED = 8
"""Cells with figures, unless more are named; the others are in the table."""


@dataclass(frozen=True, slots=True)
class Report:
    """A page, the cells in detail, and their figures in the same order.

    `exit_code` tells whether work on a cell failed.
    """

    html: str
    cells: tuple[str, ...]
    figures: tuple[tuple[ReportFigure, ...], ...]
    overview: ReportFigure | None = None
    cell_map: ReportFigure | None = None
    exit_code: int = 0

    @property
    def n_pictures(self) -> int:
        """Files that `write_figures` writes."""
        others = (self.cell_map, self.overview)
        return 2 * (sum(map(len, self.figures)) + sum(one is not None for one in others))

    def write(self, path: Path) -> int:
        """Write the page, complete or not at all, and return its bytes; raises `RunFileError`."""
        content = self.html.encode()
        with whole_file(path) as part:
            part.write_bytes(content)
        return len(content)

    def write_figures(self, folder: Path) -> Iterator[Path]:
        """Write each figure as PNG and as SVG, numbered like the cells; raises `RunFileError`."""
        named = [
            (f"cell-{number}-{figure.name}", figure)
            for number, figures in enumerate(self.figures, 1)
            for figure in figures
        ]
        named += [(one.name, one) for one in (self.cell_map, self.overview) if one is not None]
        for name, figure in named:
            for suffix in ("png", "svg"):
                path = folder / f"{name}.{suffix}"
                save_figure(figure.figure, path)
                yield path


def make_report(
    result: Result,
    verified: Verified | None = None,
    *,
    most: int = MOST_DETAILED,
    first: Sequence[str] = (),
    basemap: Path | None = None,
    progress: Progress | None = None,
) -> Report:
    """The report of one or several runs, with at most `most` cells in detail, `first` before all.

    `basemap` is a picture of the ground. Raises `ConfigError` where it is unusable.
    """
    cells = select_cells(result.cells, most, first)
    # a cell has one number everywhere: that of its card
    others = (cell for cell in result.cells if not any(cell is one for one in cells))
    result = replace(result, cells=(*cells, *others))
    survey = survey_of(result)
    streets = partial(street_at, basemap) if basemap else no_street
    detailed = (
        _detail(n, result, survey, cell, verified, streets) for n, cell in enumerate(cells, 1)
    )
    names = [cell.cell for cell in cells]
    tries = Attempts("its place on the map")
    with mpl.rc_context(STYLE):
        details = list(progress(detailed, "drawing", len(names), names) if progress else detailed)
        summary = _overview(survey, result.cells)
        plan = cell_map(survey, result.cells, basemap, tries)
    sections = [section for section, _ in details]
    rows = (*result.cells, *(section.result for section in sections))
    said = {reason_line(cell, word) for cell, word in result.words.items()}
    reasons = [f"{cell.cell}: {text}" for cell in rows if cell.error for text in cell.warnings]
    reasons += [f"{why.cell}: {why.reason}" for why in tries.failures.values()]
    warnings = (*(text for text in result.warnings if text not in said), *dict.fromkeys(reasons))
    page = html(replace(result, warnings=warnings), sections, verified, summary, plan)
    figures = tuple(figures for _, figures in details)
    code = exit_code((*rows, *tries.failures.values()))
    return Report(page, tuple(names), figures, summary, plan, code)


def select_cells(
    cells: Sequence[CellResult], most: int, first: Sequence[str] = ()
) -> list[CellResult]:
    """Cells to show in detail: those named `first` or heard."""
    named = set(first)
    shown = [cell for cell in cells if cell.obs is not None or cell.error or cell.cell in named]
    return in_report_order(shown, first)[:most]


_Detail = tuple[CellSection, tuple[ReportFigure, ...]]


def _detail(
    number: int,
    result: Result,
    survey: Survey,
    cell: CellResult,
    verified: Verified | None,
    streets: Streets,
) -> _Detail:
    """A cell in detail, or why there are no details."""

    def draw() -> _Detail:
        claims = verified.of_cell(cell.cell) if verified else []
        figures = tuple(figures_of(picture_of(survey, cell), claims))
        names = [walk.run.name for walk in survey.walks]
        answer = result.answer(cell)
        return cell_section(number, answer, cell, names, figures, streets), figures

    detail = attempt(cell.cell, "its part of the page", draw)
    if isinstance(detail, Failure):
        return section_without_details(number, cell.after(detail)), ()
    return detail


def _overview(survey: Survey, cells: Sequence[CellResult]) -> ReportFigure | None:
    """None of several runs, since each has its own clock."""
    if len(cells) < 2 or len(survey.walks) > 1:
        return None
    by_name = {levels.cell: levels for levels in survey.walks[0].levels}
    return overview([by_name.get(cell.cell) for cell in cells], survey.clock)
