"""The commands of `postproc survey` that answer from a survey."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, INPUT, json_option, number
from postproc.options import prior_options
from postproc.survey.libraries import check_libraries
from postproc.survey.options import (
    folder_argument,
    open_survey,
    workers_options,
)

if TYPE_CHECKING:
    from logger.core.model.prior import Prior


@click.command
@folder_argument
@click.option("-b", "--baseline", "target", type=FILE, default="baseline.db", show_default=True,
              metavar="FILE", help="The baseline; walks that it has stay.")  # fmt: skip
@json_option
def baseline(folder: Path, target: Path, *, as_json: bool) -> None:
    """Make the baseline of the loggers: what earlier walks heard, by square."""
    check_libraries("pyarrow")
    from postproc.baseline.store import BaselineStore
    from postproc.json_text import as_json as json_text
    from postproc.progress import with_progress
    from postproc.survey.answers.baseline import add_walks
    from postproc.survey.dataset import Survey

    whole = Survey.open(folder)
    with BaselineStore(target, create=True) as store:
        work = add_walks(whole, store)
        n_new = sum(with_progress(work, "baseline", len(whole.runs)))
        n_walks, n_cells = len(store.walks()), store.n_cells()
    if as_json:
        document = {"baseline": str(target), "added": n_new, "walks": n_walks, "cells": n_cells}
        print(json_text(document))
    else:
        print(f"{target}: {n_new} added; {n_walks} walks, {n_cells} cells")


@click.command
@folder_argument
@workers_options
@click.option("--before", metavar="DATE", required=True, help="A: walks that began before.")
@click.option("--after", metavar="DATE", help="B: walks that began then or later (default: A's).")
@click.option("-v", "--verbose", is_flag=True, help="Cells that could not be compared, too.")
@json_option
def diff(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    before: str,
    after: str | None,
    *,
    verbose: bool,
    as_json: bool,
) -> int:
    """Compare the walks before a day with those since another.

    Cells are new, gone, moved, stronger or weaker, where walks of both times could hear them. The
    exit code is 3 if the comparison of a cell failed.
    """
    check_libraries("pyarrow", "distributed")
    from postproc.cell_work import exit_code
    from postproc.json_text import as_json as json_text
    from postproc.survey.answers.changes import compare_times
    from postproc.survey.answers.tables import document_of_changes, print_changes
    from postproc.survey.dates import day_utc_ns
    from postproc.survey.scheduling import Cluster
    from postproc.survey.tasks import RunChoice

    early = RunChoice(until_utc_ns=day_utc_ns(before))
    late = RunChoice(since_utc_ns=day_utc_ns(after or before))
    with Cluster(scheduler, workers) as cluster:
        compared = compare_times(open_survey(folder), early, late, cluster=cluster)
    if as_json:
        print(json_text(document_of_changes(compared)))
    else:
        print_changes(compared, details=verbose)
    return exit_code(compared.cells)


@click.command("map")
@folder_argument
@workers_options
@click.option("-o", "--output", "target", type=FILE, metavar="FILE.html",
              help="Default: survey.html in the folder of the survey.")  # fmt: skip
@click.option("--basemap", type=INPUT, metavar="FILE",
              help="Ground of the plan: PMTiles, MBTiles, or an image.")  # fmt: skip
@prior_options
@json_option
def map_command(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    target: Path | None,
    basemap: Path | None,
    prior: "Prior",
    *,
    as_json: bool,
) -> None:
    """Write one page that needs no network: coverage, cells, regions, unusual ones."""
    check_libraries("pyarrow", "distributed")
    from postproc.atomic_write import whole_file
    from postproc.json_text import as_json as json_text
    from postproc.result import Options
    from postproc.survey.answers.page import html
    from postproc.survey.location import EVERY_RUN, locate_survey
    from postproc.survey.scheduling import Cluster

    whole = open_survey(folder)
    with Cluster(scheduler, workers) as cluster:
        found = locate_survey(whole, Options(prior), cluster=cluster)
    text = html(whole, found.cells, found.loggers, EVERY_RUN, basemap)
    target = target or folder / "survey.html"
    with whole_file(target) as part:
        part.write_text(text, "utf-8")
    if as_json:
        print(json_text({"path": str(target), "cells": len(found.cells)}))
    else:
        print(target)


@click.command("next")
@folder_argument
@workers_options
@click.option("--walkers", "n", type=number(int, 1, 100), default=1, show_default=True,
              metavar="N", help="How many will walk.")  # fmt: skip
@click.option("--from", "starts", metavar="LAT,LON", multiple=True,
              help="Where a walker begins (may be repeated).")  # fmt: skip
@click.option("--streets", type=INPUT, metavar="FILE", help="Streets as GeoJSON or GPX.")
@prior_options
@json_option
def next_command(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    n: int,
    starts: Sequence[str],
    streets: Path | None,
    prior: "Prior",
    *,
    as_json: bool,
) -> None:
    """Say where walking would tell most, a route for each walker."""
    check_libraries("pyarrow", "distributed")
    from logger.core.places import Places
    from logger.street_file import read_lines
    from postproc.guidance import next_output
    from postproc.json_text import as_json as json_text
    from postproc.result import Options
    from postproc.survey.answers.next_walks import next_walks
    from postproc.survey.location import EVERY_RUN, locate_survey
    from postproc.survey.scheduling import Cluster
    from postproc.verification.parsing import place_of

    whole, options = open_survey(folder), Options(prior)
    places = [Places.of_degrees(*place_of(text)[:2]) for text in starts]
    lines = () if streets is None else read_lines(streets)
    with Cluster(scheduler, workers) as cluster:
        found = locate_survey(whole, options, cluster=cluster)
    walks = next_walks(whole, found.cells, EVERY_RUN, options, n, places, lines)
    if as_json:
        print(json_text({"walks": [{"walker": one.walker} | next_output.document_of(one.walk)
                                   for one in walks]}))  # fmt: skip
        return
    for one in walks:
        print(f"walker {one.walker}")
        next_output.print_next_walk(one.walk)
