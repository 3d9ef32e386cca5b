"""Every cell of a survey located, without the loggers that contradict the others, with its word."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from logger.core.document import Column, Document, Line, Table, Value, Word
from logger.core.errors import ConfigError
from logger.core.suspicion.rule import WORDS
from postproc.cell_work import PROCESS_ENDED, failure
from postproc.progress import with_progress
from postproc.result import RADIUS_COLUMNS, VERDICTS, Options, surely
from postproc.survey.agreement import FEWEST_LOGGERS, Agreement, LoggerReport, liars, report
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey, SurveyCell
from postproc.survey.estimates import Estimates, keys_of
from postproc.survey.scheduling import Cluster
from postproc.survey.suspicion import unnoticed_in, with_words, words_of_runs
from postproc.survey.tasks import (
    RunChoice,
    Task,
    compare_loggers,
    locate_cells,
    runs_of,
    tasks_of,
)

EVERY_RUN = RunChoice()
_MOST_ROWS = 40
"""Cells on the terminal; the files have all of them."""
CELL_COLUMNS = (
    Column("cell"),
    Column("verdict"),
    Column("position"),
    *RADIUS_COLUMNS,
    Column("readings", "d"),
    Column("runs", "d"),
)
_MODEMS = Column("modems", "d")


@dataclass(frozen=True, slots=True)
class Location:
    """All cells by name, loggers, how many were located before, and what no rule could see."""

    cells: tuple[LocatedCell, ...]
    loggers: tuple[LoggerReport, ...]
    n_known: int
    unnoticed: str


def locate_survey(
    survey: Survey,
    options: Options,
    choice: RunChoice = EVERY_RUN,
    only: Sequence[str] = (),
    *,
    cluster: Cluster,
) -> Location:
    """Estimates of every cell that the chosen runs heard, or of those in `only`.

    Raises `ConfigError` for an unknown cell, no runs, and a scheduler that does not answer.
    """
    if not runs_of(survey, choice):
        which = "of this time" if survey.runs else "yet: `postproc survey add` adds some"
        raise ConfigError(f"{survey.folder} has no run {which}")
    loggers = reports_of_loggers(survey, choice, cluster)
    choice = replace(choice, without=choice.without | frozenset(liars(loggers)))
    allowed = runs_of(survey, choice)
    cells = survey.cells(allowed)
    if unknown := set(only) - {cell.cell for cell in cells}:
        raise ConfigError(f"cell {min(unknown)} is not in the survey, or not in these runs")
    cells = [cell for cell in cells if not only or cell.cell in only]
    keys = keys_of(survey, choice, options)
    known = Estimates(survey.folder / "estimates.jsonl", tuple[LocatedCell, ...], keys)
    waiting = [cell for cell in cells if not _is_done(known.of(cell.cell))]
    _locate(survey, waiting, choice, options, cluster, known)
    found = [row for cell in cells for row in known.of(cell.cell) or ()]
    words = words_of_runs(survey, survey.runs_that_heard(only, allowed), cluster)
    located = with_words(survey, found, words)
    return Location(located, tuple(loggers), len(cells) - len(waiting), unnoticed_in(words))


def reports_of_loggers(survey: Survey, choice: RunChoice, cluster: Cluster) -> list[LoggerReport]:
    """All loggers against each other; too few of them cannot contradict each other."""
    runs = runs_of(survey, choice)
    if len({survey.runs[digest].logger for digest in runs}) < FEWEST_LOGGERS:
        return []
    options = Options()  # nothing depends on them
    shared = [cell for cell in survey.cells(runs) if cell.n_runs > 2]
    keys = keys_of(survey, choice, options)
    known = Estimates(survey.folder / "loggers.jsonl", tuple[Agreement, ...], keys)
    waiting = [cell for cell in shared if known.of(cell.cell) is None]
    tasks = tasks_of(survey, waiting, choice, options)
    arriving = cluster.results(compare_loggers, tasks)
    for task, found in with_progress(arriving, "loggers", len(tasks)):
        known.put(task.cells, found)
    return report(sorted(one for cell in shared for one in known.of(cell.cell) or ()))


def _locate(
    survey: Survey,
    cells: Sequence[SurveyCell],
    choice: RunChoice,
    options: Options,
    cluster: Cluster,
    known: Estimates[LocatedCell],
) -> None:
    """Locate cells and keep the results; those with which workers die are tried alone."""
    tasks = tasks_of(survey, cells, choice, options)
    alone: list[Task] = []
    arriving = cluster.results(locate_cells, tasks, lambda _: [])
    for task, located in with_progress(arriving, "locating", len(tasks)):
        if located:
            known.put(task.cells, located)
        else:
            alone += [replace(task, cells=(cell,)) for cell in task.cells]
    named = {cell.cell: cell for cell in cells}
    arriving = cluster.results(
        locate_cells, alone, lambda task: [_row_without_result(named[task.cells[0]])]
    )
    for task, located in with_progress(arriving, "locating", len(alone)):
        known.put(task.cells, located)


def _is_done(rows: Sequence[LocatedCell] | None) -> bool:
    """Whether a cell has its result; one that failed is tried again, with more memory perhaps."""
    return rows is not None and all(row.error is None for row in rows)


def _row_without_result(cell: SurveyCell) -> LocatedCell:
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


def document_of(location: Location, files: Sequence[Path]) -> Document:
    """Located cells first, the most certain at the top, and the loggers that are left out."""
    cells = [msgspec.structs.asdict(cell) for cell in location.cells]
    for cell in cells:  # regions are in the files
        del cell["region_wkb"], cell["runs"]
    loggers = [one._asdict() for one in location.loggers]
    ordered = sorted(
        location.cells,
        key=lambda cell: (VERDICTS.index(cell.verdict), cell.r95_m or 0.0, cell.cell),
    )
    counts = Counter(cell.verdict for cell in ordered)
    text = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    known = f"; {location.n_known} known from before" if location.n_known else ""
    return Document(
        {"files": files, "loggers": loggers, "cells": cells, "unnoticed": location.unnoticed},
        f"{len(ordered)} cells: {text or 'none'}{known}",
        body=[*_parts(location, ordered), *map(str, files)],
    )


def _parts(location: Location, cells: Sequence[LocatedCell]) -> Iterator[str | Line | Table]:
    yield from _word_lines(cells)
    rows = [(*cell_row(cell), cell.n_modems) for cell in cells[:_MOST_ROWS]]
    yield Table([*CELL_COLUMNS, _MODEMS], rows)
    if len(cells) > _MOST_ROWS:
        yield f"and {len(cells) - _MOST_ROWS} more in the files"
    for logger in location.loggers:
        if logger.contradiction:
            yield Line(f"{logger.logger}: {logger.contradiction}", bullet="left out: ")
        if logger.remark:
            yield Line(f"{logger.logger}: {logger.remark}", bullet="noted: ")
    for cell in cells:
        if cell.error:
            yield Line(f"{cell.cell}: {cell.reasons[0]}", "red")
    if location.unnoticed:
        yield location.unnoticed


def cell_row(cell: LocatedCell) -> tuple[Value, ...]:
    """A cell in `CELL_COLUMNS`."""
    place: tuple[Value, ...] = (None, None, None)
    if cell.where:
        place = (cell.where, cell.r50_m, surely(cell.r95_m, cell.supposition))
    name = cell.cell if cell.n_places == 1 else f"{cell.cell} ({cell.place} of {cell.n_places})"
    return (name, Word(cell.verdict), *place, cell.n_readings, cell.n_runs)


def _word_lines(cells: Sequence[LocatedCell]) -> Iterator[Line]:
    """Each word, the number of runs that say it, and the reasons of one; the worst first."""
    named = [cell for cell in cells if cell.word not in {None, WORDS[0]}]
    named.sort(key=lambda cell: (-WORDS.index(cell.word or WORDS[0]), -cell.word_runs, cell.cell))
    for text, word in dict.fromkeys((_word_text(cell), cell.word) for cell in named):
        yield Line(text, "red" if word == "suspicious" else "yellow")


def _word_text(cell: LocatedCell) -> str:
    times = "1 run" if cell.word_runs == 1 else f"{cell.word_runs} runs"
    return f"{cell.cell} is {cell.word} in {times}: {'; '.join(cell.word_reasons)}."
