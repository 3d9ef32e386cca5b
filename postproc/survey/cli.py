"""The commands `postproc survey ...`."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, PATH, json_option
from postproc.options import cells_option, prior_options, within_option
from postproc.survey.answers.cli import baseline, diff, map_command, next_command
from postproc.survey.options import (
    check_libraries,
    folder_argument,
    open_survey,
    workers_options,
)

if TYPE_CHECKING:
    from logger.core.model.prior import Prior


@click.group(no_args_is_help=False)
def survey() -> None:
    """Many runs of many walkers: where every cell of a city stands.

    SURVEY is a folder that `survey add` makes.
    """


for _command in (baseline, diff, map_command, next_command):
    survey.add_command(_command)


@survey.command
@click.argument("paths", type=PATH, nargs=-1, required=True, metavar="DIR...")
@click.option("-o", "--output", "folder", type=FILE, required=True, metavar="SURVEY",
              help="The folder of the survey; it is made if there is none.")  # fmt: skip
@click.option("--logger", metavar="NAME",
              help="Who recorded these runs (default: a pseudonym of each modem).")  # fmt: skip
@json_option
def add(paths: Sequence[Path], folder: Path, logger: str | None, *, as_json: bool) -> int:
    """Add the runs and logs of folders to a survey.

    A run that is in the survey is not added again. Damaged and altered ones are left out; the exit
    code is 3 if there was one. The command may be stopped at any time and repeated.
    """
    check_libraries("pyarrow")
    from logger.core.errors import SOMETHING_LOST, ConfigError
    from logger.core.printable import printable
    from postproc.json_text import as_json as json_text
    from postproc.progress import with_progress
    from postproc.survey.dataset import Survey
    from postproc.survey.intake import add_files, files_of

    files = files_of(paths)
    if not files:
        raise ConfigError("these folders have no run and no log")
    if logger is not None and not (logger.isprintable() and 0 < len(logger) <= 64):
        raise ConfigError("--logger is a name of 1 to 64 characters")
    work = add_files(Survey.open_or_make(folder), files, logger)
    results = list(with_progress(work, "adding", len(files), [path.name for path in files]))
    failed = [result for result in results if result.problem]
    for result in failed:
        print(f"left out: {printable(result.problem)}", file=sys.stderr)
    for result in results:
        if result.remark:
            print(f"{printable(str(result.path))}: {result.remark}", file=sys.stderr)
    whole = Survey.open(folder)
    n_cells = len(whole.cells())
    if as_json:
        rows = [asdict(result) | {"path": str(result.path)} for result in results]
        print(json_text({"survey": str(folder), "runs": len(whole.runs), "cells": n_cells,
                         "left_out": len(failed), "files": rows}))  # fmt: skip
    else:
        n_known = sum(result.is_known for result in results)
        n_added = len(results) - n_known - len(failed)
        known = f", {n_known} in it already" if n_known else ""
        left = f", {len(failed)} left out" if failed else ""
        print(f"{folder}: {n_added} added{known}{left}; {len(whole.runs)} runs, {n_cells} cells")
    return SOMETHING_LOST if failed else 0


@survey.command
@folder_argument
@workers_options
@cells_option
@click.option("--since", metavar="DATE", help="Only walks that began on this day or later (UTC).")
@click.option(
    "-o",
    "--output",
    "stem",
    type=FILE,
    metavar="NAME",
    help="NAME.parquet and NAME.gpkg (default: located, in the folder of the survey).",
)
@prior_options
@within_option
@json_option
def locate(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    cells: Sequence[str],
    since: str | None,
    stem: Path | None,
    prior: "Prior",
    within_m: float,
    *,
    as_json: bool,
) -> int:
    """Locate every cell of a survey over all its runs.

    Results are written as GeoParquet and GeoPackage. A cell that has been located from the same
    runs is not located again. Loggers that contradict the others are named and left out. The exit
    code is 3 if the estimate of a cell failed.
    """
    check_libraries("pyarrow", "distributed", "geopandas")
    from postproc.cell_work import exit_code
    from postproc.json_text import as_json as json_text
    from postproc.result import Options
    from postproc.survey.layers import write_layers
    from postproc.survey.location import locate_survey
    from postproc.survey.options import day_utc_ns
    from postproc.survey.scheduling import Cluster
    from postproc.survey.tables import document_of, print_location
    from postproc.survey.tasks import RunChoice

    options = Options(prior, within_m=within_m)
    choice = RunChoice(since_utc_ns=day_utc_ns(since) if since else None)
    whole = open_survey(folder)
    with Cluster(scheduler, workers) as cluster:
        location = locate_survey(whole, options, choice, cells, cluster=cluster)
    files = write_layers(location.cells, location.loggers, stem or folder / "located")
    if as_json:
        print(json_text(document_of(location, files)))
    else:
        print_location(location, files)
    return exit_code(location.cells)
