"""The command `postproc suspect`."""

from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path

import click

from logger.command_line import INPUT, json_option
from postproc.options import runs_argument


def _print_rules(context: click.Context, _: click.Parameter, is_wanted: bool) -> None:
    if is_wanted:
        from postproc.suspicion.run_assessment import ALL_RULES
        from postproc.terminal import print_text, screen

        console = screen()
        for rule in ALL_RULES:
            print_text(console, rule.text, bullet="  - ")
        context.exit()


@click.command
@click.option(
    "--rules", is_flag=True, is_eager=True, expose_value=False, callback=_print_rules,
    help="Print all rules with their needs and rates instead.",
)  # fmt: skip
@runs_argument
@click.option(
    "--baseline", "baseline_path", type=INPUT, metavar="FILE",
    help="Earlier walks, made by `postproc baseline add`.",
)  # fmt: skip
@click.option(
    "--celldb", "celldb_path", type=INPUT, metavar="FILE",
    help="A database of cells, made by `postproc celldb import`.",
)  # fmt: skip
@json_option
def suspect(
    paths: Sequence[Path], baseline_path: Path | None, celldb_path: Path | None, *, as_json: bool
) -> int:
    """Print which cells are suspicious, with the reasons.

    Each cell gets one of three words: nothing unusual, unusual or suspicious. With each word stands
    how often legitimate cells earn it. The exit code is 3 if a rule failed.
    """
    from logger.baseline_file import BaselineFile
    from logger.core.runfile import read_sound_run
    from postproc.cell_work import exit_code
    from postproc.progress import with_progress
    from postproc.suspicion import json_form, tables
    from postproc.suspicion.run_assessment import assess_runs
    from postproc.verification.celldb import CellDb

    with ExitStack() as stack:
        baseline = database = None
        if baseline_path is not None:
            baseline = stack.enter_context(closing(BaselineFile(baseline_path)))
        if celldb_path is not None:
            database = stack.enter_context(closing(CellDb(celldb_path)))
        suspicions = assess_runs(
            [read_sound_run(path) for path in paths], baseline, database, with_progress
        )
    if as_json:
        print(json_form.as_json(suspicions).decode())
    else:
        tables.print_suspicions(suspicions)
    return exit_code(suspicions.failures.values())
