"""The command `postproc suspect`."""

from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from logger.command_line import INPUT, json_option, late_modules, show
from postproc.options import grouped_runs, runs_argument

with late_modules():
    from logger import baseline_file, baseline_store
    from postproc import cell_work, ground, progress
    from postproc.suspicion import run_assessment, signalling
    from postproc.verification import celldb


def _print_rules(context: click.Context, _: click.Parameter, is_wanted: bool) -> None:
    if is_wanted:
        show(run_assessment.document_of_rules(), as_json=False)
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
@click.option(
    "--signalling", "is_signalling", is_flag=True,
    help="List what networks did in signalling instead; it gives no word.",
)  # fmt: skip
@click.option("-v", "--verbose", is_flag=True, help="Name the rules.")
@json_option
def suspect(
    paths: Sequence[Path],
    baseline_path: Path | None,
    celldb_path: Path | None,
    *,
    is_signalling: bool,
    verbose: bool,
    as_json: bool,
) -> int:
    """Print which cells are suspicious, with the reasons.

    Each cell gets one of three words: nothing unusual, unusual or suspicious. The exit
    code is 3 if a rule failed.
    """
    with ExitStack() as stack:
        baseline = database = None
        groups = [group for group, _ in grouped_runs(paths)]
        if is_signalling:
            listed = [signalling.document_of(signalling.signals_of(one.runs)) for one in groups]
            show(ground.document_of_groups(groups, listed), as_json=as_json)
            return 0
        if baseline_path is not None:
            folder = Path(stack.enter_context(TemporaryDirectory()))
            runs = [run for group in groups for run in group.runs]
            others = baseline_store.without_runs(baseline_path, runs, folder)
            baseline = stack.enter_context(closing(baseline_file.BaselineFile(others)))
        if celldb_path is not None:
            database = stack.enter_context(closing(celldb.CellDb(celldb_path)))
        assessed = [
            run_assessment.assess_runs(
                group.runs, baseline, database, progress.with_progress, group.several
            )
            for group in groups
        ]
    documents = [run_assessment.document_of(one, details=verbose) for one in assessed]
    show(ground.document_of_groups(groups, documents), as_json=as_json)
    return cell_work.exit_code([why for one in assessed for why in one.failures.values()])
