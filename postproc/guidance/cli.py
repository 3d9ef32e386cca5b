"""The commands `postproc guide` and `postproc next`."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path

import click

from logger.command_line import FILE, json_option, late_modules, show
from logger.core.errors import ConfigError
from logger.core.printable import printable
from postproc.options import (
    prior_options,
    read_streets,
    runs_argument,
    start_of,
    streets_option,
)

with late_modules():
    from logger.core import places, readings, runfile
    from logger.core.model import prior as priors
    from postproc import atomic_write, cell_work, foreign_file, ground, multi_run, walk
    from postproc.guidance import filter as guide_filter
    from postproc.guidance import next_walk
    from postproc.suspicion import run_assessment


@click.command
@click.option(
    "--cell", metavar="NAME", help="Follow this cell of the column `cell` (default: the first)."
)
@streets_option
@prior_options
def guide(cell: str | None, streets: Path | None, prior: priors.Prior) -> None:
    """Say where to walk next, row by row: a filter for other loggers.

    Reads CSV with the columns t_s, lat, lon and rssi_dbm from the standard input and prints one
    line of JSON for each row at once. Columns cell, acc_m and rat may follow.
    """
    answers = guide_filter.GuideFilter(prior, cell, read_streets(streets))
    was_off_map = False
    for row in _rows(needs_cell=cell is not None):
        print(answers.line(row), flush=True)
        if answers.is_off_map and not was_off_map:
            was_off_map = True
            _say(f"{streets} has no street near the first position, so it is not used")
    if answers.levels == 0:
        of = " (and a name, if there is a column cell)" if cell is None else f" of {cell}"
        _say(f"no row had a level{of} with a position")


def _say(text: str) -> None:
    """On stderr, since stdout has one line for each row."""
    print(f"postproc: {printable(text)}", file=sys.stderr, flush=True)


def _rows(*, needs_cell: bool) -> Iterator[dict[str, str | None]]:
    """Rows by the names of the header, each as soon as its line is complete."""
    # Spreadsheets begin with a byte order mark; bytes that are no text are an error of one row
    with open(0, encoding="utf-8-sig", errors="replace", closefd=False) as file:
        lines = iter(partial(file.readline, foreign_file.LONGEST_ITEM), "")
        names = [name.strip().lower() for name in _values(next(lines, ""))]
        missing = [
            name for name in (*guide_filter.COLUMNS, *["cell"][:needs_cell]) if name not in names
        ]
        if missing:
            absent = f"the header line has no column {', '.join(missing)}"
            raise click.UsageError(f"{absent}; commas separate columns")
        for name in (*guide_filter.COLUMNS, "cell", "acc_m", "rat"):
            if names.count(name) > 1:
                raise click.UsageError(f"the header line names {name} twice")
        for values in map(_values, lines):
            if values:
                named = dict(zip(names, [*values, *[None] * len(names)], strict=False))
                yield named | {guide_filter.SURPLUS: "".join(values[len(names) :])}


def _values(line: str) -> list[str]:
    """A quotation mark that is never closed must not swallow the next line."""
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
@streets_option
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
    prior: priors.Prior,
    *,
    as_json: bool,
) -> None:
    """Say where the next walk should go, from recorded walks.

    Routes are ranked by what they would say about the position of one cell for each metre: the
    most suspicious or unusual one, and without such a cell the strongest.
    """
    lines = read_streets(streets)
    if routes is not None:
        atomic_write.check_output(routes)
    if picture is not None:
        atomic_write.check_picture(picture)
    begin = None if start is None else start_of(start)
    obs = _readings_of(paths, cell, begin)
    found = cell_work.attempt_alone(
        obs.cell,
        "its next walk",
        lambda: next_walk.next_walk(obs, prior, begin, lines),
    )
    if routes is not None:
        next_walk.write_gpx(found, routes)
    if picture is not None:
        next_walk.draw_map(found, picture)
    said = next_walk.document_of(found)
    show(replace(said, remarks=atomic_write.output_remarks(routes, picture)), as_json=as_json)


def _readings_of(
    paths: Sequence[Path], cell: str | None, begin: places.Places | None = None
) -> readings.Readings:
    runs = [runfile.read_sound_run(path) for path in paths]
    multi_run.check_different(runs)
    observed = multi_run.in_one_zone([walk.observe_run(run) for run in runs])
    every = [obs for run in observed if run.observations for obs in run.observations.cells]
    cell = cell or _first_to_look_for(runs, every)
    parts = {} if cell is None else multi_run.parts_by_cell(observed, [cell])
    if cell is None or cell not in parts:
        names = ", ".join(sorted({obs.cell for obs in every})[:10]) or "none"
        raise ConfigError(f"no readings of {cell or 'any cell'} with a position; cells: {names}")
    modems = multi_run.modems_of(runs)
    near, *others = [multi_run.merge(part, modems) for part in ground.places_of(parts[cell])]
    if begin is None or not others:  # the place with most readings
        return near
    return min((near, *others), key=lambda obs: begin.in_zone(obs.utm).away_m(obs.places[-1]))


def _first_to_look_for(runs: Sequence[runfile.Run], every: list[readings.Readings]) -> str | None:
    """The most suspicious or unusual cell that has levels; without one the strongest."""
    levels: dict[str, float] = {}
    tries = cell_work.Attempts("the choice of its readings")
    for obs, usable in tries.each(every, lambda obs: obs.cell, lambda obs: obs.usable()):
        level_dbm = usable.level_dbm
        if len(level_dbm):
            levels[obs.cell] = max(levels.get(obs.cell, -inf), float(level_dbm.max()))
    conspicuous = run_assessment.conspicuous_cells(runs, levels)
    if conspicuous:
        return conspicuous[0].cell
    return max(levels, key=lambda name: levels[name], default=None)
