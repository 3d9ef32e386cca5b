"""The command `report` of `postproc`."""

import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, INPUT, PATH, json_option, print_json
from logger.core.errors import ConfigError
from postproc.options import (
    cells_option,
    claims_options,
    false_alarm_option,
    prior_options,
    runs_argument,
    stored_or_estimated,
    within_option,
)
from postproc.verification.cli import ClaimOptions

if TYPE_CHECKING:
    from logger.core.model.prior import Prior
    from logger.core.runfile import Run
    from postproc.report.rendering import Report
    from postproc.result import Options


@click.command
@runs_argument
@click.option(
    "-o", "--output", type=FILE, metavar="RUN.HTML", help="Default: beside the (first) run."
)
@cells_option
@click.option(
    "--pictures",
    "picture_folder",
    type=PATH,
    metavar="DIR",
    help="Write the pictures too, each as PNG and SVG.",
)
@click.option(
    "--basemap",
    type=INPUT,
    metavar="FILE",
    help="Ground of the plan: PMTiles, MBTiles, or an image with a world file.",
)
@claims_options
@false_alarm_option
@prior_options
@within_option
@json_option
def report(
    paths: Sequence[Path],
    output: Path | None,
    cells: Sequence[str],
    picture_folder: Path | None,
    basemap: Path | None,
    claim: Sequence[str],
    claims: Path | None,
    p_fa: float,
    prior: "Prior",
    within_m: float,
    *,
    as_json: bool,
) -> int:
    """Write one page on a run, or on several together.

    The exit code is 3 if work on a cell failed.
    """
    from logger.core.runfile import read_sound_run
    from postproc.atomic_write import check_folder, check_output
    from postproc.report.wording import number_of
    from postproc.result import Options

    start_s = perf_counter()
    target = output or paths[0].with_suffix(".html")
    check_output(target)
    if picture_folder is not None:
        check_folder(picture_folder)
    if basemap is not None and not basemap.is_file():
        raise ConfigError(f"{basemap}: no such file")
    runs = [read_sound_run(path) for path in paths]
    options = Options(prior, within_m=within_m)
    page = _page(runs, cells, ClaimOptions(claim, claims, p_fa), options, basemap)
    if basemap is not None and page.cell_map is None:
        print(f"{basemap} is not drawn: no cell is located or ambiguous", file=sys.stderr)
    size = page.write(target)
    pictures = list(page.write_figures(picture_folder)) if picture_folder else []
    took_s = perf_counter() - start_s
    if as_json:
        written = {"path": target, "bytes": size, "cells": page.cells, "pictures": pictures}
        print_json(written | {"seconds": round(took_s, 2)})
        return page.exit_code
    more = f", {len(pictures)} pictures in {picture_folder}" if pictures else ""
    detailed = f"{number_of(len(page.cells), 'cell')} in detail"
    print(f"{target}: {detailed}, {size / 1e6:.2f} MB in {took_s:.1f} s{more}")
    return page.exit_code


def _page(
    runs: "list[Run]",
    cells: Sequence[str],
    claims: ClaimOptions,
    options: "Options",
    basemap: Path | None,
) -> "Report":
    from postproc.progress import with_progress
    from postproc.report.rendering import MOST_DETAILED, make_report
    from postproc.suspicion.run_assessment import conspicuous_first

    if len(runs) > 1 and claims:
        raise ConfigError("a claim is tested against one run: name only that run")
    result, conspicuous = conspicuous_first(stored_or_estimated(runs, cells, options))
    verified = claims.test(result, cells or [None], options.prior)
    return make_report(
        result,
        verified,
        most=max(MOST_DETAILED, len(cells)),
        first=conspicuous,
        basemap=basemap,
        progress=with_progress,
    )
