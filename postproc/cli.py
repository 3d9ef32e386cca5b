"""The command `postproc`: the programs for recorded walks."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from click.shell_completion import get_completion_class

from logger.command_line import (
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
from logger.core.errors import SOMETHING_LOST
from postproc.baseline import baseline
from postproc.comparison.cli import compare
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
from postproc.pictures.cli import plot
from postproc.report.cli import report
from postproc.reproductions.cli import theory, toa, validate
from postproc.survey.cli import survey
from postproc.suspicion.cli import suspect
from postproc.verification.cli import celldb, verify
from postproc.view.cli import view

with late_modules():
    from logger.core import document, runfile
    from logger.core.model import prior as priors
    from postproc import cell_work, ground, progress, replay, result, results, summary
    from postproc import info as description
    from postproc.suspicion import run_assessment


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
    import_, export, share, view, plot, report, recover,
    guide, next_command, suspect, validate, verify, celldb, baseline,
    compare, survey,
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
    for group, own_cells in groups:
        asked = result.Options(prior, loss, within_m)
        find = stored_or_estimated if own_cells else estimate
        estimated = find(group.runs, own_cells, asked)
        with_words, _ = run_assessment.conspicuous_first(
            estimated, progress.with_progress, group.several
        )
        summed = summary.summarise(with_words)
        said, failures = summary.document_of(summed, details=bool(cells or verbose))
        estimates.append(estimated)
        documents.append(said)
        rows += [*summed.rows, *failures]
    # printed first: a run on a read-only card has an answer too
    show(ground.document_of_groups([group for group, _ in groups], documents), as_json=as_json)
    for (group, own_cells), estimated, said in zip(groups, estimates, documents, strict=True):
        beside = results.path_beside([run.path for run in group.runs])
        if not own_cells or not beside.exists():  # a few cells do not replace all
            results.write(estimated, said.content, beside, own_cells)
    return cell_work.exit_code(rows)


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
