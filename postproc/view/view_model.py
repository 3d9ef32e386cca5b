"""What a recording shows: walks, cells in detail, all cells, and claims; independent of rerun."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import msgspec
import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.posterior import Posterior
from logger.core.readings import Readings
from logger.core.runfile import Run
from logger.core.types import UNKNOWN_TIME, Verdict
from postproc.cell_work import PROCESS_ENDED, Failure, failure
from postproc.estimators.filters import FilterPath
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import Picture, Rings, focus_of, picture_of, regions_of
from postproc.pictures.survey import Box, Survey, clock_of
from postproc.processes import each
from postproc.result import EKF, REFERENCE, CellResult, Estimator, Options, Result
from postproc.smoothing import FEWEST_READINGS, locate_cell
from postproc.verification.claims import CellVerdict

PAUSE_NS = 60 * 10**9
"""Between two runs, so that the end of one and the start of the next can be distinguished."""

_TIME_COLUMNS = ("t_ns", "t_start_ns")


def end_to_end(runs: Sequence[Run]) -> list[Run]:
    """The runs one after the other on one clock, by UTC where it is known, else in the given order.

    The first run starts at 0, the next one `PAUSE_NS` after the last record of the one before.
    """
    sequence, start_ns = [], 0
    for run in _by_utc(runs):
        shifted = _shift(run, start_ns - run.meta.started_ns)
        sequence.append(shifted)
        start_ns = _last_ns(shifted) + PAUSE_NS
    return sequence


def _by_utc(runs: Sequence[Run]) -> list[Run]:
    starts = [clock_of([run]).start_text() for run in runs]
    if None in starts:
        return list(runs)
    # ISO 8601 sorts by time
    return [run for _, run in sorted(zip(starts, runs, strict=True), key=lambda pair: str(pair[0]))]


def _last_ns(run: Run) -> int:
    last_ns = [int(np.max(rows["t_ns"])) for rows in run.tables.values() if len(rows)]
    return max([run.meta.started_ns, *last_ns])


def _shift(run: Run, by_ns: int) -> Run:
    tables = {}
    for name, rows in run.tables.items():
        tables[name] = rows.copy()
        for column in _TIME_COLUMNS:
            if column in (rows.dtype.names or ()):
                tables[name][column] += np.where(rows[column] == UNKNOWN_TIME, 0, by_ns)
    meta = msgspec.structs.replace(run.meta, started_ns=run.meta.started_ns + by_ns)
    return replace(run, meta=meta, tables=tables)


MOST_STEPS = 16
"""Each takes as long as the answer itself."""
_EARLY_POWER = 1.6
"""Steps are denser at the beginning, where the region shrinks most."""


class Step(NamedTuple):
    """Answer from the first `n` readings, the last of them at `t_ns`."""

    t_ns: int
    n: int
    verdict: Verdict
    posterior: Posterior


def answer_steps(result: CellResult, options: Options, processes: int = 1) -> Iterator[Step]:
    """A cell's answer in at most `MOST_STEPS` steps, the last of them the answer itself.

    There is none without a posterior.
    """
    obs, posterior = result.obs, result.posterior
    if obs is None or posterior is None:
        return
    counts = step_counts(len(obs))[:-1]
    in_time = np.argsort(obs.t_ns, kind="stable")  # of several runs a later one may come first
    parts = [obs.part(np.sort(in_time[:n])) for n in counts]
    locate = partial(locate_cell, prior=options.prior, within_m=options.within_m)
    answers = each(locate, parts, processes, _cell_without_result)
    for n, part in zip(counts, answers, strict=True):
        if part.posterior is not None:
            yield Step(int(obs.t_ns[in_time[n - 1]]), n, part.verdict, part.posterior)
    yield Step(int(obs.t_ns[in_time[-1]]), len(obs), result.verdict, posterior)


def _cell_without_result(part: Readings) -> CellResult:
    """The answer of a step that ended a process."""
    why = failure(part.cell, "a step of its answer", PROCESS_ENDED)
    return CellResult(part.cell, len(part), part, "cannot tell", ()).after(why)


def step_counts(count: int) -> list[int]:
    """Numbers of readings after which there is a step; the last is `count`."""
    share = np.linspace(0.0, 1.0, MOST_STEPS + 1)[1:] ** _EARLY_POWER
    return [int(n) for n in np.unique(np.ceil(share * count)) if n >= min(FEWEST_READINGS, count)]


@dataclass(frozen=True, slots=True)
class CellView:
    """A cell in detail, its answer step by step, and the claims about it.

    `regions` are outlines by name for each step.
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

    `cells` are all results, most readings first. `box` is the plan's rectangle in local metres,
    None without a fix. `failures` are cells of which something cannot be shown; the warnings of the
    survey name them.
    """

    survey: Survey
    cells: tuple[CellResult, ...]
    cell_views: tuple[CellView, ...]
    cell_colours: dict[str, Colour]
    box: Box | None
    failures: tuple[Failure, ...] = ()
    unnoticed: str = ""  # as of the result

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
        runs = ", ".join(walk.run.name for walk in self.survey.walks)
        return f"{runs} {self.cell_views[0].name}" if len(self.cell_views) == 1 else runs


def select_cells(result: Result, names: Sequence[str] | None) -> list[CellResult]:
    """The cells to show in detail: those named, in that order, else the one of `focus_of`."""
    if names:
        by_name = {cell.cell: cell for cell in result.cells}
        return [by_name[name] for name in dict.fromkeys(names) if name in by_name]
    focus = focus_of(result)
    return [focus] if focus else []


def view_model(
    result: Result, survey: Survey, cell_views: Sequence[CellView], failures: Collection[Failure]
) -> ViewModel:
    """Gather what is drawn; a run without records gives an empty view."""
    pictures = [view.picture for view in cell_views] or [picture_of(survey, None)]
    corners_m = [picture.box.corners_m for picture in pictures if picture.box]
    view = ViewModel(
        survey=survey,
        cells=result.cells,
        cell_views=tuple(cell_views),
        cell_colours=_cell_colours(survey, [view.name for view in cell_views]),
        box=Box.around(np.vstack(corners_m)) if corners_m else None,
        unnoticed=result.unnoticed,
    )
    return view.without(failures)


def cell_view(
    survey: Survey,
    result: CellResult,
    steps: Sequence[Step] = (),
    claims: Sequence[CellVerdict] = (),
) -> CellView:
    """A cell of the survey in detail."""
    regions = tuple(regions_of(step.posterior, survey.origin_m) for step in steps)
    return CellView(picture_of(survey, result), result, tuple(steps), regions, tuple(claims))


def _cell_colours(survey: Survey, detailed: Sequence[str]) -> dict[str, Colour]:
    """The first detailed cell has the colour of the walker, the others theirs in turn."""
    observed = [levels.cell for levels in survey.levels]
    others = [name for name in dict.fromkeys([*detailed, *observed]) if name not in detailed[:1]]
    inks = {name: colours.OTHERS[i % len(colours.OTHERS)] for i, name in enumerate(others)}
    return inks | dict.fromkeys(detailed[:1], colours.WALKER)
