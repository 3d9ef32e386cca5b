"""Arguments and options that several commands of `postproc survey` share."""

from collections.abc import Callable

import click

from logger.command_line import FILE, number

folder_argument = click.argument("folder", type=FILE, metavar="SURVEY")


def workers_options(command: Callable[..., int | None]) -> Callable[..., int | None]:
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
