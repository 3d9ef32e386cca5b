"""The commands `postproc survey ...`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, date, datetime
from importlib.util import find_spec
from pathlib import Path

import click

from logger.command_line import FILE, PATH, json_option, late_modules, missing_library, number, show
from logger.core.errors import SOMETHING_LOST, ConfigError
from postproc.options import (
    Command,
    basemap_option,
    cells_option,
    prior_options,
    read_streets,
    start_of,
    streets_option,
    within_option,
)

with late_modules():
    from logger import baseline_store as store
    from logger.core import document
    from logger.core.model import prior as priors
    from postproc import atomic_write, cell_work, progress
    from postproc import basemap as basemaps
    from postproc import result as estimation
    from postproc.comparison import ground as blocks
    from postproc.comparison import report as comparing
    from postproc.guidance import next_walk
    from postproc.survey import dataset, intake, layers, location, scheduling, tasks
    from postproc.survey.answers import baseline as walks_of_loggers
    from postproc.survey.answers import changes, next_walks, page

folder_argument = click.argument("folder", type=FILE, metavar="SURVEY")


def workers_options(command: Command) -> Command:
    """Add `--scheduler` and `--workers`."""
    command = click.option(
        "--workers",
        type=number(int, 1, 1024),
        metavar="N",
        help="Local processes (default: one for each core).",
    )(command)
    return click.option(
        "--scheduler",
        metavar="tcp://HOST:8786",
        help="A Dask scheduler whose workers read the same folder.",
    )(command)


def _check_libraries(*names: str) -> None:
    """Raise `ConfigError`, with what to install; nothing else of the product needs these."""
    missing = [name for name in names if find_spec(name) is None]
    if missing:
        raise ConfigError(missing_library(missing[0], "[survey]"))


def _day_utc_ns(text: str) -> int:
    """Begin of a day in UTC, in ns since 1970; raises `ConfigError`."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise ConfigError(f"{text[:40]!r} is no date, such as 2026-11-01") from None
    return int(datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()) * 10**9


def _open_survey(folder: Path, *outputs: Path) -> dataset.Survey:
    """The survey, after a line on stderr that says how large it is: what follows takes long.

    Raises `RunFileError` where that will not be written.
    """
    whole = dataset.Survey.open(folder)
    for path in outputs:
        atomic_write.check_output(path)
    kept = (
        "" if os.access(folder, os.W_OK) else "; no estimate is kept in a folder that is read-only"
    )
    print(
        f"{folder}: {_size(len(whole.runs), len(whole.cells()))}{kept}", file=sys.stderr, flush=True
    )
    return whole


def _size(n_runs: int, n_cells: int) -> str:
    return f"{document.number_of(n_runs, 'run')}, {document.number_of(n_cells, 'cell')}"


@click.group(no_args_is_help=False)
def survey() -> None:
    """Many runs of many walkers: where every cell of a city stands.

    SURVEY is a folder that `survey add` makes.
    """


@survey.command
@click.argument("paths", type=PATH, nargs=-1, required=True, metavar="DIR...")
@click.option("-o", "--output", "folder", type=PATH, required=True, metavar="SURVEY",
              help="Folder, made if there is none.")  # fmt: skip
@click.option("--logger", metavar="NAME",
              help="Who recorded these runs (default: a pseudonym of each modem).")  # fmt: skip
@json_option
def add(paths: Sequence[Path], folder: Path, logger: str | None, *, as_json: bool) -> int:
    """Add the runs and logs of folders to a survey.

    Runs that are in the survey are not added again. Damaged and altered ones are left out; the exit
    code is 3 if there was one. The command may be stopped and repeated.
    """
    _check_libraries("pyarrow")
    files = intake.files_of(paths)
    if not files:
        raise ConfigError("these folders have no run and no log")
    if logger is not None and not (logger.isprintable() and 0 < len(logger) <= 64):
        raise ConfigError("--logger is a name of 1 to 64 characters")
    work = intake.add_files(dataset.Survey.open_or_make(folder), files, logger)
    names = [path.name for path in files]
    results = list(progress.with_progress(work, "adding", len(files), names))
    failed = [result for result in results if result.problem]
    whole = dataset.Survey.open(folder)
    n_cells = len(whole.cells())
    content = {
        "survey": folder,
        "runs": len(whole.runs),
        "cells": n_cells,
        "left_out": len(failed),
        "files": results,
    }
    n_known = sum(result.is_known for result in results)
    n_added = len(results) - n_known - len(failed)
    known = f", {n_known} in it already" if n_known else ""
    left = f", {len(failed)} left out" if failed else ""
    text = f"{folder}: {n_added} added{known}{left}; {_size(len(whole.runs), n_cells)}"
    remarks = [f"left out: {result.problem}" for result in failed]
    remarks += [f"{result.path}: {result.remark}" for result in results if result.remark]
    show(document.Document(content, body=[text], remarks=remarks), as_json=as_json)
    return SOMETHING_LOST if failed else 0


@survey.command
@folder_argument
@workers_options
@cells_option
@click.option("--since", metavar="DATE", help="Only walks that began on this day or later (UTC).")
@click.option(
    "-o",
    "--output",
    "stem",
    type=FILE,
    metavar="NAME",
    help="NAME.parquet and NAME.gpkg (default: located, in the folder of the survey).",
)
@prior_options
@within_option
@json_option
def locate(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    cells: Sequence[str],
    since: str | None,
    stem: Path | None,
    prior: priors.Prior,
    within_m: float,
    *,
    as_json: bool,
) -> int:
    """Locate every cell of a survey over all its runs.

    Results are GeoParquet and GeoPackage. A cell that has been located from the same runs is not
    located again. Loggers that contradict the others are named and left out. The exit code is 3 if
    an estimate failed.
    """
    _check_libraries("pyarrow", "distributed", "geopandas")
    options = estimation.Options(prior, within_m=within_m)
    choice = tasks.RunChoice(since_utc_ns=_day_utc_ns(since) if since else None)
    files = layers.files_of(stem or folder / "located")
    whole = _open_survey(folder, *files)
    with scheduling.Cluster(scheduler, workers) as cluster:
        located = location.locate_survey(whole, options, choice, cells, cluster=cluster)
    layers.write_layers(located.cells, located.loggers, files)
    show(location.document_of(located, files), as_json=as_json)
    return cell_work.exit_code(located.cells)


@survey.command
@folder_argument
@click.option("-b", "--baseline", "target", type=FILE, default="baseline.db", show_default=True,
              metavar="FILE", help="The baseline; walks that it has stay.")  # fmt: skip
@json_option
def baseline(folder: Path, target: Path, *, as_json: bool) -> None:
    """Make the baseline of the loggers: what earlier walks heard, by square."""
    _check_libraries("pyarrow")
    whole = dataset.Survey.open(folder)
    with store.BaselineStore(target, create=True) as kept:
        work = walks_of_loggers.add_walks(whole, kept)
        n_new = sum(progress.with_progress(work, "baseline", len(whole.runs)))
        n_walks, n_cells = len(kept.walks()), kept.n_cells()
    content = {"baseline": target, "added": n_new, "walks": n_walks, "cells": n_cells}
    counts = document.number_of(n_walks, "walk"), document.number_of(n_cells, "cell")
    text = f"{target}: {n_new} added; {', '.join(counts)}"
    show(document.Document(content, body=[text]), as_json=as_json)


@survey.command
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
    exit code is 3 if a comparison failed.
    """
    _check_libraries("pyarrow", "distributed")
    until_utc_ns, since_utc_ns = _day_utc_ns(before), _day_utc_ns(after or before)
    if since_utc_ns < until_utc_ns:
        raise ConfigError("--after is a day before --before: walks between them would count twice")
    early = tasks.RunChoice(until_utc_ns=until_utc_ns)
    late = tasks.RunChoice(since_utc_ns=since_utc_ns)
    with scheduling.Cluster(scheduler, workers) as cluster:
        whole = _open_survey(folder)
        compared, n_left_out = changes.compare_times(whole, early, late, cluster=cluster)
    cells = [asdict(cell) for cell in compared.cells]
    for cell in cells:  # without the blocks of each
        del cell["block"], cell["difference_db"]
    content = {
        "common_blocks": compared.n_common_blocks,
        "tests": compared.n_tests,
        "offset_db": compared.offset_db,
        "cells": cells,
    }
    n_changed = sum(cell.is_change for cell in compared.cells)
    ground = (
        f"Both times have walked {blocks.blocks_text(compared.n_common_blocks)}; of other ground "
        "nothing is said. Of surveys in which nothing changed, at most 5 % get a single word."
    )
    shown = [cell for cell in compared.cells if verbose or cell.word != "not comparable"]
    said = document.Document(
        content,
        f"{n_changed} of {len(compared.cells)} cells changed",
        body=[
            *comparing.changed_lines(compared.cells),
            ground,
            *comparing.error_lines(compared.cells),
            comparing.cell_table(shown),
        ],
        remarks=[changes.LEFT_OUT.format(n_left_out)] if n_left_out else (),
    )
    show(said, as_json=as_json)
    return cell_work.exit_code(compared.cells)


@survey.command("map")
@folder_argument
@workers_options
@click.option("-o", "--output", "target", type=FILE, metavar="FILE.html",
              help="Default: survey.html in the folder of the survey.")  # fmt: skip
@basemap_option
@prior_options
@json_option
def map_command(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    target: Path | None,
    basemap: Path | None,
    prior: priors.Prior,
    *,
    as_json: bool,
) -> None:
    """Write one page that needs no network: coverage, cells, regions, unusual ones."""
    _check_libraries("pyarrow", "distributed")
    basemaps.check_basemap(basemap)
    target = target or folder / "survey.html"
    whole = _open_survey(folder, target)
    with scheduling.Cluster(scheduler, workers) as cluster:
        found = location.locate_survey(whole, estimation.Options(prior), cluster=cluster)
    text = page.html(whole, found, location.EVERY_RUN, basemap)
    with atomic_write.whole_file(target) as part:
        part.write_text(text, "utf-8")
    content = {"path": target, "cells": len(found.cells)}
    show(document.Document(content, body=[str(target)]), as_json=as_json)


@survey.command("next")
@folder_argument
@workers_options
@click.option("--walkers", "n", type=number(int, 1, 100), default=1, show_default=True,
              metavar="N", help="How many will walk.")  # fmt: skip
@click.option("--from", "starts", metavar="LAT,LON", multiple=True,
              help="Where a walker begins (repeatable).")  # fmt: skip
@streets_option
@prior_options
@json_option
def next_command(
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    n: int,
    starts: Sequence[str],
    streets: Path | None,
    prior: priors.Prior,
    *,
    as_json: bool,
) -> None:
    """Say where walking would tell most, a route for each walker."""
    _check_libraries("pyarrow", "distributed")
    whole, options = _open_survey(folder), estimation.Options(prior)
    where = [start_of(text) for text in starts]
    lines = read_streets(streets)
    with scheduling.Cluster(scheduler, workers) as cluster:
        found = location.locate_survey(whole, options, cluster=cluster)
    walks = next_walks.next_walks(whole, found.cells, options, n, where, lines)
    content = [{"walker": walker} | next_walk.content_of(walk) for walker, walk in walks.items()]
    body: list[document.Part] = []
    for walker, walk in walks.items():
        title = f"walker {walker}, {walk.answer.cell}: {walk.answer.sentence}"
        body += [document.Line(title, "bold"), *next_walk.parts_of(walk)]
    idle = f"{n - len(walks)} of {n} walkers have no walk: {next_walks.NONE_LEFT}"
    remarks = [idle] if len(walks) < n else []
    show(document.Document({"walks": content}, body=body, remarks=remarks), as_json=as_json)
