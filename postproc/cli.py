"""The command `postproc`: the programs for recorded walks."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from logger.command_line import (
    json_option,
    print_json,
    recover,
    run_program,
    version_option,
)
from postproc.baseline.cli import baseline
from postproc.comparison.cli import compare
from postproc.guidance.cli import guide, next_command
from postproc.interop.cli import export, import_, share
from postproc.options import (
    cells_option,
    estimate,
    prior_options,
    run_argument,
    runs_argument,
    within_option,
)
from postproc.pictures.cli import plot
from postproc.report.cli import report
from postproc.reproductions.position_verification.cli import verify_theory
from postproc.reproductions.toa.cli import toa
from postproc.reproductions.validate.cli import validate
from postproc.survey.cli import survey
from postproc.suspicion.cli import suspect
from postproc.verification.cli import celldb, verify
from postproc.view.cli import view

if TYPE_CHECKING:
    from logger.core.model.prior import Prior
    from postproc.cell_work import Failure
    from postproc.result_json import Summary


def main(argv: list[str] | None = None) -> int:
    """Run a command and return its exit code."""
    # the matrices are small: threads of BLAS would wait for each other longer than they work
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_program(program, "postproc", argv)


@click.group(no_args_is_help=False, context_settings={"help_option_names": ["-h", "--help"]})
@version_option()
def program() -> None:
    """Estimate the positions of the cells of a recorded walk.

    RUN is a file run-....h5, or a journal that was not finished.
    """


for _command in (
    import_, export, share, view, plot, report, recover,
    guide, next_command, suspect, toa, validate, verify, verify_theory, celldb, baseline,
    compare, survey,
):  # fmt: skip
    program.add_command(_command)


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
    from logger.core.runfile import read_sound_run
    from postproc.info import describe
    from postproc.info_table import print_info
    from postproc.json_text import as_json as json_text

    if verify or digest is not None:
        return _verify(path, digest, as_json=as_json)
    description = describe(read_sound_run(path))
    if as_json:
        print(json_text(description))
    else:
        print_info(description, details=verbose)
    return 0


def _verify(path: Path, digest: str | None, *, as_json: bool) -> int:
    from dataclasses import asdict

    from logger.core.errors import SOMETHING_LOST
    from logger.core.printable import printable
    from postproc.info import noted_digest, verify

    checks = verify(path, None if digest is None else noted_digest(digest))
    if as_json:
        print_json([asdict(check) for check in checks])
    else:
        for check in checks:
            print(f"{'ok' if check.holds else 'FAIL':4}  {check.what}: {printable(check.text)}")
    return 0 if all(check.holds for check in checks) else SOMETHING_LOST


@program.command
@run_argument
@json_option
def replay(path: Path, *, as_json: bool) -> int:
    """Recompute the live estimate and compare it with the recorded one."""
    from dataclasses import asdict

    from logger.core.runfile import read_run
    from postproc.replay import replay

    result = replay(read_run(path))
    if as_json:
        print_json(asdict(result) | {"equal": result.equal})
    elif not result.n_recorded and not result.n_replayed:
        print("the run contains no live estimate: no 2G cell was decoded while there was a fix")
    elif result.equal:
        words = "; words by other rules" if result.other_rules else ""
        print(f"replay equals live: {result.n_equal} estimates, to the last bit{words}")
    elif result.findings_differ:
        print("replay differs from live: the findings of the rules are not the recorded ones")
    elif result.advice_differs and result.n_equal == result.n_recorded == result.n_replayed:
        print("replay differs from live: the advice where to walk is not the recorded one")
    else:
        print(
            f"replay differs from live: {result.n_recorded} recorded, "
            f"{result.n_replayed} replayed, {result.n_equal} equal; "
            f"first difference at record {result.first_difference}, "
            f"largest {result.largest_m:.3g} m; "
            f"recorded by {result.recorded_by}, replayed by {result.replayed_by}"
        )
    return 0 if result.equal else 1


@program.command
@runs_argument
@cells_option
@prior_options
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
    prior: "Prior",
    loss: Any,
    within_m: float,
    *,
    verbose: bool,
    as_json: bool,
) -> int:
    """Estimate the positions of cells with their uncertainty.

    Several runs are estimated together. The exit code is 3 if the estimate of a cell failed.
    """
    from logger.core.runfile import read_sound_run
    from postproc import results
    from postproc.cell_work import exit_code
    from postproc.result import Options
    from postproc.summary import summarise
    from postproc.suspicion.run_assessment import conspicuous_first

    runs = [read_sound_run(path) for path in paths]
    result = estimate(runs, cells, Options(prior, loss, within_m))
    summary = summarise(conspicuous_first(result)[0])
    # printed first: a run on a read-only card has an answer too
    failures = _print_summary(summary, details=bool(cells or verbose), as_json=as_json)
    beside = results.path_beside(paths[0], together=len(runs) > 1)
    results.write(result, summary, beside, cells)
    return exit_code([*summary.cells, *failures])


def _print_summary(summary: "Summary", *, details: bool, as_json: bool) -> "list[Failure]":
    from postproc.json_text import as_json as json_text
    from postproc.tables import print_summary

    if as_json:
        print(json_text(summary))
        return []
    return print_summary(summary, details=details)


@program.command
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]), metavar="SHELL")
def completion(shell: str) -> None:
    """Print the completion script of a shell.

    SHELL is bash, zsh or fish. To use the script: eval "$(postproc completion bash)"
    """
    from click.shell_completion import get_completion_class

    if generator := get_completion_class(shell):
        print(generator(program, {}, "postproc", "_POSTPROC_COMPLETE").source())


if __name__ == "__main__":
    sys.exit(main())
