"""The command `plot` of `postproc`."""

from pathlib import Path

import click

from logger.command_line import FILE, json_option, print_json
from postproc.options import run_argument, stored_or_estimated


@click.command
@run_argument
@click.option("-o", "--output", type=FILE, metavar="RUN.PNG", help="Default: beside the run.")
@click.option(
    "--cell", metavar="NAME", help="Cell to show (default: the one with the most information)."
)
@json_option
def plot(path: Path, output: Path | None, cell: str | None, *, as_json: bool) -> int:
    """Draw a run as a picture.

    The exit code is 3 if the estimate of a cell failed.
    """
    from logger.core.runfile import read_sound_run
    from postproc.cell_work import attempt_alone, exit_code
    from postproc.picture_file import check_picture
    from postproc.pictures.plots import draw_run

    target = output or path.with_suffix(".png")
    check_picture(target)
    result = stored_or_estimated([read_sound_run(path)], [cell] if cell else [])
    attempt_alone(cell or path.name, "its picture", lambda: draw_run(result, target))
    if as_json:
        print_json({"path": target, "bytes": target.stat().st_size})
    else:
        print(target)
    return exit_code(result.cells)
