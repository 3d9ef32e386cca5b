"""The command `postproc guide`."""

import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import INPUT
from postproc.options import prior_options

if TYPE_CHECKING:
    from logger.core.model.prior import Prior


@click.command
@click.option("--cell", metavar="NAME", help="Follow this cell of the column `cell`.")
@click.option(
    "--streets", type=INPUT, metavar="FILE",
    help="Streets that may be walked: lines of GeoJSON or GPX.",
)  # fmt: skip
@prior_options
def guide(cell: str | None, streets: Path | None, prior: "Prior") -> None:
    """Say where to walk next, row by row: a filter for other loggers.

    Reads CSV with the columns t_s, lat, lon and rssi_dbm from the standard input and prints one
    line of JSON for each row at once. Columns cell, acc_m and rat may follow.
    """
    import msgspec

    from logger.street_file import read_lines
    from postproc.guidance.filter import GuideFilter

    lines = () if streets is None else read_lines(streets)
    answers = GuideFilter(prior, cell, lines)
    for row in _rows(needs_cell=cell is not None):
        print(msgspec.json.encode(answers.answer(row)).decode(), flush=True)


def _rows(*, needs_cell: bool) -> Iterator[dict[str, str | None]]:
    from postproc.guidance.filter import COLUMNS

    # csv reads ahead of an iterator; readline returns a row as soon as it is complete
    reader = csv.reader(iter(sys.stdin.readline, ""))
    try:
        names = [name.strip().lower() for name in next(reader, [])]
        missing = [name for name in (*COLUMNS, *["cell"][:needs_cell]) if name not in names]
        if missing:
            raise click.UsageError(f"the header line has no column {', '.join(missing)}")
        for values in reader:
            if values:
                yield dict(zip(names, [*values, *[None] * len(names)], strict=False))
    except csv.Error as error:
        raise click.UsageError(f"the standard input is no CSV: {error}") from error
