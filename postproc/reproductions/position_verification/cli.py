"""The command `verify-theory` of `postproc`."""

from collections.abc import Sequence

import click

from logger.command_line import SEED, json_option, late_modules, show
from postproc.options import ListCommand, false_alarm_option

with late_modules():
    from postproc.reproductions.position_verification import report


@click.command("verify-theory", cls=ListCommand)
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
def verify_theory(
    p_fa: float,
    receivers: Sequence[str],
    sigmas_m: Sequence[float],
    n_trials: int,
    seed: int,
    *,
    as_json: bool,
) -> None:
    """Compare the theory of verification with a simulation."""
    places = report.places(receivers) if receivers else None
    summary = report.summary(p_fa, places, sigmas_m or report.SIGMAS_M, n_trials, seed)
    show(report.document_of(summary), as_json=as_json)
