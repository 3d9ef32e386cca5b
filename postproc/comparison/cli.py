"""The command `postproc compare`."""

from pathlib import Path

import click

from logger.command_line import FILE, INPUT, json_option


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
    is 3 if the comparison of a cell failed.
    """
    from logger.core.errors import ConfigError
    from logger.core.runfile import read_sound_run
    from postproc.atomic_write import check_output, whole_file
    from postproc.cell_work import exit_code
    from postproc.comparison.page import html
    from postproc.comparison.run_pair import compare_runs, document_of
    from postproc.comparison.tables import print_comparison
    from postproc.json_text import as_json as json_text

    if save is not None and save.suffix != ".rrd":
        raise ConfigError(f"{save}: a rerun recording is named .rrd")
    for path in (output, save):
        if path is not None:
            check_output(path)
    compared = compare_runs(read_sound_run(a), read_sound_run(b))
    if output is not None:
        with whole_file(output) as part:
            part.write_bytes(html(compared).encode())
    if save is not None:
        from postproc.comparison.scene import write_comparison

        write_comparison(compared, save)
    if as_json:
        print(json_text(document_of(compared)))
    else:
        print_comparison(compared, details=verbose)
    return exit_code(compared.comparison.cells)
