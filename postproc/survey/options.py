"""Arguments and options that several commands of `postproc survey` share."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, number
from postproc.options import Command

if TYPE_CHECKING:
    from postproc.survey.dataset import Survey

folder_argument = click.argument("folder", type=FILE, metavar="SURVEY")


def workers_options(command: Command) -> Command:
    """Add `--scheduler` and `--workers`."""
    command = click.option(
        "--workers",
        type=number(int, 1, 1024),
        metavar="N",
        help="Processes of this machine (default: one for each core).",
    )(command)
    return click.option(
        "--scheduler",
        metavar="tcp://HOST:8786",
        help="A Dask scheduler whose workers read the same folder.",
    )(command)


def open_survey(folder: Path) -> "Survey":
    """The survey, after a line on stderr that says how large it is: what follows takes long."""
    from postproc.survey.dataset import Survey

    survey = Survey.open(folder)
    n_runs, n_cells = len(survey.runs), len(survey.cells())
    print(f"{folder}: {n_runs} runs, {n_cells} cells", file=sys.stderr, flush=True)
    return survey
