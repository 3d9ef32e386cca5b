"""The commands `postproc guide` and `postproc next`."""

import csv
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, INPUT, json_option
from postproc.options import prior_options, runs_argument

if TYPE_CHECKING:
    from logger.core.model.prior import Prior
    from logger.core.places import Places
    from logger.core.readings import Readings
    from logger.core.runfile import Run

_streets_option = click.option(
    "--streets", type=INPUT, metavar="FILE",
    help="Streets that may be walked: lines of GeoJSON or GPX.",
)  # fmt: skip


@click.command
@click.option(
    "--cell", metavar="NAME", help="Follow this cell of the column `cell` (default: the first)."
)
@_streets_option
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
    was_off_map = False
    for row in _rows(needs_cell=cell is not None):
        print(msgspec.json.encode(answers.answer(row)).decode(), flush=True)
        if answers.is_off_map and not was_off_map:
            was_off_map = True
            _say(f"{streets} has no street near the first position, so it is not used")
    if answers.levels == 0:
        _say(f"no row had a level{'' if cell is None else f' of {cell}'} with a position")


def _say(text: str) -> None:
    """On stderr, since stdout has one line for each row."""
    from logger.core.printable import printable

    print(f"postproc: {printable(text)}", file=sys.stderr, flush=True)


def _rows(*, needs_cell: bool) -> Iterator[dict[str, str | None]]:
    """Rows by the names of the header, each as soon as its line is complete."""
    from postproc.foreign_file import LONGEST_ITEM
    from postproc.guidance.filter import COLUMNS

    # Spreadsheets begin with a byte order mark; bytes that are no text are an error of one row
    with open(0, encoding="utf-8-sig", errors="replace", closefd=False) as file:
        lines = iter(partial(file.readline, LONGEST_ITEM), "")
        names = [name.strip().lower() for name in _values(next(lines, ""))]
        missing = [name for name in (*COLUMNS, *["cell"][:needs_cell]) if name not in names]
        if missing:
            raise click.UsageError(f"the header line has no column {', '.join(missing)}")
        for name in (*COLUMNS, "cell", "acc_m", "rat"):
            if names.count(name) > 1:
                raise click.UsageError(f"the header line names {name} twice")
        for values in map(_values, lines):
            if values:
                yield dict(zip(names, [*values, *[None] * len(names)], strict=False))


def _values(line: str) -> list[str]:
    """The fields of one line: a quotation mark that is never closed must not swallow the next."""
    try:
        return next(csv.reader([line]), [])
    except csv.Error:  # a field of more than 128 KiB
        return line.split(",")


@click.command("next")
@runs_argument
@click.option("--cell", metavar="NAME", help="For this cell (default: see below).")
@click.option(
    "--from", "start", metavar="LAT,LON", help="Where the walk begins (default: the last end)."
)
@_streets_option
@click.option("--routes", type=FILE, metavar="FILE.gpx", help="Write the routes to follow.")
@click.option("--map", "picture", type=FILE, metavar="FILE.png", help="Draw where to walk.")
@prior_options
@json_option
def next_command(
    paths: Sequence[Path],
    cell: str | None,
    start: str | None,
    streets: Path | None,
    routes: Path | None,
    picture: Path | None,
    prior: "Prior",
    *,
    as_json: bool,
) -> None:
    """Say where the next walk should go, from recorded walks.

    Routes are ranked by what they would say about the position of one cell for each metre: the
    most suspicious or unusual one, and without such a cell the strongest.
    """
    from logger.street_file import read_lines
    from postproc.atomic_write import check_output
    from postproc.cell_work import attempt_alone
    from postproc.guidance import next_output
    from postproc.guidance.next_walk import next_walk
    from postproc.json_text import as_json as json_text
    from postproc.picture_file import check_picture

    lines = () if streets is None else read_lines(streets)
    if routes is not None:
        check_output(routes)
    if picture is not None:
        check_picture(picture)
    obs = _readings_of(paths, cell)
    walk = attempt_alone(
        obs.cell, "its next walk", lambda: next_walk(obs, prior, _start(start), lines)
    )
    if routes is not None:
        next_output.write_gpx(walk, routes)
    if picture is not None:
        next_output.draw_map(walk, picture)
    if as_json:
        print(json_text(next_output.document_of(walk)))
    else:
        next_output.print_next_walk(walk)


def _readings_of(paths: Sequence[Path], cell: str | None) -> "Readings":
    """Readings of the cell in all runs; where none is named, of the one to look for first."""
    from logger.core.errors import ConfigError
    from logger.core.runfile import read_sound_run
    from postproc.multi_run import check_different, in_one_zone, merge, modems_of, parts_by_cell
    from postproc.walk import observe_run

    runs = [read_sound_run(path) for path in paths]
    check_different(runs)
    observed = in_one_zone([observe_run(run) for run in runs])
    every = [obs for run in observed if run.observations for obs in run.observations.cells]
    cell = cell or _first_to_look_for(runs, every)
    parts = {} if cell is None else parts_by_cell(observed, [cell])
    if cell is None or cell not in parts:
        names = ", ".join(sorted({obs.cell for obs in every})[:10]) or "none"
        raise ConfigError(f"no readings of {cell or 'any cell'} with a position; cells: {names}")
    return merge(parts[cell], modems_of(runs))


def _first_to_look_for(runs: "Sequence[Run]", every: "list[Readings]") -> str | None:
    """The most suspicious or unusual cell that has levels; without one the strongest."""
    from postproc.cell_work import Attempts
    from postproc.suspicion.run_assessment import conspicuous_cells

    levels: dict[str, float] = {}
    tries = Attempts("the choice of its readings")
    for obs, usable in tries.each(every, lambda obs: obs.cell, lambda obs: obs.usable()):
        level_dbm = usable.level_dbm
        if len(level_dbm):
            levels[obs.cell] = max(levels.get(obs.cell, -inf), float(level_dbm.max()))
    conspicuous = conspicuous_cells(runs, levels)
    if conspicuous:
        return conspicuous[0].cell
    return max(levels, key=lambda name: levels[name], default=None)


def _start(text: str | None) -> "Places | None":
    """The place of LAT,LON in degrees."""
    from logger.core.places import Places

    if text is None:
        return None
    try:
        lat_deg, lon_deg = (float(part) for part in text.split(","))
    except ValueError:
        raise click.UsageError(f"--from {text[:40]!r} is not LAT,LON in degrees") from None
    return Places.of_degrees(lat_deg, lon_deg)
