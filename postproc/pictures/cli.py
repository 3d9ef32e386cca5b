"""The command `plot` of `postproc`."""

import argparse
import json
import os

from logger.core.arguments import file_path


def add_plot(plot: argparse.ArgumentParser) -> None:
    plot.add_argument(
        "-o", "--output", type=file_path, metavar="RUN.PNG", help="default: beside the run"
    )
    plot.add_argument(
        "--cell", metavar="NAME", help="cell to show (default: the one with most to tell)"
    )
    plot.add_argument("--json", action="store_true", help="say what was written as JSON")
    plot.set_defaults(command=_plot)


def _plot(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_sound_run
    from postproc.picture_file import check_picture
    from postproc.pictures.plots import draw_run
    from postproc.progress import shown
    from postproc.smoothing import smooth_runs

    target = arguments.output or arguments.run.with_suffix(".png")
    check_picture(target)
    only = arguments.cell and [arguments.cell]
    result = smooth_runs(
        [read_sound_run(arguments.run)], only, progress=shown, processes=os.cpu_count() or 1
    )
    draw_run(result, target)
    print(
        json.dumps({"path": str(target), "bytes": target.stat().st_size}, indent=2)
        if arguments.json
        else target
    )
    return 0
