"""What several commands of `postproc survey` share: arguments, options, libraries, days."""

import sys
from datetime import UTC, date, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, number
from logger.core.errors import ConfigError
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


def day_utc_ns(text: str) -> int:
    """Begin of a day in UTC, in ns since 1970; raises `ConfigError`."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise ConfigError(f"{text[:40]!r} is no date, such as 2026-11-01") from None
    return int(datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()) * 10**9


def check_libraries(*names: str) -> None:
    """Raise `ConfigError`, with what to install, where a library is missing."""
    missing = [name for name in names if find_spec(name) is None]
    if missing:
        raise ConfigError(f"{missing[0]} is missing: pip install 'cellwalk[survey]'")
