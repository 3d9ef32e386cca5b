"""The page of one run or of several, and its pictures as files."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

from logger.core.runfile import Run
from postproc.atomic_write import whole_file
from postproc.json_text import Json
from postproc.pictures.picture import clock_of, levels_of, picture_of
from postproc.pictures.plots import save_figure
from postproc.pictures.plots_style import PIXELS_PER_INCH, STYLE
from postproc.report.figures import Drawn, overview, pictures_of
from postproc.report.page import Told, html, told_cell, walk_of
from postproc.result import CellResult, Result
from postproc.results import summary
from postproc.smoothing import Progress
from postproc.verification.run_claims import Verified

MOST_TOLD = 8
"""Cells with pictures, unless more are named; the others stand in the table."""

_RANK = ("located", "ambiguous", "cannot tell")


@dataclass(frozen=True, slots=True)
class Report:
    """A page, the cells told in full, and their pictures in the same order."""

    html: str
    cells: tuple[str, ...]
    pictures: tuple[tuple[Drawn, ...], ...]
    overview: Drawn | None = None

    def write(self, path: Path) -> int:
        """Write the page, complete or not at all, and tell its bytes; raises `RunFileError`."""
        content = self.html.encode()
        with whole_file(path) as part:
            part.write_bytes(content)
        return len(content)

    def write_pictures(self, folder: Path) -> Iterator[Path]:
        """Write each picture as PNG and as SVG, numbered as the cells are; raises
        `RunFileError`.
        """
        named = [
            (f"cell-{i}-{one.name}", one)
            for i, drawn in enumerate(self.pictures, 1)
            for one in drawn
        ]
        named += [(self.overview.name, self.overview)] if self.overview else []
        for name, picture in named:
            for suffix in ("png", "svg"):
                path = folder / f"{name}.{suffix}"
                save_figure(picture.figure, path, PIXELS_PER_INCH)
                yield path


def report(
    result: Result,
    verified: Verified | None = None,
    *,
    most: int = MOST_TOLD,
    progress: Progress | None = None,
) -> Report:
    """The page of one run or of several; at most so many cells are told in full.

    Each of several runs has a clock of its own, so that nothing of them is drawn over time.
    """
    found = summary(result)
    chosen = most_told(result.cells, most)
    about = [
        [one for one in verified.cells if one.cell == cell.cell] if verified else []
        for cell in chosen
    ]
    entries = _entries(chosen, found)
    alone = len(result.runs) == 1
    made = (
        tuple(
            pictures_of(
                picture_of(result.runs[_first_run(cell)], cell), entry, claims, over_time=alone
            )
        )
        for cell, entry, claims in zip(chosen, entries, about, strict=True)
    )
    drawn = _drawn(made, [cell.cell for cell in chosen], progress)
    every = _overview(result.runs[0].run, found) if alone else None
    walks = [walk_of(observed.run, observed.warnings) for observed in result.runs]
    told = _told(chosen, found, drawn)
    page = html(result, told, found["cells"], walks, verified, every)
    return Report(page, tuple(cell.cell for cell in chosen), drawn, every)


def _first_run(cell: CellResult) -> int:
    """Index of the run whose track and clock the pictures of a cell show."""
    return cell.shares[0].run if cell.shares else 0


def most_told(cells: Sequence[CellResult], most: int) -> list[CellResult]:
    """Cells with most to tell: located before ambiguous before those that cannot be told, then by
    readings.
    """
    known = [cell for cell in cells if cell.obs is not None]
    return sorted(known, key=lambda cell: (_RANK.index(cell.verdict), -cell.n))[:most]


def _overview(run: Run, found: Json) -> Drawn | None:
    if len(found["cells"]) < 2:
        return None
    by_name = {levels.cell: levels for levels in levels_of(run)}
    with mpl.rc_context(STYLE):
        return overview([by_name.get(entry["cell"]) for entry in found["cells"]], clock_of(run))


def _drawn(
    made: Iterable[tuple[Drawn, ...]], names: Sequence[str], progress: Progress | None
) -> tuple[tuple[Drawn, ...], ...]:
    with mpl.rc_context(STYLE):
        return tuple(progress(made, "drawing", len(names), names) if progress else made)


def _told(
    cells: Sequence[CellResult], found: Json, drawn: Iterable[tuple[Drawn, ...]]
) -> list[Told]:
    entries = _entries(cells, found)
    return [
        told_cell(number, cell, entry, mine)
        for number, (cell, entry, mine) in enumerate(zip(cells, entries, drawn, strict=True), 1)
    ]


def _entries(cells: Sequence[CellResult], found: Json) -> list[Json]:
    by_name = {entry["cell"]: entry for entry in found["cells"]}
    return [by_name[cell.cell] for cell in cells]
