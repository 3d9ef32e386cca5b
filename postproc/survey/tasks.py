"""Pieces of work: some cells of one area, each a function of the survey and nothing else."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import groupby

from postproc.cell_work import Failure, attempt
from postproc.ground import places_of
from postproc.processes import small_matrices
from postproc.result import Options
from postproc.survey.agreement import Agreement, agreements
from postproc.survey.cell_location import (
    CellRuns,
    LocatedCell,
    joined_readings,
    locate_cell_of,
)
from postproc.survey.dataset import Survey, SurveyCell
from postproc.survey.walk_readings import SurveyRun

_MOST_READINGS = 2_000_000
"""Of a task: a worker holds them, some 0.2 GB and as much again while it works."""
_MOST_CELLS = 4
"""Of a task: some seconds of work that a worker may lose when it is killed."""


@dataclass(frozen=True, slots=True)
class RunChoice:
    """Which runs count: begun at `since_utc_ns` or later, and before `until_utc_ns`.

    None of the loggers in `without`.
    """

    since_utc_ns: int | None = None
    until_utc_ns: int | None = None
    without: frozenset[str] = frozenset()

    def allows(self, run: SurveyRun) -> bool:
        """Whether a run counts; one without a time does where no time is asked for."""
        if run.logger in self.without:
            return False
        begun_ns = run.began_utc_ns
        if begun_ns is None:
            return self.since_utc_ns is None and self.until_utc_ns is None
        return (self.since_utc_ns is None or begun_ns >= self.since_utc_ns) and (
            self.until_utc_ns is None or begun_ns < self.until_utc_ns
        )


@dataclass(frozen=True, slots=True)
class Task:
    """Cells of one area of a survey."""

    survey: Survey
    area: str
    cells: tuple[str, ...]
    choice: RunChoice
    options: Options


def runs_of(survey: Survey, choice: RunChoice) -> list[str]:
    """Digests of the runs that count, in the order in which they began."""
    return [digest for digest, run in survey.runs.items() if choice.allows(run)]


def tasks_of(
    survey: Survey, cells: Sequence[SurveyCell], choice: RunChoice, options: Options
) -> list[Task]:
    """All cells in tasks of bounded size, largest first: the last ones to end are small."""
    found, bare = [], survey.without_contents()
    for area, some in groupby(cells, key=lambda cell: cell.area):
        for few in _limit_size(list(some)):
            n = sum(cell.n_readings for cell in few)
            names = tuple(cell.cell for cell in few)
            found.append((n, Task(bare, area, names, choice, options)))
    found.sort(key=lambda one: -one[0])
    return [task for _, task in found]


def locate_cells(task: Task) -> list[LocatedCell]:
    """Estimates of the cells of a task."""
    survey = _open(task.survey)
    with small_matrices():
        return [
            row
            for cell in _cells_of(survey, task)
            for row in locate_cell_of(cell, survey.runs, task.options)
        ]


def compare_loggers(task: Task) -> list[Agreement]:
    """Loggers against each other in each of the cells of a task."""
    survey = _open(task.survey)
    found: list[Agreement] = []
    with small_matrices():
        for cell in _cells_of(survey, task):
            some = attempt(cell.cell, "its part in the comparison of loggers",
                           partial(_agreements, survey, cell))  # fmt: skip
            found += [] if isinstance(some, Failure) else some
    return found


def _agreements(survey: Survey, cell: CellRuns) -> list[Agreement]:
    found: list[Agreement] = []
    for place, near in enumerate(places_of(cell.parts), 1):
        names = [survey.runs[digest].logger for digest in near]
        agreeing = agreements(joined_readings(near, names), list(dict.fromkeys(names)))
        found += [one._replace(place=place) for one in agreeing]
    return found


def _limit_size(cells: list[SurveyCell]) -> Iterator[list[SurveyCell]]:
    few: list[SurveyCell] = []
    for cell in cells:
        n = sum(one.n_readings for one in few) + cell.n_readings
        if few and (n > _MOST_READINGS or len(few) == _MOST_CELLS):
            yield few
            few = []
        few.append(cell)
    if few:
        yield few


def _cells_of(survey: Survey, task: Task) -> Iterator[CellRuns]:
    allowed = runs_of(survey, task.choice)
    parts = survey.observations(task.area, task.cells, allowed)
    n_scans = survey.scans_of(task.cells, allowed)
    for cell in task.cells:
        yield CellRuns(
            cell, task.area, survey.rats[cell], n_scans.get(cell, {}), parts.get(cell, {})
        )


@lru_cache(maxsize=1)  # what is known of its runs and cells serves all tasks of a worker
def _open(survey: Survey) -> Survey:
    for batch in survey.batches:
        survey.check(batch)
    return survey
