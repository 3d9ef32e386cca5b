"""The command `report` of `postproc`."""

import argparse
import os
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from logger.core.arguments import file_path, height, path
from logger.core.errors import ConfigError
from postproc.atomic_write import check_folder, check_output
from postproc.verification import cli as verify

if TYPE_CHECKING:
    from logger.core.runfile import Run
    from postproc.report.rendering import Report
    from postproc.result import Options


def add_report(report: argparse.ArgumentParser) -> None:
    report.add_argument(
        "-o", "--output", type=file_path, metavar="RUN.HTML", help="default: beside the (first) run"
    )
    report.add_argument(
        "--cell", action="append", metavar="NAME", help="only this cell (may be repeated)"
    )
    report.add_argument(
        "--pictures", type=path, metavar="DIR", help="the pictures too, each as PNG and SVG"
    )
    verify.add_claims(report)
    report.add_argument(
        "--pfa", type=float, default=0.05, metavar="P", help="false-alarm rate (default: 0.05)"
    )
    report.add_argument(
        "--environment", default="any", help="prior: any (default), open, suburban or urban"
    )
    report.add_argument(
        "--height",
        type=height("--height"),
        metavar="M",
        help="antenna above the receiver (default: 5 m)",
    )
    report.add_argument("--json", action="store_true", help="say what was written as JSON")
    report.set_defaults(command=_report)


def _report(arguments: argparse.Namespace) -> int:
    from logger.core.model.prior import prior_for
    from logger.core.runfile import read_sound_run
    from postproc.result import Options

    begun_s = perf_counter()
    target = arguments.output or arguments.run[0].with_suffix(".html")
    check_output(target)
    if arguments.pictures is not None:
        check_folder(arguments.pictures)
    options = Options(prior_for(arguments.environment, height_m=arguments.height))
    report = _make_report(arguments, [read_sound_run(path) for path in arguments.run], options)
    size = report.write(target)
    pictures = list(report.write_figures(arguments.pictures)) if arguments.pictures else []
    _tell(arguments, target, size, report.cells, pictures, perf_counter() - begun_s)
    return 0


def _make_report(arguments: argparse.Namespace, runs: "list[Run]", options: "Options") -> "Report":
    from postproc.progress import shown
    from postproc.report.rendering import MOST_DETAILED, make_report
    from postproc.smoothing import smooth_runs

    if len(runs) > 1 and (arguments.claim or arguments.claims):
        raise ConfigError("a claim is tested against one run: give that run alone")
    result = smooth_runs(
        runs, arguments.cell, options=options, progress=shown, processes=os.cpu_count() or 1
    )
    verified = None
    if len(runs) == 1:
        verified = verify.verified(
            arguments, runs[0], arguments.cell or [None], arguments.pfa, options.prior
        )
    most = max(MOST_DETAILED, len(arguments.cell or ()))
    return make_report(result, verified, most=most, progress=shown)


def _tell(
    arguments: argparse.Namespace,
    target: Path,
    size: int,
    cells: tuple[str, ...],
    pictures: list[Path],
    took_s: float,
) -> None:
    from postproc.json_text import as_json
    from postproc.report.wording import number_of

    if arguments.json:
        written = {
            "path": str(target),
            "bytes": size,
            "cells": cells,
            "pictures": list(map(str, pictures)),
        }
        print(as_json(written | {"seconds": round(took_s, 2)}))
        return
    detailed = f"{number_of(len(cells), 'cell')} in detail"
    more = f", {len(pictures)} pictures in {arguments.pictures}" if pictures else ""
    print(f"{target}: {detailed}, {size / 1e6:.2f} MB in {took_s:.1f} s{more}")
