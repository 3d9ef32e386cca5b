"""The command `postproc`: the programs for recorded walks."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
from click.shell_completion import get_completion_class

from logger.command_line import (
    FILE,
    INPUT,
    Program,
    json_option,
    late_modules,
    recover,
    run_now,
    run_program,
    show,
    under_old_name,
    version_option,
)
from logger.core.errors import SOMETHING_LOST, ConfigError, RunFileError
from postproc.baseline import baseline
from postproc.guidance.cli import guide, next_command
from postproc.interop.cli import export, import_, share
from postproc.options import (
    area_options,
    cells_option,
    estimate,
    grouped_runs,
    prior_options,
    run_argument,
    runs_argument,
    stored_or_estimated,
    within_option,
)
from postproc.report.cli import report
from postproc.reproductions.cli import theory, toa, validate
from postproc.survey.cli import survey
from postproc.verification.cli import celldb, verify
from postproc.view.cli import view

with late_modules():
    from logger import baseline_file, baseline_store
    from logger.core import document, runfile
    from logger.core.model import prior as priors
    from postproc import atomic_write, cell_work, ground, progress, replay, result, results, summary
    from postproc import info as description
    from postproc.comparison import changes, scene
    from postproc.comparison import report as comparison_report
    from postproc.pictures import plots
    from postproc.suspicion import run_assessment, signalling
    from postproc.verification import celldb as cell_database


def main(argv: list[str] | None = None) -> int:
    """Run a command and return its exit code."""
    # the matrices are small: threads of BLAS would wait for each other longer than they work
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_program(program, "postproc", argv)


_SECTIONS = {
    "Answer": ("smooth", "report", "view", "plot", "suspect", "verify"),
    "Walk on": ("next", "guide"),
    "Compare": ("compare", "baseline"),
    "Files": ("info", "import", "export", "share"),
    "Many walkers": ("survey",),
}


@click.group(
    cls=Program,
    sections=_SECTIONS,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@version_option()
def program() -> None:
    """Estimate the positions of the cells of a recorded walk.

    RUN is a file run-....h5, or a journal that was not finished.
    """


for _command in (
    import_, export, share, view, report, recover,
    guide, next_command, validate, verify, celldb, baseline, survey,
    under_old_name(theory, "postproc verify-theory", "postproc validate theory"),
):  # fmt: skip
    program.add_command(_command)


@program.group("toa", hidden=True)
def _toa() -> None:
    """In earlier versions; now `postproc validate toa`."""


_toa.add_command(under_old_name(toa, "postproc toa simulate", "postproc validate toa"))


@program.command
@run_argument
@click.option(
    "--verify", is_flag=True, help="Check completeness and seal; the exit code is 3 on a failure."
)
@click.option(
    "--digest",
    metavar="HEX",
    help="With --verify: the digest printed at the stop, which a forger cannot reproduce.",
)
@click.option("-v", "--verbose", is_flag=True, help="Every gap and every event.")
@json_option
def info(path: Path, digest: str | None, *, verify: bool, verbose: bool, as_json: bool) -> int:
    """Print what a run contains, its gaps and how it ended."""
    if verify or digest is not None:
        noted = None if digest is None else description.noted_digest(digest)
        checks = description.verify(path, noted)
        show(description.document_of_checks(checks), as_json=as_json)
        return 0 if all(check.holds for check in checks) else SOMETHING_LOST
    run = description.describe(runfile.read_sound_run(path))
    show(description.document_of(run, details=verbose), as_json=as_json)
    return 0


@program.command("replay")
@run_argument
@json_option
def replay_command(path: Path, *, as_json: bool) -> int:
    """Recompute the live estimate and compare it with the recorded one."""
    replayed = replay.replay(runfile.read_run(path))
    content = asdict(replayed) | {"equal": replayed.equal}
    show(document.Document(content, body=[replayed.text]), as_json=as_json)
    return 0 if replayed.equal else 1


@program.command
@runs_argument
@cells_option
@prior_options
@area_options
@click.option(
    "--loss",
    type=click.Choice(["linear", "soft_l1", "huber", "cauchy"]),
    default="linear",
    show_default=True,
    help="Loss function of the least-squares fit.",
)
@within_option
@click.option("-v", "--verbose", is_flag=True, help="Every cell in detail.")
@json_option
def smooth(
    paths: Sequence[Path],
    cells: Sequence[str],
    prior: priors.Prior,
    loss: Any,
    within_m: float,
    *,
    verbose: bool,
    as_json: bool,
) -> int:
    """Estimate the positions of cells with their uncertainty.

    Several runs of a place are estimated together. The exit code is 3 if an estimate failed.
    """
    run_now(summary)
    groups = grouped_runs(paths, cells, prior.area)
    estimates, documents = [], []
    rows: list[cell_work.Row] = []
    for group in groups:
        asked = result.Options(prior, loss, within_m)
        find = stored_or_estimated if group.cells else estimate
        estimated = find(group.runs, group.cells, asked)
        with_words, _ = run_assessment.conspicuous_first(
            estimated, progress.with_progress, group.several
        )
        summed = summary.summarise(with_words)
        said, failures = summary.document_of(summed, details=bool(cells or verbose))
        estimates.append(estimated)
        documents.append(said)
        rows += [*summed.rows, *failures]
    # printed first: a run on a read-only card has an answer too
    show(ground.document_of_groups(groups, documents), as_json=as_json)
    code = cell_work.exit_code(rows)
    for group, estimated, said in zip(groups, estimates, documents, strict=True):
        beside = results.path_beside([run.path for run in group.runs])
        if not group.cells or not beside.exists():  # a few cells do not replace all
            try:
                results.write(estimated, said.content, beside, group.cells)
            except RunFileError as error:
                print(f"not stored, so other commands estimate again: {error}", file=sys.stderr)
                code = SOMETHING_LOST
    return code


@program.command
@run_argument
@click.option("-o", "--output", type=FILE, metavar="RUN.PNG", help="Default: beside the run.")
@click.option(
    "--cell", metavar="NAME", help="Cell to show (default: the one with the most information)."
)
@json_option
def plot(path: Path, output: Path | None, cell: str | None, *, as_json: bool) -> int:
    """Draw a run as a picture.

    The exit code is 3 if an estimate failed.
    """
    run_now(plots)
    target = output or path.with_suffix(".png")
    atomic_write.check_picture(target)
    estimated = stored_or_estimated([runfile.read_sound_run(path)], [cell] if cell else [])
    cell_work.attempt_alone(
        cell or path.name, "its picture", lambda: plots.draw_run(estimated, target)
    )
    content = {"path": target, "bytes": target.stat().st_size}
    show(document.Document(content, body=[str(target)]), as_json=as_json)
    return cell_work.exit_code(estimated.cells)


def _print_rules(context: click.Context, _: click.Parameter, is_wanted: bool) -> None:
    if is_wanted:
        show(run_assessment.document_of_rules(), as_json=context.params["as_json"])
        context.exit()


@program.command
@click.option(
    "--rules", is_flag=True, expose_value=False, callback=_print_rules,
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
        groups = grouped_runs(paths)
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
            database = stack.enter_context(closing(cell_database.CellDb(celldb_path)))
        assessed = [
            run_assessment.assess_runs(
                group.runs, baseline, database, progress.with_progress, group.several
            )
            for group in groups
        ]
    documents = [run_assessment.document_of(one, details=verbose) for one in assessed]
    show(ground.document_of_groups(groups, documents), as_json=as_json)
    return cell_work.exit_code([why for one in assessed for why in one.failures.values()])


@program.command
@click.argument("a", type=INPUT, metavar="A")
@click.argument("b", type=INPUT, metavar="B")
@click.option("-o", "--output", type=FILE, metavar="PAGE.HTML", help="Write a page as well.")
@click.option(
    "--save", type=FILE, metavar="CHANGES.RRD",
    help="Write a recording as well; `postproc view CHANGES.RRD` shows it.",
)  # fmt: skip
@click.option("-v", "--verbose", is_flag=True, help="Every cell with its reason.")
@json_option
def compare(
    a: Path, b: Path, output: Path | None, save: Path | None, *, verbose: bool, as_json: bool
) -> int:
    """Compare two walks: cells that are new, gone, moved, stronger or weaker in B.

    A and B are runs. Cells are compared only where both walks could have heard them. The exit code
    is 3 if a comparison failed.
    """
    if save is not None and save.suffix != ".rrd":
        raise ConfigError(f"{save}: a rerun recording is named .rrd")
    run_now(comparison_report, *[scene] * (save is not None))
    for path in (output, save):
        if path is not None:
            atomic_write.check_output(path)
    runs = runfile.read_sound_run(a), runfile.read_sound_run(b)
    compared = changes.compare_runs(*runs, progress.with_progress)
    if output is not None:
        with atomic_write.whole_file(output) as part:
            part.write_bytes(comparison_report.html(compared).encode())
    if save is not None:
        scene.write_comparison(compared, save)
    said = comparison_report.document_of(compared, details=verbose)
    show(replace(said, remarks=atomic_write.output_remarks(output, save)), as_json=as_json)
    return cell_work.exit_code(compared.comparison.cells)


@program.command
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]), metavar="SHELL")
def completion(shell: str) -> None:
    """Print the completion script of a shell.

    SHELL is bash, zsh or fish. To use the script: eval "$(postproc completion bash)"
    """
    if generator := get_completion_class(shell):
        print(generator(program, {}, "postproc", "_POSTPROC_COMPLETE").source())


if __name__ == "__main__":
    sys.exit(main())
