"""The command `postproc compare`."""

from pathlib import Path

import click

from logger.command_line import FILE, INPUT, json_option, late_modules, run_now, show
from logger.core.errors import ConfigError

with late_modules():
    from logger.core import runfile
    from postproc import atomic_write, cell_work, progress
    from postproc.comparison import changes, report, scene


@click.command
@click.argument("a", type=INPUT, metavar="A")
@click.argument("b", type=INPUT, metavar="B")
@click.option("-o", "--output", type=FILE, metavar="PAGE.HTML", help="Write a page as well.")
@click.option(
    "--save", type=FILE, metavar="CHANGES.RRD",
    help="Write a recording as well; `postproc view CHANGES.RRD` shows it.",
)  # fmt: skip
@click.option("-v", "--verbose", is_flag=True, help="Every cell with its reason.")
@json_option
def compare(
    a: Path, b: Path, output: Path | None, save: Path | None, *, verbose: bool, as_json: bool
) -> int:
    """Compare two walks: cells that are new, gone, moved, stronger or weaker in B.

    A and B are runs. Cells are compared only where both walks could have heard them. The exit code
    is 3 if a comparison failed.
    """
    if save is not None and save.suffix != ".rrd":
        raise ConfigError(f"{save}: a rerun recording is named .rrd")
    run_now(report, *[scene] * (save is not None))
    for path in (output, save):
        if path is not None:
            atomic_write.check_output(path)
    runs = runfile.read_sound_run(a), runfile.read_sound_run(b)
    compared = changes.compare_runs(*runs, progress.with_progress)
    if output is not None:
        with atomic_write.whole_file(output) as part:
            part.write_bytes(report.html(compared).encode())
    if save is not None:
        scene.write_comparison(compared, save)
    show(report.document_of(compared, details=verbose), as_json=as_json)
    return cell_work.exit_code(compared.comparison.cells)
