"""The command `plot` of `postproc`."""

from pathlib import Path

import click

from logger.command_line import FILE, json_option, late_modules, run_now, show
from postproc.options import run_argument, stored_or_estimated

with late_modules():
    from logger.core import document, runfile
    from postproc import atomic_write, cell_work
    from postproc.pictures import plots


@click.command
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
    result = stored_or_estimated([runfile.read_sound_run(path)], [cell] if cell else [])
    cell_work.attempt_alone(
        cell or path.name, "its picture", lambda: plots.draw_run(result, target)
    )
    content = {"path": target, "bytes": target.stat().st_size}
    show(document.Document(content, body=[str(target)]), as_json=as_json)
    return cell_work.exit_code(result.cells)
