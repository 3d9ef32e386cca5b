"""What a recording shows: walks, cells in detail, all cells, and claims; independent of rerun."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from postproc.cell_work import Attempts, Failure
from postproc.estimators.filters import FilterPath
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.geometry import Box
from postproc.pictures.picture import Picture, focus_of, picture_of
from postproc.pictures.regions import Rings, regions_of
from postproc.pictures.survey import Survey, survey_of
from postproc.result import EKF, REFERENCE, CellResult, Estimator, Result
from postproc.verification.verdicts import CellVerdict
from postproc.view.timeline import Step


class CellDetail(NamedTuple):
    """A cell to show in detail, its answer step by step, and the claims about it."""

    result: CellResult
    steps: tuple[Step, ...] = ()
    claims: tuple[CellVerdict, ...] = ()


@dataclass(frozen=True, slots=True)
class CellView:
    """A cell in detail.

    `regions` are the outlines by name, one dictionary for each step.
    """

    picture: Picture
    result: CellResult
    steps: tuple[Step, ...]
    regions: tuple[dict[str, Rings], ...]
    claims: tuple[CellVerdict, ...]

    @property
    def name(self) -> str:
        """The cell's identity."""
        return self.result.cell

    @property
    def t_ns(self) -> IntArray:
        """Times since boot of the steps, shape (n,)."""
        return np.array([step.t_ns for step in self.steps], np.int64)

    @property
    def filters(self) -> list[tuple[Estimator, FilterPath]]:
        """The filters that ran, the reference first."""
        paths = ((REFERENCE, self.result.reference), (EKF, self.result.ekf))
        return [(estimator, path) for estimator, path in paths if path is not None]

    def of_steps(self, name: str) -> FloatArray:
        """A value of the posterior at each step, shape (n,)."""
        return np.array([getattr(step.posterior, name) for step in self.steps], float)


@dataclass(frozen=True, slots=True)
class ViewModel:
    """One recording for the viewer.

    `cells` are all results, most readings first; `cell_colours` has a colour for every observed
    cell. `box` is the plan's rectangle in local metres, None without a fix. `failures` are cells of
    which something cannot be shown; the warnings of the survey name them.
    """

    survey: Survey
    cells: tuple[CellResult, ...]
    cell_views: tuple[CellView, ...]
    cell_colours: dict[str, Colour]
    box: Box | None
    failures: tuple[Failure, ...] = ()

    def without(self, failures: Collection[Failure]) -> "ViewModel":
        """The view without cells that cannot be shown, and with the reasons."""
        names = {failure.cell for failure in failures}
        reasons = [f"{failure.cell}: {failure.reason}" for failure in failures]
        return replace(
            self,
            survey=replace(self.survey, warnings=(*reasons, *self.survey.warnings)),
            cells=tuple(cell for cell in self.cells if cell.cell not in names),
            cell_views=tuple(cell for cell in self.cell_views if cell.name not in names),
            failures=(*self.failures, *failures),
        )

    @property
    def name(self) -> str:
        """Name of the recording in the viewer."""
        runs = ", ".join(walk.name for walk in self.survey.walks)
        return f"{runs} {self.cell_views[0].name}" if len(self.cell_views) == 1 else runs


def select_cells(result: Result, names: Sequence[str] | None) -> list[CellResult]:
    """The cells to show in detail: those named, in that order, else the one of `focus_of`."""
    if names:
        by_name = {cell.cell: cell for cell in result.cells}
        return [by_name[name] for name in dict.fromkeys(names) if name in by_name]
    focus = focus_of(result)
    return [focus] if focus else []


def view_model(result: Result, details: Sequence[CellDetail]) -> ViewModel:
    """Gather what is drawn; a run without records gives an empty view."""
    survey = survey_of(result)
    tries = Attempts("its view")
    gathered = tries.each(
        details, lambda detail: detail.result.cell, lambda detail: _cell_view(survey, detail)
    )
    cell_views = tuple(cell for _, cell in gathered)
    pictures = [view.picture for view in cell_views] or [picture_of(survey, None)]
    corners_m = [picture.box.corners_m for picture in pictures if picture.box]
    view = ViewModel(
        survey=survey,
        cells=result.cells,
        cell_views=cell_views,
        cell_colours=_cell_colours(survey, [view.name for view in cell_views]),
        box=Box.around(np.vstack(corners_m)) if corners_m else None,
    )
    return view.without(tries.failures.values())


def _cell_view(survey: Survey, detail: CellDetail) -> CellView:
    regions = tuple(regions_of(step.posterior, survey.origin_m) for step in detail.steps)
    return CellView(picture_of(survey, detail.result), *detail[:2], regions, detail.claims)


def _cell_colours(survey: Survey, detailed: Sequence[str]) -> dict[str, Colour]:
    """The first detailed cell in the colour of the walker, the others in turn."""
    observed = [levels.cell for walk in survey.walks for levels in walk.levels]
    others = [name for name in dict.fromkeys([*detailed, *observed]) if name not in detailed[:1]]
    inks = {name: colours.OTHERS[i % len(colours.OTHERS)] for i, name in enumerate(others)}
    return inks | dict.fromkeys(detailed[:1], colours.WALKER)
