"""Every cell of a survey located, without the loggers that contradict the others, with its word."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from logger.core.errors import ConfigError
from postproc.cell_work import PROCESS_ENDED, failure
from postproc.progress import with_progress
from postproc.result import Options
from postproc.survey.agreement import FEWEST_LOGGERS, Agreement, LoggerReport, liars, report
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey, SurveyCell
from postproc.survey.estimates import ResultFile, keys_of
from postproc.survey.scheduling import Cluster
from postproc.survey.suspicion import with_words, words_of_runs
from postproc.survey.tasks import (
    RunChoice,
    Task,
    compare_loggers,
    locate_cells,
    runs_of,
    tasks_of,
)

EVERY_RUN = RunChoice()


@dataclass(frozen=True, slots=True)
class Location:
    """All cells by name, the loggers, and how many cells had been located before."""

    cells: tuple[LocatedCell, ...]
    loggers: tuple[LoggerReport, ...]
    n_known: int


def locate_survey(
    survey: Survey,
    options: Options,
    choice: RunChoice = EVERY_RUN,
    only: Sequence[str] = (),
    *,
    cluster: Cluster,
) -> Location:
    """Estimates of every cell that the chosen runs heard, or of those in `only`.

    Raises `ConfigError` for an unknown cell and a scheduler that does not answer.
    """
    loggers = reports_of_loggers(survey, choice, cluster)
    choice = replace(choice, without=choice.without | frozenset(liars(loggers)))
    allowed = runs_of(survey, choice)
    cells = survey.cells(allowed)
    if unknown := set(only) - {cell.cell for cell in cells}:
        raise ConfigError(f"cell {min(unknown)} is not in the survey, or not in these runs")
    cells = [cell for cell in cells if not only or cell.cell in only]
    keys = keys_of(survey, choice, options)
    known = ResultFile(survey.folder / "estimates.jsonl", tuple[LocatedCell, ...])
    waiting = [cell for cell in cells if not _is_done(known.get(keys[cell.cell]))]
    _locate(survey, waiting, choice, options, cluster, known, keys)
    found = [row for cell in cells for row in known.get(keys[cell.cell]) or ()]
    words = words_of_runs(survey, survey.runs_that_heard(only, allowed), cluster)
    located = with_words(survey, found, words)
    return Location(located, tuple(loggers), len(cells) - len(waiting))


def reports_of_loggers(survey: Survey, choice: RunChoice, cluster: Cluster) -> list[LoggerReport]:
    """All loggers against each other; too few of them cannot contradict each other."""
    runs = runs_of(survey, choice)
    if len({survey.runs[digest].logger for digest in runs}) < FEWEST_LOGGERS:
        return []
    options = Options()  # nothing depends on them
    shared = [cell for cell in survey.cells(runs) if cell.n_runs > 2]
    keys = keys_of(survey, choice, options)
    known = ResultFile(survey.folder / "loggers.jsonl", tuple[Agreement, ...])
    waiting = [cell for cell in shared if known.get(keys[cell.cell]) is None]
    tasks = tasks_of(survey, waiting, choice, options)
    arriving = cluster.results(compare_loggers, tasks)
    for task, found in with_progress(arriving, "loggers", len(tasks)):
        known.put([(keys[cell], _of_cell(found, cell)) for cell in task.cells])
    return report(sorted(one for cell in shared for one in known.get(keys[cell.cell]) or ()))


Row = TypeVar("Row", Agreement, LocatedCell)


def _of_cell(found: Sequence[Row], cell: str) -> tuple[Row, ...]:
    return tuple(one for one in found if one.cell == cell)


def _locate(
    survey: Survey,
    cells: Sequence[SurveyCell],
    choice: RunChoice,
    options: Options,
    cluster: Cluster,
    known: ResultFile[tuple[LocatedCell, ...]],
    keys: dict[str, str],
) -> None:
    """Locate cells and keep the results; those with which workers die are tried alone."""
    tasks = tasks_of(survey, cells, choice, options)
    alone: list[Task] = []
    arriving = cluster.results(locate_cells, tasks, lambda _: [])
    for task, located in with_progress(arriving, "locating", len(tasks)):
        if located:
            known.put([(keys[cell], _of_cell(located, cell)) for cell in task.cells])
        else:
            alone += [replace(task, cells=(cell,)) for cell in task.cells]
    named = {cell.cell: cell for cell in cells}
    arriving = cluster.results(
        locate_cells, alone, lambda task: [_row_without_result(named[task.cells[0]])]
    )
    for task, located in with_progress(arriving, "locating", len(alone)):
        known.put([(keys[task.cells[0]], tuple(located))])


def _is_done(rows: Sequence[LocatedCell] | None) -> bool:
    """Whether a cell has its result; one that failed is tried again, with more memory perhaps."""
    return rows is not None and all(row.error is None for row in rows)


def _row_without_result(cell: SurveyCell) -> LocatedCell:
    """The row of a cell with which workers die."""
    why = failure(cell.cell, "its estimate", PROCESS_ENDED)
    return LocatedCell(
        cell=cell.cell,
        rat=cell.rat,
        area=cell.area,
        verdict="cannot tell",
        reasons=(why.reason,),
        n_readings=cell.n_readings,
        n_scans=cell.n_scans,
        n_runs=cell.n_runs,
        n_modems=0,
        first_utc_ns=None,
        last_utc_ns=None,
        error=why.error,
    )
