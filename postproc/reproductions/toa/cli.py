"""The command `toa` of `postproc`."""

from collections.abc import Sequence
from pathlib import Path

import click

from logger.command_line import FILE, json_option, late_modules, show
from postproc.options import ListCommand

with late_modules():
    from postproc import picture_file, progress
    from postproc.reproductions.toa import picture, report
    from postproc.reproductions.toa import simulate as simulation


@click.group(no_args_is_help=False)
def toa() -> None:
    """Simulate the README's Kalman filter of ranges to anchors."""


@toa.command(cls=ListCommand)
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
def simulate(
    n_runs: int,
    seed: int,
    anchors: str | None,
    route: str | None,
    sigma2_m2: Sequence[float],
    plot: Path | None,
    *,
    steps: bool,
    as_json: bool,
) -> None:
    """Print the mean errors for each noise variance."""
    setting = simulation.setting(
        report.places(anchors) if anchors is not None else None,
        report.places(route) if route is not None else None,
        sigma2_m2 or None,
        n_runs,
        seed,
    )
    if plot is not None:
        picture_file.check_picture(plot)
    work = simulation.simulate(setting)
    rows = list(progress.with_progress(work, "simulating", len(setting.sigma2_m2)))
    show(report.document_of(setting, rows, steps=steps), as_json=as_json)
    if plot is not None:
        picture.draw(setting, rows, plot)
