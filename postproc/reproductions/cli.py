"""The command `validate` of `postproc`: documents reproduced, and their claims checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from logger.command_line import FILE, SEED, json_option, late_modules, say_new_name, show
from postproc.options import ListCommand, false_alarm_option

with late_modules():
    from postproc import atomic_write, progress
    from postproc.reproductions import checks as checking
    from postproc.reproductions import specification
    from postproc.reproductions import theory as report
    from postproc.reproductions import toa as ranges


class _Validate(click.Group):
    """`postproc validate --quick` of earlier versions is `postproc validate spec --quick`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if "--page" in args:
            text = "--page is gone: `postproc validate spec` prints the table, --json all of it"
            raise click.UsageError(text, ctx)
        if not {"-h", "--help"} & set(args) and (not args or args[0].startswith("-")):
            say_new_name("postproc validate", "postproc validate spec")
            args = ["spec", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_Validate, no_args_is_help=False)
def validate() -> None:
    """Check each claim of a document by measurement.

    The exit code is 1 where our own code is at fault.
    """


@validate.command
@click.option("--quick", is_flag=True, help="Simulate fewer runs: a few seconds.")
@json_option
def spec(*, quick: bool, as_json: bool) -> int:
    """The original specification: its checklist and its derivations."""
    effort = specification.QUICK if quick else specification.THOROUGH
    groups = progress.with_progress(
        specification.GROUPS, "checking the specification", len(specification.GROUPS)
    )
    checks = [check for group in groups for check in group(effort)]
    return _print(checks, {}, as_json=as_json)


@validate.command(cls=ListCommand)
@click.option(
    "--runs", "n_runs", type=int, default=10_000, show_default=True, help="Simulated runs."
)
@click.option("--seed", type=int, default=0, metavar="N")
@click.option(
    "--anchors", metavar='"X,Y X,Y ..."', help="Anchors in metres (default: the README's four)."
)
@click.option(
    "--path",
    "route",
    metavar='"X,Y X,Y ..."',
    help="Positions of the object (default: (k, k), k = 0..10).",
)
@click.option(
    "--sigma2",
    "sigma2_m2",
    type=float,
    multiple=True,
    metavar="M2...",
    help="Variances of a range (default: 0.01 ... 100).",
)
@click.option("--steps", is_flag=True, help="Print the errors of each step as well.")
@click.option("--plot", type=FILE, metavar="FILE", help="Draw the errors (.png, .svg, .pdf).")
@json_option
def toa(
    n_runs: int,
    seed: int,
    anchors: str | None,
    route: str | None,
    sigma2_m2: Sequence[float],
    plot: Path | None,
    *,
    steps: bool,
    as_json: bool,
) -> int:
    """A README's Kalman filter of ranges to anchors, by noise variance."""
    setting = ranges.setting(
        ranges.places(anchors) if anchors is not None else None,
        ranges.places(route) if route is not None else None,
        sigma2_m2 or None,
        n_runs,
        seed,
    )
    if plot is not None:
        atomic_write.check_picture(plot)
    rows = list(
        progress.with_progress(ranges.simulate(setting), "simulating", len(setting.sigma2_m2))
    )
    checks = ranges.checks(setting, rows, steps=steps)
    code = _print(checks, ranges.json_form(setting, rows, steps=steps), as_json=as_json)
    if plot is not None:
        ranges.draw(setting, rows, plot)
    return code


@validate.command(cls=ListCommand)
@false_alarm_option
@click.option(
    "--receivers",
    multiple=True,
    metavar="X,Y[,Z]...",
    help="Metres from the true position (default: ours).",
)
@click.option(
    "--sigma",
    "sigmas_m",
    type=float,
    multiple=True,
    metavar="M...",
    help="Standard deviations of a range (default: 100 and 20000 m).",
)
@click.option(
    "--trials",
    "n_trials",
    type=int,
    default=20_000,
    show_default=True,
    metavar="N",
    help="Simulated claims.",
)
@click.option("--seed", type=SEED, default=0, show_default=True, metavar="N")
@json_option
def theory(
    p_fa: float,
    receivers: Sequence[str],
    sigmas_m: Sequence[float],
    n_trials: int,
    seed: int,
    *,
    as_json: bool,
) -> int:
    """A report's theory of verification, beside a simulation."""
    places = report.places(receivers) if receivers else None
    summary = report.summary(p_fa, places, sigmas_m or report.SIGMAS_M, n_trials, seed)
    return _print(report.checks(summary), summary, as_json=as_json)


def _print(checks: Sequence[checking.Check], figures: checking.Json, *, as_json: bool) -> int:
    show(checking.document_of(checks, figures), as_json=as_json)
    return checking.exit_code(checks)
